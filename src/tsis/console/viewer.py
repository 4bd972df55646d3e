"""The client of an open page: identity, permissions, messages."""

from __future__ import annotations

import asyncio
import json
import logging
import time
from collections import OrderedDict
from typing import TYPE_CHECKING, Any, Final, Generic, ParamSpec, TypeVar, cast

from nicegui import binding, run, ui

from tsis.console.auth import client_name
from tsis.console.messages import plain_message
from tsis.errors import TsisError
from tsis.files.reading import one_line

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from nicegui.client import Client

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.state import InstrumentState


FRESH_S = 0.2  # for which a reading of the state serves every page
ENTRIES_FRESH_S = 0.4  # for which one of the store does
Reading = TypeVar("Reading")


class StatePoller:
    """Reads the instrument's state in a thread, since cameras may be slow; used in one event loop."""

    def __init__(self, instrument: Instrument) -> None:
        self._state = _Shared(lambda: instrument.state(), FRESH_S)
        self._entries = _Shared(lambda: instrument.store.entries(), ENTRIES_FRESH_S)
        self.commands = 0

    async def state(self) -> InstrumentState | None:
        """The state, at most 0.2 s old, shared by all callers; None at the end."""
        return await self._state.read()

    async def entries(self) -> int | None:
        """Entries in the store's audit, at most 0.4 s old, which grow with every change; None at the end."""
        return await self._entries.read()

    def expire(self) -> None:
        """Take note of a command: no reading that began before it is shown any more."""
        self.commands += 1
        self._state.expire()


class _Shared(Generic[Reading]):
    """One reading for all concurrent callers."""

    def __init__(self, source: Callable[[], Reading], fresh_s: float) -> None:
        self._source, self._fresh_s = source, fresh_s
        self._read_s = 0.0
        self._latest: asyncio.Task[Reading | None] | None = None

    def expire(self) -> None:
        self._latest = None

    async def read(self) -> Reading | None:
        while True:
            if self._latest is None or (self._latest.done() and self._is_over(self._latest)):
                self._latest = asyncio.ensure_future(self._refresh())
            task = self._latest
            reading = await asyncio.shield(task)
            if task is self._latest:  # else it expired while it was under way
                return reading

    def _is_over(self, task: asyncio.Task[Reading | None]) -> bool:
        return task.exception() is not None or time.monotonic() - self._read_s > self._fresh_s

    async def _refresh(self) -> Reading | None:
        reading = await run.io_bound(self._source)
        self._read_s = time.monotonic()
        return reading


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
        value = self._values.pop((identity, kind), None) or kind()
        self._values[identity, kind] = value
        if len(self._values) > MOST_VALUES:
            self._values.popitem(last=False)
        return cast("Value", value)


STATE_EVERY_S = 0.3  # between two readings
CORNER: Final = "bottom-right"  # where messages cover least
OPERATOR_KEY = "tsis-operator"  # in the browser's local storage; presence.js has it too
LONGEST_OPERATOR = 60
_log = logging.getLogger(__name__)
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Viewer:
    """The client of an open page; ``visible`` while the page is not behind another tab.

    ``operator`` is the name under which this person works: the login's, else the one that was typed before in this
    browser, which keeps it; empty before the first.
    """

    operator = binding.BindableProperty()

    def __init__(self, client: Client, instrument: Instrument, poller: StatePoller, tabs: Tabs) -> None:
        self._client, self._instrument, self._poller, self._tabs = client, instrument, poller, tabs
        self.visible = True
        self.operator = ""

    @property
    def identity(self) -> str:
        """Of the browser's tab: it stays the same when the page is loaded anew."""
        return f"tab {self._client.tab_id or self._client.id}"

    @property
    def name(self) -> str:
        """Name shown to others."""
        return client_name(self._client.request) or self.operator or self._tabs.name(self.identity)

    @property
    def logged_in(self) -> bool:
        """Whether the name belongs to a login."""
        return bool(client_name(self._client.request))

    def reported_operator(self, name: object) -> None:
        """Take the name that the browser kept; a login's stays, and so does one that was typed meanwhile."""
        if isinstance(name, str) and not self.operator:
            self.operator = one_line(name).strip()[:LONGEST_OPERATOR]

    def remember_operator(self, name: str) -> None:
        """Keep a typed name in this browser, for all pages and after a restart; a login's stays."""
        if name and not self.logged_in and name != self.operator:
            self.operator = name
            self._client.run_javascript(f"localStorage.setItem({json.dumps(OPERATOR_KEY)}, {json.dumps(name)})")

    def saved(self, kind: type[Value]) -> Value:
        """The saved value of this tab of this kind; it survives changes of page and reloads."""
        return self._tabs.saved(self.identity, kind)

    @property
    def commands(self) -> bool:
        """Whether the client owns the camera's control."""
        owner = self._instrument.control.owner()
        return owner is not None and owner.identity == self.identity

    async def attempt(
        self, act: Callable[Arguments, Result], *given: Arguments.args, **named: Arguments.kwargs
    ) -> Result | None:
        """Run a slow call outside the event loop; show an error, and return None then."""
        results: list[Result] = []
        refusal = await self.refusal(lambda: results.append(act(*given, **named)))
        if refusal is not None:
            self.complain(plain_message(refusal))
        return results[0] if results else None

    async def refusal(self, act: Callable[[], object]) -> TsisError | None:
        """Run a slow call outside the event loop, and return its error, which a field shows itself; None without."""
        try:
            await run.io_bound(act)
        except TsisError as error:
            return error
        except Exception as error:
            _log.exception("a command of a page failed")
            return TsisError(f"Unexpected error: {type(error).__name__}: {error}")
        finally:
            self._poller.expire()
        return None

    def command(self, act: Callable[..., object], *given: object) -> Callable[[], Awaitable[object]]:
        """A handler of a control that attempts a command of this client."""
        return lambda: self.attempt(act, *given, by=self.identity)

    def complain(self, message: str) -> None:
        """Say what went wrong, until it is closed; clicks go through the message to what lies under it."""
        with self._client:
            ui.notify(message, type="negative", multi_line=True, timeout=0, close_button="Close", position=CORNER)

    def notify(self, message: str) -> None:
        """Say what was done."""
        with self._client:
            ui.notify(message, type="positive", multi_line=True, position=CORNER)

    async def entries(self) -> int | None:
        """Number of changes of the store by any program; None while the console closes. Errors as of the store."""
        return await self._poller.entries()

    def every(self, seconds: float, refresh: Callable[[], Awaitable[None]]) -> None:
        """Repeat a call every so many seconds while the present part of the page exists and is visible."""
        begun = False

        async def refresh_visible() -> None:
            nonlocal begun
            if self.visible or not begun:
                begun = True
                await refresh()

        ui.timer(seconds, refresh_visible)

    def follow(self, show: Callable[[InstrumentState], Any]) -> None:
        """Show the instrument's state now and after each change or command, while the present part of the page exists.

        A page behind another tab is updated when it is visible again.
        """
        shown: InstrumentState | None = None
        commands = 0  # before which it was shown; each may have changed what is shown by itself

        async def refresh() -> None:
            nonlocal shown, commands
            state = await self._poller.state()
            if state is not None and (state != shown or commands != self._poller.commands):
                shown, commands = state, self._poller.commands
                show(state)

        self.every(STATE_EVERY_S, refresh)
