"""The page of a target: report, estimate, recompute, export."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.files import sequence_folders
from tsis.console.pages import components as kit
from tsis.console.pages.records._context import TargetView, export_button, follow_store, read_target
from tsis.console.pages.records._edit import about_target, state_banner
from tsis.console.pages.records._presses import (
    Presses,
    ask_to_compare,
    compare,
    estimate_button,
    estimates,
    history,
    play_sequence,
    recompute_button,
)
from tsis.errors import TsisError

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.pages.records._context import TargetContext
    from tsis.console.services import Instrument


def target_buttons(page: TargetContext, view: TargetView) -> None:
    """Show the name of the target, the way back, and the buttons."""
    target = view.target
    name = f": {target.name}" if target.name else ""
    ui.link("All targets", "/records").classes("link")
    title = "Subject, target {number}{name}" if view.private else "Target {number}{name}"
    kit.panel_title(title.format(number=target.number, name=name)).classes("target-title")
    ui.element("div").classes("spring")
    estimate_button(page, view)
    recompute_button(page, view)
    kit.button("Compare", lambda: ask_to_compare(page, view), icon="compare_arrows", look="outline dense")
    export_button(page, view)
    ui.link("Report", f"/files/report/{target.number}.html", new_tab=True).classes("link button")
    ui.link("PDF", f"/files/report/{target.number}.pdf").classes("link button").props("download")


def show_target(instrument: Instrument, viewer: kit.Viewer, number: str) -> None:
    """Build the page of the target whose number stands in the address."""
    follow_store(viewer, TargetPage(instrument, viewer, number).load)


def sequences(workspace: Path, number: int, dialogs: ui.element) -> None:
    """The recorded sequences of a target: played here, or downloaded as a zip file of frames, index and report."""
    kit.panel_title("Sequences")
    found = sequence_folders(workspace, number)
    if not found:
        kit.muted("No sequence yet: record one on the page Examine.")
        return
    with kit.rows_under(("Sequence", "Frames", ""), label=f"Sequences of target {number}"):
        for name, frames in found.items():
            with ui.element("tr"):
                kit.cell(name)
                kit.cell(f"{frames:,}")
                with ui.element("td"), ui.element("div").classes("row"):
                    play = kit.button(
                        "Play",
                        partial(play_sequence, dialogs, number, name, frames),
                        look="outline dense",
                        label=f"Play {name}",
                    )
                    play.set_visibility(frames > 0)
                    link = ui.link("Download", f"/files/sequence/{number}/{name}.zip").classes("link")
                    link.props["aria-label"] = f"Download {name}"


class TargetPage:
    """The open page of the target whose number stands in the address."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, number: str) -> None:
        self.instrument, self.viewer, self.number = instrument, viewer, number
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                self._head = kit.Redrawn(ui.element("div").classes("row"))
                self._state = ui.element("div")
                self.below = ui.element("div")
            with ui.element("div").classes("split records-split") as self._parts:
                with ui.element("div").classes("stack"):
                    presses = ui.element("section").classes("panel")
                    self.compared = ui.element("section").classes("panel")
                    self._sequences = ui.element("section").classes("panel")
                    self._history = ui.element("section").classes("panel history")
                with ui.element("div").classes("stack"):
                    self._estimates = ui.element("section").classes("panel")
                    self._about = ui.element("section").classes("panel")
            self.dialogs = ui.element("div")
        self._requested = 0
        self.presses = Presses(self, presses)
        self.compared.set_visibility(False)
        self._parts.set_visibility(False)

    async def load(self) -> None:
        """Read the target anew; of several readings at once the last requested one is shown."""
        self._requested += 1
        turn = self._requested
        try:
            view = await run.io_bound(read_target, self.instrument.store, self.number, self.presses.offset)
        except TsisError as error:
            if turn == self._requested:
                self._refuse(str(error))
            return
        if turn == self._requested and view is not None:  # None while the console closes
            self._show(view)

    def _show(self, view: TargetView) -> None:
        if not self._head.changes_to(view.fingerprint):  # unchanged buttons stay: they lose clicks while replaced
            return
        self._parts.set_visibility(True)
        with self._head.element:
            target_buttons(self, view)
        self.presses.show(view)
        for position in (self._state, self._estimates, self._about, self._history):
            position.clear()
        with self._state:
            state_banner(self, view)
        with self._estimates:
            estimates(view)
        with self._about:
            about_target(self, view)
        with self._history:
            history(view)
        self._sequences.clear()
        with self._sequences:
            sequences(self.instrument.terms.workspace, view.target.number, self.dialogs)

    def _refuse(self, message: str) -> None:
        self._parts.set_visibility(False)
        self._head.changes_to(None)
        self._head.element.clear()
        with self._head.element:
            kit.panel_title("Target")
            ui.label(message).classes("flag").props('role="alert"')
            ui.link("All targets", "/records").classes("link")

    async def compare(self, view: TargetView) -> None:
        """Show the two chosen presses beside each other."""
        await compare(self, view)
