"""Presses on the object at two forces, and on a rigid ball where the probe is soft."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench.stage import BALL_MM
from tsis.console.pages.examine.press_panel import kept_words
from tsis.console.pages.field_words import FORCE, field_words
from tsis.console.pages.hardness.flow import BALL, PRESSES, TARGET
from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.number_field import shown_number, typed_number, unit_field
from tsis.console.pages.sentence_list import listed
from tsis.console.pages.words import force_words, time_words

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.bench.snapshots import Kept as KeptPress
    from tsis.console.pages.hardness.flow import Kept
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer
    from tsis.records import StoredPress

FORCES_N = ("0.7", "1.2")  # that are offered


class PressPart:
    """Takes presses and shows those that are kept.

    Parameters
    ----------
    bench, viewer, operated
        As of the page's other parts.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer = bench, viewer
        self._gauge = False
        self._offered = FORCES_N[0]
        self._shown: tuple[str, ...] | None = None
        with ui.element("div").classes("panel stack tight"):
            panel_title("2  Presses")
            self._list = ui.element("ol").classes("hardness-presses")
            self._none = ui.label(f"None yet; {PRESSES} at different forces are best.").classes("muted")
            with ui.element("div").classes("row") as self._row:
                self._force = unit_field("Force", FORCES_N[0], unit="N").classes("hardness-number")
                self._press = ui.button("Press and keep", icon="photo_camera", on_click=lambda: self._keep(TARGET))
                operated.add(self._press.props("no-caps unelevated"))
            self._extra = ui.expansion("Rigid ball, for a soft probe").props("dense").classes("hardness-ball")
            with self._extra:
                ui.label("A ball that does not give tells how much the probe itself gives.").classes("muted")
                with ui.element("div").classes("row"):
                    self._ball_mm = unit_field("Radius of the ball", shown_number(BALL_MM), unit="mm")
                    self._ball_force = unit_field("Force on the ball", FORCES_N[0], unit="N")
                    for field in (self._ball_mm, self._ball_force):
                        field.classes("hardness-number")
                    self._ball = ui.button("Press the ball and keep", on_click=lambda: self._keep(BALL))
                    operated.add(self._ball.props("no-caps outline"))

    def show(self, state: BenchState) -> None:
        """Ask for forces where no gauge tells them."""
        force = None if state.sight is None else state.sight.force
        self._gauge = force is not None and force.source == "gauge"
        self._force.set_visibility(not self._gauge)
        self._ball_force.set_visibility(not self._gauge)

    def kept(self, found: Kept) -> None:
        """Show the presses that an estimate would rest on, and offer the next force."""
        lines = tuple(press_words(press) for press in found.presses)
        if lines != self._shown:
            self._shown = lines
            self._none.set_visibility(not lines)
            self._list.clear()
            with self._list:
                for line in lines:
                    listed(line)
        offered = FORCES_N[min(len(found.on_object), 1)]
        if self._force.value == self._offered != offered:
            self._force.set_value(offered)
        self._offered = offered

    def allow(self, possible: bool) -> None:
        """Say whether a press can be kept now."""
        for part in (self._row, self._extra):
            part.set_visibility(possible)

    def ball_radius(self) -> float:
        """What was typed; `InputError` when it is no number."""
        return typed_number("radius of the ball", str(self._ball_mm.value or ""))

    async def _keep(self, role: str) -> None:
        button, field = (self._press, self._force) if role == TARGET else (self._ball, self._ball_force)
        with loading(button):
            kept: KeptPress | None = await self._viewer.attempt(self._pressed, role, str(field.value or ""))
        if kept is not None:
            self._viewer.tell(kept_words(kept))

    def _pressed(self, role: str, text: str) -> KeptPress:
        force_n = None if self._gauge else typed_number("force", text)
        state = self._bench.state()
        if (state.role, state.force_n) != (role, force_n):  # else it is held so already
            with field_words(FORCE):
                self._bench.hold(role=role, force_n=force_n, by=self._viewer.identity)
        return self._bench.snapshot(by=self._viewer.identity)


def press_words(press: StoredPress) -> str:
    """A press in a line."""
    where = "Object" if press.role == TARGET else "Rigid ball"
    against = f"; against it: {', '.join(press.flags)}" if press.flags else ""
    return f"{where}, {force_words(press.force_n)}, kept at {time_words(press.taken)}{against}"
