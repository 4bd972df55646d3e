"""The client of an open page: its identity, permissions and notifications."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from nicegui import run, ui

from tsis.console.auth import client_identity
from tsis.errors import TsisError

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from nicegui.client import Client

    from tsis.calibration import UsableCalibration
    from tsis.console.pages.components._summary import StatePoller, Tabs
    from tsis.console.services import Instrument, InstrumentState


EVERY_S = 0.3  # between two looks at the bench's state
TOLD_MS = 8000  # for which a sentence stays
_log = logging.getLogger(__name__)
Given = ParamSpec("Given")
Made = TypeVar("Made")
Thing = TypeVar("Thing")


class Viewer:
    """The client of an open page; ``visible`` while the page is not behind another tab."""

    def __init__(self, client: Client, instrument: Instrument, glance: StatePoller, tabs: Tabs) -> None:
        self._client, self._instrument, self._summary, self._tabs = client, instrument, glance, tabs
        self.visible = True

    @property
    def identity(self) -> str:
        """Of the browser's tab: it stays the same when the page is loaded anew."""
        return f"tab {self._client.tab_id or self._client.id}"

    @property
    def name(self) -> str:
        """Name shown to others."""
        return client_identity(self._client.request).name or self._tabs.name(self.identity)

    @property
    def logged_in(self) -> bool:
        """Whether the name belongs to a login."""
        return bool(client_identity(self._client.request).name)

    def kept(self, kind: type[Thing]) -> Thing:
        """The saved value of this tab of this kind; it survives changes of page and reloads."""
        return self._tabs.kept(self.identity, kind)

    @property
    def commands(self) -> bool:
        """Whether the client owns the camera's control."""
        owner = self._instrument.control.owner()
        return owner is not None and owner.identity == self.identity

    async def attempt(self, act: Callable[Given, Made], *given: Given.args, **named: Given.kwargs) -> Made | None:
        """Run a slow call outside the event loop; show an error, and return None then."""
        try:
            return await run.io_bound(act, *given, **named)
        except TsisError as error:
            self.complain(str(error))
        except Exception as error:
            _log.exception("an act of a page failed")
            self.complain(f"this failed for an unexpected reason: {type(error).__name__}: {error}")
        return None

    def complain(self, sentence: str) -> None:
        """Say what went wrong."""
        with self._client:
            ui.notify(sentence, type="negative", multi_line=True, timeout=TOLD_MS, close_button="Close")

    def notify(self, sentence: str) -> None:
        """Say what was done."""
        with self._client:
            ui.notify(sentence, type="positive", multi_line=True)

    async def entries(self) -> int | None:
        """Number of changes of the store by any program; None while the console closes. Errors as of the store."""
        return await self._summary.entries()

    def every(self, seconds: float, look: Callable[[], Awaitable[None]]) -> None:
        """Repeat a call every so many seconds while the present part of the page exists and is visible."""
        begun = False

        async def seen() -> None:
            nonlocal begun
            if begun and not self.visible:
                return
            begun = True
            await look()

        ui.timer(seconds, seen)

    def follow(self, show: Callable[[InstrumentState], Any]) -> None:
        """Show the instrument's state now and after each change, while the present part of the page exists.

        A page behind another tab is updated when it is visible again.
        """
        shown: list[InstrumentState] = []

        async def look() -> None:
            state = await self._summary.state()
            if state is None or (shown and (shown[0] is state or shown[0] == state)):
                return
            shown[:] = [state]
            show(state)

        self.every(EVERY_S, look)


class CalibrationMemory:
    """Caches the active calibration, which the instrument checks at each call."""

    def __init__(self, instrument: Instrument) -> None:
        self._instrument = instrument
        self._calibration: UsableCalibration | None = None

    def of(self, state: InstrumentState) -> UsableCalibration | None:
        """The state's calibration; None without one, and after a change."""
        if self._calibration is None or self._calibration.identity != state.calibration_identity:
            self._calibration = self._instrument.calibration if state.calibration_identity else None
        given = self._calibration
        return given if given is not None and given.identity == state.calibration_identity else None


CHANGES_EVERY_S = 1.0
_changes_log = logging.getLogger(__name__)


def follow_store(viewer: Viewer, changed: Callable[[], Awaitable[None]]) -> None:
    """Call ``changed`` now and after every change of the store, while the present part of the page is visible."""
    observed: list[int | None] = []

    async def look() -> None:
        try:
            entries = await viewer.entries()
        except TsisError as error:  # a page that is shown needs no sentence every second
            _changes_log.debug("the store was not read: %s", error)
            entries = -1
        if observed != [entries]:
            observed[:] = [entries]
            await changed()

    viewer.every(CHANGES_EVERY_S, look)
