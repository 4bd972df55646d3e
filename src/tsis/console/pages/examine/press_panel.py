"""Start and stop, the target, what is pressed and how hard, and the snapshot."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.choice_field import ChoiceField
from tsis.console.pages.field_words import FORCE, field_words
from tsis.console.pages.number_field import NumberField
from tsis.console.pages.run_button import RunButton
from tsis.console.pages.words import force_words
from tsis.instrument.naming import LARGEST_TARGET
from tsis.model.check import require_integer
from tsis.records.values import ROLE_WORDS

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.bench.snapshots import Kept
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer


class PressPanel:
    """What the operator does with a press.

    Parameters
    ----------
    bench
        Whose press it is.
    viewer
        Who looks.
    operated
        Takes the controls.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer, self._keeping = bench, viewer, False
        with ui.element("div").classes("row"):
            self._run = RunButton(bench, viewer)
            self._keep = ui.button("Snapshot", icon="photo_camera", on_click=self.snapshot).props("no-caps unelevated")
            with ui.element("div").classes("stepper"):
                back = self._stepper("remove", "Target before", -1)
                self._target = NumberField(viewer, "Target", self._set_target)
                on = self._stepper("add", "Target after", 1)
        with ui.element("div").classes("row"):
            choice = ui.toggle({}, value=None).props("no-caps unelevated toggle-color=primary").classes("roles")
            choice.props('role=group aria-label="Pressed on"')
            self._role = ChoiceField(viewer, choice, lambda role: bench.hold(role=role, by=viewer.identity))
        with ui.element("div").classes("row") as self.force_row:
            self._force = NumberField(
                viewer, "Force", self._hold, unit="N", emptied=lambda: bench.forget_force(by=viewer.identity)
            )
        for control in (self._run.element, self._keep, back, on, self._target.element, choice, self._force.element):
            operated.add(control)

    def show(self, state: BenchState) -> None:
        """Show the bench's press."""
        self._run.show(state.camera)
        self._target.show(state.target)
        self._role.show(state.role, {role: ROLE_WORDS[role] for role in state.roles})
        self._force.show(state.force_n)

    async def snapshot(self) -> None:
        """Keep the press; a second key while the first is being kept does nothing."""
        if self._keeping:
            return
        self._keeping = True
        try:
            kept: Kept | None = await self._viewer.attempt(self._bench.snapshot, by=self._viewer.identity)
        finally:
            self._keeping = False
        if kept is not None:
            self._viewer.tell(kept_words(kept))

    async def step(self, by: int) -> None:
        """Go to the target before or after."""
        await self._viewer.attempt(self._bench.step_target, by, by=self._viewer.identity)

    def _set_target(self, number: float) -> None:
        whole = require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
        self._bench.set_target(whole, by=self._viewer.identity)

    def _hold(self, force_n: float) -> None:
        with field_words(FORCE):
            self._bench.hold(force_n=force_n, by=self._viewer.identity)

    def _stepper(self, icon: str, label: str, by: int) -> ui.button:
        button = ui.button(icon=icon, on_click=lambda: self.step(by)).props("flat dense round")
        button.props["aria-label"] = label
        return button


def kept_words(kept: Kept) -> str:
    """What a snapshot says of itself."""
    press = kept.press
    against = f"; flagged {', '.join(press.flags)}" if press.flags else ""
    notes = "".join(f" {note}." for note in kept.notes)
    return (
        f"Kept for target {kept.target.number}: {ROLE_WORDS[press.role]}, {force_words(press.force_n)}{against}.{notes}"
    )
