"""Messages for everybody: trouble, and the camera's owner."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from nicegui import ui
from nicegui.element import Element

from tsis.console.pages.components import Redrawn, panel_title
from tsis.errors import ControlError

if TYPE_CHECKING:
    from nicegui.events import GenericEventArguments

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, InstrumentState, Owner


class Notices:
    """The banner below the header; empty without problems."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._trouble = Redrawn(ui.element("div").classes("banner").props('role="alert"').mark("banner"))
        self._calm = Redrawn(ui.element("div").classes("banner").props('role="status"').mark("watching"))

    def show(self, now: InstrumentState) -> None:
        """Show changes only."""
        if self._trouble.changes_to(now.trouble):
            with self._trouble.element:
                for message in now.trouble:
                    ui.label(message)
        other = now.owner is not None and now.owner.identity != self._viewer.identity
        if self._calm.changes_to(now.owner if other else None) and now.owner is not None and other:
            with self._calm.element:
                ui.label(f"{now.owner.name} holds the camera; you watch.").classes("calm")


class PageVisibility(Element, component="presence.js"):
    """Reports to the viewer when the page becomes visible or hidden, and the operator's name that the browser keeps."""

    def __init__(self, viewer: Viewer) -> None:
        super().__init__()

        def changed(event: GenericEventArguments) -> None:
            viewer.visible = event.args is not False

        self.on("visible", changed)
        self.on("operator", lambda event: viewer.reported_operator(event.args))


TAKE, RELEASE = "Take the camera", "Release the camera"
UNTIL_CLOSED_MS = 0  # duration of a message that stays until it is closed


class ControlButtons:
    """Buttons that take and release the camera.

    They are two, so that a click does what the button said when it was clicked, whatever changes meanwhile.
    """

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._released = self._in_control = False
        self._take = ui.button(TAKE, on_click=self._take_control).props("flat dense no-caps")
        self._release = ui.button(RELEASE, on_click=self._release_control).props("flat dense no-caps")
        self._release.set_visibility(False)
        with (
            ui.dialog().props('role="alertdialog" aria-label="Take the camera over?"') as self._dialog,
            ui.element("div").classes("panel question"),
        ):
            panel_title("Take the camera over?")
            self._question = ui.label()
            with ui.element("div").classes("row"):
                ui.button("Take it over", on_click=self._take_over).props("dense no-caps")
                ui.button("Leave it", on_click=self._dialog.close).props("dense no-caps outline")

    def show(self, now: InstrumentState) -> None:
        """Show the applicable button; notify when somebody else has taken the camera."""
        mine = now.owner is not None and now.owner.identity == self._viewer.identity
        self._take.set_visibility(not mine)
        self._release.set_visibility(mine)
        if self._in_control and now.owner is not None and not mine:
            ui.notify(
                f"{now.owner.name} took the camera over; you watch now.",
                type="warning",
                timeout=UNTIL_CLOSED_MS,
                close_button="Close",
            )
        self._in_control = mine

    def report_open(self) -> None:
        """Report that this page is open; it takes a free camera, unless it was released here."""
        control, viewer = self._instrument.control, self._viewer
        if not ui.context.client.has_socket_connection:
            return
        if viewer.visible and not self._released and control.owner() is None:
            with suppress(ControlError):  # somebody has taken it meanwhile
                control.take(viewer.identity, viewer.name)
        control.heard_of(viewer.identity)

    async def _take_control(self) -> None:
        owner = self._instrument.control.owner()
        if owner is None or owner.identity == self._viewer.identity:
            await self._take_as(over=False)
        else:
            self._question.text = _question(owner)
            self._dialog.open()

    def _release_control(self) -> None:
        self._instrument.control.release(self._viewer.identity)
        self._released, self._in_control = True, False

    async def _take_over(self) -> None:
        self._dialog.close()
        await self._take_as(over=True)

    async def _take_as(self, *, over: bool) -> None:
        """Take the camera; from another owner only after confirmation."""
        self._released = False
        await self._viewer.attempt(self._instrument.control.take, self._viewer.identity, self._viewer.name, over=over)


def _question(owner: Owner) -> str:
    return (
        f"{owner.name} holds the camera and may be in the middle of something. They are told that you took it, and "
        "watch from then on."
    )
