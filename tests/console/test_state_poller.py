"""One reading of the state serves all pages."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from tsis.console.pages.shell import NOWHERE, title_of
from tsis.console.viewer import StatePoller
from tsis.console.widgets import address_of

if TYPE_CHECKING:
    from collections.abc import Callable


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
