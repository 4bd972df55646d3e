"""What the client of a page reads and keeps: shared readings, names of tabs, and changes that pages follow."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest
from nicegui import run, ui
from tests.console.pages.open_page import RecordingViewer, on_a_page, texts
from tests.console.services.instruments import lit_instrument

from tsis.console.pages.design import ProbeEditor
from tsis.console.pages.examine import EstimatePanel
from tsis.console.pages.records import follow_store
from tsis.console.pages.shell import NOWHERE, title_of
from tsis.console.pages.target import TargetPage
from tsis.console.viewer import MOST_NAMES, MOST_VALUES, StatePoller, Tabs
from tsis.console.widgets import address_of

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable
    from pathlib import Path

    from tsis.records.values import Target


class CountedInstrument:
    """Counts the readings of its state; fails on request."""

    def __init__(self) -> None:
        self.looks = 0
        self.fails = False

    def state(self) -> Any:
        if self.fails:
            raise ValueError("nobody foresaw this")
        self.looks += 1
        return object()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Time that passes on request."""
    now = [100.0]
    monkeypatch.setattr("tsis.console.viewer.time", SimpleNamespace(monotonic=lambda: now[0]))

    async def here(command: Callable[[], Any]) -> Any:
        await asyncio.sleep(0)
        return command()

    monkeypatch.setattr("tsis.console.viewer.run", SimpleNamespace(io_bound=here))
    return lambda seconds: now.__setitem__(0, now[0] + seconds)


def test_all_who_ask_at_once_get_one_look(clock: Callable[[float], None]) -> None:
    async def requested() -> None:
        instrument = CountedInstrument()
        poller = StatePoller(instrument)  # type: ignore[arg-type]
        first = await asyncio.gather(*(poller.state() for _ in range(20)))
        assert instrument.looks == 1
        assert all(item is first[0] for item in first)
        clock(0.1)
        assert await poller.state() is first[0]
        clock(0.2)
        assert await poller.state() is not first[0]
        assert instrument.looks == 2

    asyncio.run(requested())


def test_a_look_that_fails_is_told_and_the_next_one_is_tried(clock: Callable[[float], None]) -> None:
    async def requested() -> None:
        instrument = CountedInstrument()
        poller = StatePoller(instrument)  # type: ignore[arg-type]
        instrument.fails = True
        with pytest.raises(ValueError, match="nobody foresaw"):
            await poller.state()
        instrument.fails = False
        assert await poller.state() is not None

    asyncio.run(requested())


def test_who_stops_asking_does_not_stop_the_look_of_others(clock: Callable[[float], None]) -> None:
    async def requested() -> None:
        instrument = CountedInstrument()
        poller = StatePoller(instrument)  # type: ignore[arg-type]
        leaving, staying = asyncio.create_task(poller.state()), asyncio.create_task(poller.state())
        await asyncio.sleep(0)
        leaving.cancel()
        assert await staying is not None
        assert instrument.looks == 1

    asyncio.run(requested())


def test_no_look_that_began_before_a_command_is_given_after_it(clock: Callable[[float], None]) -> None:
    async def requested() -> None:
        instrument = CountedInstrument()
        poller = StatePoller(instrument)  # type: ignore[arg-type]
        before = await poller.state()
        poller.expire()
        under_way = asyncio.create_task(poller.state())
        await asyncio.sleep(0)
        assert not under_way.done()
        poller.expire()
        after = await under_way
        assert after is not before
        assert instrument.looks == 3
        assert await poller.state() is after

    asyncio.run(requested())


@pytest.mark.parametrize(
    ("path", "address"),
    [
        ("/", "/"),
        ("/records/7?x=1#there", "/records"),
        ("/about/", "/about"),
        ("", "/"),
        ("/about?x=/records", "/about"),
    ],
)
def test_a_path_belongs_to_a_page_of_the_navigation(path: str, address: str) -> None:
    assert address_of(path) == address


def test_a_path_without_a_page_is_called_so() -> None:
    assert title_of("/nowhere/at/all") == NOWHERE
    assert title_of("/about") == "About"


def test_names_of_tabs_are_unique_and_limited() -> None:
    tabs = Tabs()
    names = [tabs.name(f"tab {number}") for number in range(MOST_NAMES + 1)]
    assert len(set(names)) == len(names)
    assert tabs.name(f"tab {MOST_NAMES}") == names[-1]
    assert tabs.name("tab 0") not in names


def test_a_tab_finds_its_editor_again_until_many_others_came() -> None:
    tabs = Tabs()
    mine, other = tabs.saved("mine", ProbeEditor), tabs.saved("other", ProbeEditor)
    assert other is not mine
    for number in range(MOST_VALUES - 1):
        tabs.saved(f"tab {number}", ProbeEditor)
        assert tabs.saved("mine", ProbeEditor) is mine
    assert tabs.saved("other", ProbeEditor) is not other
    assert Tabs().saved("mine", ProbeEditor) is not mine


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
