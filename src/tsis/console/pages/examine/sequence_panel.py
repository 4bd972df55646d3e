"""A sequence of frames: begin it, see how far it is, end it; it goes on when the page is closed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench.sequences import MOST_FRAMES
from tsis.console.pages.number_field import shown_number, typed_number, unit_field
from tsis.console.pages.progress_bar import ProgressBar
from tsis.model.check import require_integer

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState, JobState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer

SECONDS, FRAMES = "seconds", "frames"
FIRST_LENGTH = 10.0


class SequencePanel:
    """Begin and end a sequence.

    Parameters
    ----------
    bench, viewer, operated
        As of `PressPanel`.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer = bench, viewer
        with ui.element("div").classes("row"):
            self._length = unit_field("Length", shown_number(FIRST_LENGTH)).classes("number-field")
            self._unit = ui.toggle([SECONDS, FRAMES], value=SECONDS).props("no-caps unelevated toggle-color=primary")
            self._unit.props('role=group aria-label="Unit of the length"')
            self._begin = ui.button("Record", icon="fiber_manual_record", on_click=self._record)
            self._begin.props("no-caps outline")
            self._end = ui.button("End", icon="stop", on_click=self._ended).props("no-caps outline")
        self._bar = ProgressBar("Progress of the sequence")
        self._said = ui.label().classes("muted wordy").props("role=status")
        ui.label("Every frame is kept as it came, in the workspace; it goes on when this page is closed.").classes(
            "muted"
        )
        for control in (self._length, self._unit, self._begin, self._end):
            operated.add(control)

    def show(self, state: BenchState) -> None:
        """Show how far the sequence is."""
        sequence = state.sequence
        running = sequence is not None and sequence.running
        self._begin.set_visibility(not running)
        self._end.set_visibility(running)
        self._bar.show(sequence)
        self._said.text = sequence_words(sequence)

    async def _record(self) -> None:
        await self._viewer.attempt(self._recorded)

    def _recorded(self) -> None:
        length = typed_number("length", str(self._length.value or ""))
        if self._unit.value == FRAMES:
            self._bench.begin_sequence(
                frames=require_integer("frames", length, 1, MOST_FRAMES), by=self._viewer.identity
            )
        else:
            self._bench.begin_sequence(seconds=length, by=self._viewer.identity)

    async def _ended(self) -> None:
        await self._viewer.attempt(self._bench.end_sequence, by=self._viewer.identity)


def sequence_words(sequence: JobState | None) -> str:
    """How far a sequence is, or what came of it."""
    if sequence is None:
        return ""
    if sequence.running:
        share = f": {sequence.share:.0%}" if sequence.total else ""
        return f"Recording {sequence.title}{share}"
    return f"{sequence.title.capitalize()}: {sequence.sentence}"
