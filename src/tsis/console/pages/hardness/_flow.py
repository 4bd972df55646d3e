"""State of a hardness measurement, and its next step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.console.services import newest_presses
from tsis.records.importing import target_by_number

if TYPE_CHECKING:
    from tsis.console.services import InstrumentState
    from tsis.records import StoredEstimate, StoredPress, TargetRecord
    from tsis.records.store import Store


HARDNESS, TARGET, BALL = "hardness", "target", "ball"
PRESSES = 2  # at different forces, of which the second tests the first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedPresses:
    """The stored presses of the object."""

    number: int  # of the target
    record: TargetRecord | None = None  # None while nothing is stored
    presses: tuple[StoredPress, ...] = ()  # those of the next estimate: the newest of each force
    estimate: StoredEstimate | None = None  # the current hardness

    @property
    def on_object(self) -> tuple[StoredPress, ...]:
        """Presses on the object."""
        return tuple(press for press in self.presses if press.role == TARGET)

    @property
    def is_current(self) -> bool:
        """Whether the estimate rests on these very presses."""
        return self.estimate is not None and set(self.estimate.presses) == {press.id for press in self.presses}


def saved_presses(store: Store, number: int) -> SavedPresses:
    """Read what is stored of a target; errors as of the store."""
    target = target_by_number(store, number)
    if target is None:
        return SavedPresses(number=number)
    record = store.record(target)
    estimate = next((stored for stored in record.active_estimates if stored.kind == HARDNESS), None)
    return SavedPresses(number=number, record=record, presses=newest_presses(record, HARDNESS), estimate=estimate)


def next_free(store: Store, number: int) -> int:
    """``number`` while nothing is stored of it, else the next after all targets."""
    if target_by_number(store, number) is None:
        return number
    return max(target.target.number for target in store.targets()) + 1


def missing_text(state: InstrumentState, *, scaled: bool, responds: bool) -> tuple[str, ...]:
    """Messages of what an estimate still needs; empty when it can run.

    ``scaled`` and ``responds`` say whether the active calibration has the size of a pixel and the response to pressure.
    """
    camera = state.camera
    if camera.choice.is_virtual:
        return () if camera.choice.is_sphere and camera.running else ("lay an object under the virtual probe.",)
    results = []
    if not camera.running:
        results.append("start the camera, on the page Examine; it is stopped.")
    elif camera.lost:
        results.append("wait until the camera is back; it is away.")
    if not state.calibration_identity:
        results.append("put a calibration in force, on the page Camera; there is none (the page Calibrate makes one).")
    elif not responds:
        results.append(f"choose another calibration; {state.calibration!r} does not tell the answer to pressure.")
    elif not scaled:
        results.append(f"choose another calibration; {state.calibration!r} does not tell the size of a pixel.")
    return tuple(results)


def next_step_text(saved: SavedPresses, missing: tuple[str, ...], *, estimating: bool) -> str:
    """The next step, or the state, as a message."""
    count = len(saved.on_object)
    if estimating:
        return "The estimate is running."
    if saved.is_current:
        return "Done. Press again at another force to test it, or begin with another object."
    if missing and count < PRESSES:
        return f"Next: {missing[0]}"
    if count == 0:
        return "Next: press the object, and save the press."
    if count < PRESSES:
        return "Next: press it again at another force; the second press tests the first."
    return "Next: estimate, now that there are presses at two forces."
