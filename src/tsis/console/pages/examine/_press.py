"""The controls of a press and of a sequence, and the saved presses of the target."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.__about__ import LARGEST_TARGET
from tsis.console.pages.components import (
    FORCE,
    ChoiceField,
    NumberField,
    ProgressBar,
    RunButton,
    field_messages,
    force_text,
    number_text_of_field,
    typed_number,
    unit_field,
)
from tsis.console.services import MOST_SEQUENCE_FRAMES
from tsis.model import require_integer
from tsis.records import ROLE_NAMES
from tsis.records.importing import target_by_number

if TYPE_CHECKING:
    from tsis.console.pages.components import OperatorControls, Viewer
    from tsis.console.services import Instrument, InstrumentState, Job, JobState, SavedPress
    from tsis.records import StoredEstimate, StoredPress, Target
    from tsis.records.store import Store


SHOWN = 8  # presses, the newest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedTarget:
    """A target's number and its stored record."""

    number: int
    target: Target | None = None  # None while nothing is stored
    count: int = 0  # of all presses
    presses: tuple[StoredPress, ...] = ()  # the newest ones, the newest first
    estimates: tuple[StoredEstimate, ...] = ()  # the current ones
    damaged: tuple[str, ...] = ()  # a message for each record that cannot be shown


def saved_target(store: Store, number: int) -> SavedTarget:
    """Read the target; errors as of the store."""
    target = target_by_number(store, number)
    if target is None:
        return SavedTarget(number=number)
    count = store.press_count(target)
    record = store.record(target, limit=SHOWN, offset=max(0, count - SHOWN))
    return SavedTarget(
        number=number,
        target=target,
        count=count,
        presses=record.presses[::-1],
        estimates=record.active_estimates,
        damaged=record.damaged,
    )


class PressPanel:
    """Controls of a press."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer, self._saving = instrument, viewer, False
        with ui.element("div").classes("row"):
            self._run = RunButton(instrument, viewer)
            self._save = ui.button("Snapshot", icon="photo_camera", on_click=self.snapshot).props("no-caps unelevated")
            with ui.element("div").classes("stepper"):
                back = self._stepper("remove", "Target before", -1)
                self._target = NumberField(viewer, "Target", self._set_target)
                on = self._stepper("add", "Target after", 1)
        with ui.element("div").classes("row"):
            choice = ui.toggle({}, value=None).props("no-caps unelevated toggle-color=primary").classes("roles")
            choice.props('role=group aria-label="Pressed on"')
            self._role = ChoiceField(viewer, choice, lambda role: instrument.hold(role=role, by=viewer.identity))
        with ui.element("div").classes("row") as self.force_row:
            self._force = NumberField(
                viewer, "Force", self._hold, unit="N", emptied=lambda: instrument.forget_force(by=viewer.identity)
            )
        controls.add(self._run.element, self._save, back, on, self._target.element, choice, self._force.element)

    def show(self, state: InstrumentState) -> None:
        """Show the instrument's press."""
        self._run.show(state.camera)
        if state.camera.running:
            self._save.props(add="unelevated", remove="outline")
        else:
            self._save.props(add="outline", remove="unelevated")
        self._target.show(state.target)
        self._role.show(state.role, {role: ROLE_NAMES[role] for role in state.roles})
        self._force.show(state.force_n)

    async def snapshot(self) -> None:
        """Save the press; a second key during saving does nothing."""
        if self._saving:
            return
        self._saving = True
        try:
            press: SavedPress | None = await self._viewer.attempt(self._instrument.snapshot, by=self._viewer.identity)
        finally:
            self._saving = False
        if press is not None:
            self._viewer.notify(snapshot_text(press))

    async def step(self, by: int) -> None:
        """Go to the target before or after."""
        await self._viewer.attempt(self._instrument.step_target, by, by=self._viewer.identity)

    def _set_target(self, number: float) -> None:
        whole = require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
        self._instrument.set_target(whole, by=self._viewer.identity)

    def _hold(self, force_n: float) -> None:
        with field_messages(FORCE):
            self._instrument.hold(force_n=force_n, by=self._viewer.identity)

    def _stepper(self, icon: str, label: str, by: int) -> ui.button:
        button = ui.button(icon=icon, on_click=lambda: self.step(by)).props("flat dense round")
        button.props["aria-label"] = label
        return button


def snapshot_text(saved: SavedPress) -> str:
    """Text of a snapshot."""
    press = saved.press
    against = f"; flagged {', '.join(press.flags)}" if press.flags else ""
    notes = "".join(f" {note}." for note in saved.notes)
    role, force = ROLE_NAMES[press.role], force_text(press.force_n)
    return f"Saved for target {saved.target.number}: {role}, {force}{against}.{notes}"


SECONDS, FRAMES = "seconds", "frames"
FIRST_LENGTH = 10.0


class SequencePanel:
    """Begin and end a sequence."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with ui.element("div").classes("row"):
            self._length = unit_field("Length", number_text_of_field(FIRST_LENGTH)).classes("number-field")
            self._unit = ui.toggle([SECONDS, FRAMES], value=SECONDS).props("no-caps unelevated toggle-color=primary")
            self._unit.props('role=group aria-label="Unit of the length"')
            self._begin = ui.button("Record", icon="fiber_manual_record", on_click=self._record)
            self._begin.props("no-caps outline")
            self._end = ui.button("End", icon="stop", on_click=viewer.command(instrument.end_sequence))
        self._bar = ProgressBar("Progress of the sequence")
        self._message = ui.label().classes("muted wordy").props("role=status")
        ui.label(
            "Every frame is saved unchanged in the workspace; the recording continues when this page is closed."
        ).classes("muted")
        controls.add(self._length, self._unit, self._begin, self._end.props("no-caps outline"))

    def show(self, state: InstrumentState) -> None:
        """Show how far the sequence is."""
        sequence = state.sequence
        running = sequence is not None and sequence.running
        self._begin.set_visibility(not running)
        self._end.set_visibility(running)
        self._bar.show(sequence)
        self._message.text = sequence_text(sequence)

    async def _record(self) -> None:
        def begin() -> Job:
            length = typed_number("length", self._length.value)
            if self._unit.value == SECONDS:
                return self._instrument.begin_sequence(seconds=length, by=self._viewer.identity)
            frames = require_integer("frames", length, 1, MOST_SEQUENCE_FRAMES)
            return self._instrument.begin_sequence(frames=frames, by=self._viewer.identity)

        await self._viewer.attempt(begin)


def sequence_text(sequence: JobState | None) -> str:
    """How far a sequence is, or what came of it."""
    if sequence is None:
        return ""
    if sequence.running:
        fraction = f": {sequence.fraction:.0%}" if sequence.total else ""
        return f"Recording {sequence.title}{fraction}"
    return f"{sequence.title.capitalize()}: {sequence.sentence}"
