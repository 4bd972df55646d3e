"""What pages read again: when it has changed, once for all of them, and never an older reading over a newer one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from nicegui import run, ui
from tests.console.services.instruments import lit_bench
from tests.console.pages.open_page import Told, on_a_page, texts

from tsis.console.pages.components import CalibrationMemory, follow_store
from tsis.console.pages.examine._estimate import EstimatePanel
from tsis.console.pages.records._target import TargetPage

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable
    from pathlib import Path

    import pytest

    from tsis.records import Target


def timers(monkeypatch: pytest.MonkeyPatch) -> list[Callable[[], Awaitable[None]]]:
    """What timers would do, to be done by hand."""
    looks: list[Callable[[], Awaitable[None]]] = []
    monkeypatch.setattr(ui, "timer", lambda _, look, **__: looks.append(look))
    return looks


def test_a_page_that_nobody_sees_looks_once(monkeypatch: pytest.MonkeyPatch) -> None:
    looks, looked = timers(monkeypatch), []

    async def look() -> None:
        looked.append(1)

    async def hidden(viewer: Told) -> None:
        viewer.every(1.0, look)
        viewer.visible = False
        await looks[0]()
        await looks[0]()
        assert len(looked) == 1
        viewer.visible = True
        await looks[0]()
        assert len(looked) == 2

    on_a_page(SimpleNamespace(), hidden)


def test_every_change_is_told_once_whoever_made_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks, told = timers(monkeypatch), []
    monkeypatch.setattr("tsis.console.pages.components._summary.ENTRIES_FRESH_S", 0.0)

    async def changed() -> None:
        told.append(1)

    with lit_bench(tmp_path) as bench:
        target = bench.store.add_target(number=1, name="one")

        async def followed(viewer: Told) -> None:
            follow_store(viewer, changed)
            await looks[0]()
            await looks[0]()
            assert len(told) == 1
            bench.store.edit_target(target, name="another")
            await looks[0]()
            await looks[0]()
            assert len(told) == 2

        on_a_page(bench, followed)


def test_a_name_that_was_changed_is_shown_on_examine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looks = timers(monkeypatch)
    monkeypatch.setattr("tsis.console.pages.components._summary.ENTRIES_FRESH_S", 0.0)
    with lit_bench(tmp_path) as bench:
        target = bench.store.add_target(number=1, name="one")

        async def shown(viewer: Told) -> None:
            panel = EstimatePanel(bench, viewer)
            panel.show(bench.state())
            await looks[0]()
            assert "Target 1: one" in texts(viewer)
            bench.store.edit_target(target, name="another")
            await looks[0]()
            assert "Target 1: another" in texts(viewer)

        on_a_page(bench, shown)


def test_of_two_readings_the_one_asked_for_last_is_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with lit_bench(tmp_path) as bench:
        target: Target = bench.store.add_target(number=1, name="old")
        readings: list[int] = []
        pages: list[TargetPage] = []
        io_bound = run.io_bound

        async def slow_at_first(act: Callable[..., Any], *given: Any) -> Any:
            readings.append(1)
            found = await io_bound(act, *given)
            if len(readings) == 1:  # it has read what was there; the other overtakes it
                bench.store.edit_target(target, name="new")
                await pages[0].load()
            return found

        monkeypatch.setattr("tsis.console.pages.records._target.run", SimpleNamespace(io_bound=slow_at_first))

        async def overtaken(viewer: Told) -> None:
            pages.append(TargetPage(bench, viewer, "1"))
            await pages[0].load()
            assert len(readings) == 2
            assert "Target 1: new" in texts(viewer)

        on_a_page(bench, overtaken)


def test_a_calibration_is_asked_for_when_it_is_another_one() -> None:
    asked: list[int] = []

    class Judging:
        known: Any = SimpleNamespace(identity="a")

        @property
        def calibration(self) -> Any:
            asked.append(1)
            return self.known

    bench: Any = Judging()
    seen = CalibrationMemory(bench)

    def state(identity: str) -> Any:
        return SimpleNamespace(calibration_identity=identity)

    assert seen.of(state("")) is None
    assert not asked
    assert [seen.of(state("a")) for _ in range(3)] == [bench.known] * 3
    assert len(asked) == 1
    before, bench.known = bench.known, None
    assert seen.of(state("b")) is None
    assert seen.of(state("")) is None
    bench.known = before
    assert seen.of(state("a")) is before
