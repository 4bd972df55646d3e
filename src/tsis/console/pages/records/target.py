"""The page of a target: its presses small, its estimates, and what can be done with them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.acts import acts
from tsis.console.pages.records.comparing import compare
from tsis.console.pages.records.estimates import estimates, history
from tsis.console.pages.records.presses import Presses
from tsis.console.pages.records.reading import TargetSeen, read_target
from tsis.console.pages.records.target_edit import about_target
from tsis.console.pages.store_changes import follow_store
from tsis.model.errors import TsisError

if TYPE_CHECKING:
    from tsis.console.bench import Bench
    from tsis.console.pages.viewer import Viewer


def target_page(bench: Bench, viewer: Viewer, number: str) -> None:
    """Build the page of the target whose number stands in the address."""
    follow_store(viewer, TargetPage(bench, viewer, number).load)


class TargetPage:
    """The open page of a target.

    Parameters
    ----------
    bench, viewer
        Whose store it is, and who looks.
    number
        As it stands in the address, whatever that is.
    """

    def __init__(self, bench: Bench, viewer: Viewer, number: str) -> None:
        self.bench, self.viewer, self.number = bench, viewer, number
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                self._head = ui.element("div").classes("row")
                self.below = ui.element("div")
            with ui.element("div").classes("split records-split") as self._parts:
                with ui.element("div").classes("stack"):
                    presses = ui.element("section").classes("panel")
                    self.compared = ui.element("section").classes("panel")
                    self._history = ui.element("section").classes("panel")
                with ui.element("div").classes("stack"):
                    self._estimates = ui.element("section").classes("panel")
                    self._about = ui.element("section").classes("panel")
            self.dialogs = ui.element("div")
        self._wanted = 0
        self._told: tuple[object, ...] = ()
        self.presses = Presses(self, presses)
        self.compared.set_visibility(False)
        self._parts.set_visibility(False)

    async def load(self) -> None:
        """Read the target anew; of several readings at once the last to be asked for is shown."""
        self._wanted += 1
        turn = self._wanted
        seen: TargetSeen | None = None
        refusal = ""
        try:
            seen = await run.io_bound(read_target, self.bench.store, self.number, self.presses.offset)
        except TsisError as error:
            refusal = str(error)
        if turn != self._wanted:
            return
        if refusal:
            self._refuse(refusal)
        elif seen is not None:  # which it is when the program ends
            self._show(seen)

    def _show(self, seen: TargetSeen) -> None:
        if self._told == seen.told:  # a change of another target; a button that is being replaced hears no click
            return
        self._told = seen.told
        self._parts.set_visibility(True)
        self._head.clear()
        with self._head:
            acts(self, seen)
        self.presses.show(seen)
        for place in (self._estimates, self._about, self._history):
            place.clear()
        with self._estimates:
            estimates(seen)
        with self._about:
            about_target(self, seen)
        with self._history:
            history(seen)

    def _refuse(self, sentence: str) -> None:
        self._told = ()
        self._parts.set_visibility(False)
        self._head.clear()
        with self._head:
            panel_title("Target")
            ui.label(sentence).classes("flag").props('role="alert"')
            ui.link("All targets", "/records").classes("link")

    async def compare(self, seen: TargetSeen) -> None:
        """Show the two chosen presses beside each other."""
        await compare(self, seen)
