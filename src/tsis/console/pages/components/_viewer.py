"""The client of an open page: its identity, permissions and notifications."""

from __future__ import annotations

import json
import logging
from typing import TYPE_CHECKING, Any, Final, ParamSpec, TypeVar

from nicegui import binding, run, ui

from tsis.console.auth import client_identity
from tsis.console.pages.components._messages import plain_message
from tsis.errors import TsisError
from tsis.files.reading import one_line

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from nicegui.client import Client

    from tsis.console.pages.components._summary import StatePoller, Tabs
    from tsis.console.services import Instrument, InstrumentState


STATE_EVERY_S = 0.3  # between two readings
CORNER: Final = "bottom-right"  # where messages cover least
OPERATOR_KEY = "tsis-operator"  # in the browser's local storage; presence.js has it too
LONGEST_OPERATOR = 60
_log = logging.getLogger(__name__)
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
Value = TypeVar("Value")


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
        return client_identity(self._client.request).name or self.operator or self._tabs.name(self.identity)

    @property
    def logged_in(self) -> bool:
        """Whether the name belongs to a login."""
        return bool(client_identity(self._client.request).name)

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
        result: list[Result] = []
        refusal = await self.refusal(lambda: result.append(act(*given, **named)))
        if refusal is not None:
            self.complain(plain_message(refusal))
        return result[0] if result else None

    async def refusal(self, act: Callable[[], object]) -> TsisError | None:
        """Run a slow call outside the event loop, and return its error, which a field shows itself; None without."""
        try:
            await run.io_bound(act)
        except TsisError as error:
            return error
        except Exception as error:
            _log.exception("a command of a page failed")
            return TsisError(f"Unexpected error: {type(error).__name__}: {error}")
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
        """Show the instrument's state now and after each change, while the present part of the page exists.

        A page behind another tab is updated when it is visible again.
        """
        shown: InstrumentState | None = None

        async def refresh() -> None:
            nonlocal shown
            state = await self._poller.state()
            if state is not None and state is not shown and state != shown:
                shown = state
                show(state)

        self.every(STATE_EVERY_S, refresh)
