"""Texts of all pages, the shared reading of the state, and values of browser tabs."""

from __future__ import annotations

import asyncio
import time
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, Generic, TypeVar, cast

from nicegui import run

from tsis.present.target import time_text
from tsis.records.values import ROLE_NAMES

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import datetime

    from tsis.console.services import Instrument, InstrumentState
    from tsis.records.values import StoredPress


def force_text(force_n: float | None) -> str:
    """A force, also an unknown one.

    Examples
    --------
    >>> force_text(0.7), force_text(None)
    ('0.7 N', 'no force gauge')
    """
    return "no force gauge" if force_n is None else f"{force_n:.3g} N"


def time_label(when: datetime) -> str:
    """A time where nothing else says that it is in UTC."""
    return f"{time_text(when)} UTC"


def press_label(press: StoredPress) -> str:
    """A press: what was pressed, how hard, when."""
    return f"{ROLE_NAMES[press.role]}, {force_text(press.force_n)}, {time_label(press.taken)}"


def camera_line(state: InstrumentState) -> str:
    """What is done to the camera now, else the name, rate, losses and size of its frames."""
    camera = state.camera
    if state.busy:
        return f"{state.busy.capitalize()} …"
    if not camera.running:
        return "The camera is stopped."
    size = f", {camera.columns} x {camera.rows} pixels" if camera.columns else ""
    times = "once" if camera.interruptions == 1 else f"{camera.interruptions} times"
    breaks = f", interrupted {times}" if camera.interruptions else ""
    return f"{camera.name}: {camera.frames_per_s:.0f} frames/s, {camera.missed} dropped{breaks}{size}"


FRESH_S = 0.2  # for which a reading of the state serves every page
ENTRIES_FRESH_S = 0.4  # for which one of the store does
Reading = TypeVar("Reading")


class StatePoller:
    """Reads the instrument's state in a thread, since cameras may be slow; used in one event loop."""

    def __init__(self, instrument: Instrument) -> None:
        self._state = _Shared(lambda: instrument.state(), FRESH_S)
        self._entries = _Shared(lambda: instrument.store.entries(), ENTRIES_FRESH_S)

    async def state(self) -> InstrumentState | None:
        """The state, at most 0.2 s old, shared by all callers; None at the end."""
        return await self._state.read()

    async def entries(self) -> int | None:
        """Entries in the store's audit, at most 0.4 s old, which grow with every change; None at the end."""
        return await self._entries.read()


class _Shared(Generic[Reading]):
    """One reading for all concurrent callers."""

    def __init__(self, source: Callable[[], Reading], fresh_s: float) -> None:
        self._source, self._fresh_s = source, fresh_s
        self._latest: Reading | None = None
        self._read_s = 0.0
        self._task: asyncio.Task[None] | None = None

    async def read(self) -> Reading | None:
        if self._latest is None or time.monotonic() - self._read_s > self._fresh_s:
            if self._task is None or self._task.done():
                self._task = asyncio.ensure_future(self._refresh())
            await asyncio.shield(self._task)
        return self._latest

    async def _refresh(self) -> None:
        self._latest = await run.io_bound(self._source)
        self._read_s = time.monotonic()


MOST_NAMES = 1000  # tabs; more than anybody opens while a console runs
MOST_VALUES = 50  # saved values, which may be large
Value = TypeVar("Value")


class Tabs:
    """Names and saved values of browser tabs; they survive a reload, and the oldest are dropped.

    Examples
    --------
    >>> tabs = Tabs()
    >>> tabs.name("tab a"), tabs.name("tab b"), tabs.name("tab a")
    ('browser 1', 'browser 2', 'browser 1')
    """

    def __init__(self) -> None:
        self._names: OrderedDict[str, str] = OrderedDict()
        self._values: OrderedDict[tuple[str, type[Any]], Any] = OrderedDict()
        self._count = 0

    def name(self, identity: str) -> str:
        """Name of a browser without a login."""
        if identity not in self._names:
            self._count += 1
            self._names[identity] = f"browser {self._count}"
            if len(self._names) > MOST_NAMES:
                self._names.popitem(last=False)
        return self._names[identity]

    def saved(self, identity: str, kind: type[Value]) -> Value:
        """The saved value of a tab of this kind; a new one at first."""
        result = self._values.pop((identity, kind), None) or kind()
        self._values[identity, kind] = result
        if len(self._values) > MOST_VALUES:
            self._values.popitem(last=False)
        return cast("Value", result)
