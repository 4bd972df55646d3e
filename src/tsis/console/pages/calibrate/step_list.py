"""The steps of a session, one under the other, each with how far it is."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence

    from tsis.console.bench.calibrating import CalibrationSession, StepState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer

ICONS = {"open": "radio_button_unchecked", "under way": "hourglass_top", "done": "check_circle", "left out": "remove"}


class StepList:
    """Lets people choose the step that they look at, and take all of them where nobody is needed.

    Parameters
    ----------
    viewer
        Who looks.
    session
        Whose steps.
    operated
        Takes the button.
    choose
        Called with the name of a step that was clicked.
    """

    def __init__(
        self, viewer: Viewer, session: CalibrationSession, operated: Operated, choose: Callable[[str], Awaitable[None]]
    ) -> None:
        self._viewer, self._session, self._choose = viewer, session, choose
        self._shown: tuple[object, ...] = ()
        self._title = panel_title("Steps")
        self._place = ui.element("ol").classes("calibrate-steps")
        self._all: ui.button | None = None
        if session.rig.by_itself:
            self._all = ui.button("Take all open steps", icon="fast_forward", on_click=self._take_all)
            operated.add(self._all.props("no-caps outline").classes("calibrate-all"))

    def show(self, steps: Sequence[StepState], present: str | None) -> None:
        """Show how far each is; the present one is marked."""
        now = (present, *((state.step.name, state.status, state.frames) for state in steps))
        if now == self._shown:
            return
        self._shown = now
        done = sum(state.status == "done" for state in steps)
        self._title.text = f"Steps: {done} of {len(steps)} done"
        if self._all is not None:
            self._all.set_visibility(any(state.status in ("open", "left out") for state in steps))
        self._place.clear()
        with self._place:
            for state in steps:
                self._item(state, here=state.step.name == present)

    def _item(self, state: StepState, *, here: bool) -> None:
        name = state.step.name
        with ui.element("li"):
            button = ui.button(on_click=partial(self._choose, name)).props("flat no-caps align=left")
            button.classes("calibrate-step here" if here else "calibrate-step")
            button.props["aria-label"] = f"Step {name}: {status_words(state)}"
            if here:
                button.props('aria-current="step"')
            with button:
                ui.icon(ICONS[state.status]).classes(state.status.replace(" ", "-"))
                ui.label(name).classes("calibrate-step-name")
                ui.label(status_words(state)).classes("muted")

    async def _take_all(self) -> None:
        await self._viewer.attempt(self._session.take_all, by=self._viewer.identity)


def status_words(state: StepState) -> str:
    """How far a step is."""
    if state.status == "done":
        return f"{state.frames} frames"
    if state.forces_n:
        return f"{len(state.forces_n)} forces, not kept"
    if state.status == "open" and state.step.optional:
        return "open, may be left out"
    return state.status
