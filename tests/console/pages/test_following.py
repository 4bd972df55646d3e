"""What pages read again: when it has changed, once for all of them, and never an older reading over a newer one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from nicegui import run, ui
from tests.console.pages.open_page import RecordingViewer, on_a_page, texts
from tests.console.services.instruments import lit_instrument

from tsis.console.pages.examine import EstimatePanel
from tsis.console.pages.records import follow_store
from tsis.console.pages.target import TargetPage

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable
    from pathlib import Path

    import pytest

    from tsis.records.values import Target


def timers(monkeypatch: pytest.MonkeyPatch) -> list[Callable[[], Awaitable[None]]]:
    """What timers would do, to be done by hand."""
    checks: list[Callable[[], Awaitable[None]]] = []
    monkeypatch.setattr(ui, "timer", lambda _, check, **__: checks.append(check))
    return checks


def test_a_page_that_nobody_sees_looks_once(monkeypatch: pytest.MonkeyPatch) -> None:
    checks, looked = timers(monkeypatch), []

    async def check() -> None:
        looked.append(1)

    async def hidden(viewer: RecordingViewer) -> None:
        viewer.every(1.0, check)
        viewer.visible = False
        await checks[0]()
        await checks[0]()
        assert len(looked) == 1
        viewer.visible = True
        await checks[0]()
        assert len(looked) == 2

    on_a_page(SimpleNamespace(), hidden)


def test_every_change_is_told_once_whoever_made_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checks, reported = timers(monkeypatch), []
    monkeypatch.setattr("tsis.console.viewer.ENTRIES_FRESH_S", 0.0)

    async def changed() -> None:
        reported.append(1)

    with lit_instrument(tmp_path) as instrument:
        target = instrument.store.add_target(number=1, name="one")

        async def followed(viewer: RecordingViewer) -> None:
            follow_store(viewer, changed)
            await checks[0]()
            await checks[0]()
            assert len(reported) == 1
            instrument.store.edit_target(target, name="another")
            await checks[0]()
            await checks[0]()
            assert len(reported) == 2

        on_a_page(instrument, followed)


def test_a_name_that_was_changed_is_shown_on_examine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checks = timers(monkeypatch)
    monkeypatch.setattr("tsis.console.viewer.ENTRIES_FRESH_S", 0.0)
    with lit_instrument(tmp_path) as instrument:
        target = instrument.store.add_target(number=1, name="one")

        async def shown(viewer: RecordingViewer) -> None:
            panel = EstimatePanel(instrument, viewer, lambda _: None)
            panel.show(instrument.state(), main="")
            await checks[0]()
            assert "Target 1: one" in texts(viewer)
            instrument.store.edit_target(target, name="another")
            await checks[0]()
            assert "Target 1: another" in texts(viewer)

        on_a_page(instrument, shown)


def test_of_two_readings_the_one_asked_for_last_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with lit_instrument(tmp_path) as instrument:
        target: Target = instrument.store.add_target(number=1, name="old")
        readings: list[int] = []
        pages: list[TargetPage] = []
        io_bound = run.io_bound

        async def slow_at_first(command: Callable[..., Any], *given: Any) -> Any:
            readings.append(1)
            result = await io_bound(command, *given)
            if len(readings) == 1:  # it has read what was there; the other overtakes it
                instrument.store.edit_target(target, name="new")
                await pages[0].load()
            return result

        monkeypatch.setattr("tsis.console.pages.target.run", SimpleNamespace(io_bound=slow_at_first))

        async def overtaken(viewer: RecordingViewer) -> None:
            pages.append(TargetPage(instrument, viewer, "1"))
            await pages[0].load()
            assert len(readings) == 2
            assert "Target 1: new" in texts(viewer)

        on_a_page(instrument, overtaken)
