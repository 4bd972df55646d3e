"""Saving a press: its files in the workspace, and the press in the store of records."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.calibration.guard import check_press
from tsis.errors import ControlError, InputError, RecordsError, TsisError
from tsis.imaging import colour_map
from tsis.instrument import save_snapshot
from tsis.records.importing import new_target, target_by_number, truth_note

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from tsis.calibration import UsableCalibration
    from tsis.calibration.guard import GuardFlag, GuardReference
    from tsis.console.services._active_calibration import ActiveCalibration
    from tsis.console.services._camera import CameraController
    from tsis.console.services._frame_analysis import PressForce
    from tsis.instrument import Frame, Snapshot
    from tsis.instrument.acquisition import ReceivedFrame
    from tsis.model import TactileImage
    from tsis.records import StoredPress, Target
    from tsis.records.store import Store


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressToSave:
    """A press to save."""

    frame: Frame
    when: datetime  # arrival, in the local time zone
    image: TactileImage  # the frame with scale and force
    force: PressForce | None
    role: str
    probe: str  # empty where unknown
    calibration: UsableCalibration | None
    reference: GuardReference  # of the press guard
    name: str  # of a new target, as its truth
    truth: Mapping[str, float]
    virtual: bool = False  # whether the virtual probe made the press


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedPress:
    """A press that is on the disk and in the store, with its files in the workspace."""

    files: Snapshot
    target: Target
    press: StoredPress
    flags: tuple[GuardFlag, ...]
    notes: tuple[str, ...]


def save_press(taken: PressToSave, *, number: int, workspace: Path, store: Store, map_name: str) -> SavedPress:
    """Save a press under the number of a target, which is created when absent.

    Raises
    ------
    ControlError
        When the virtual probe is on another phantom than the target, or the store is of subjects; nothing is saved.
    FileInputError
        When the files cannot be written; none of them is left then.
    RecordsError
        When the store refuses the press. Its files stay, since the press cannot be repeated; the message names
        them, and ``tsis records import`` enters them.
    """
    if taken.virtual:  # which can press the same again; a press of a real probe is kept whatever is known of its target
        _require_same_phantom(store, taken, number)
    flags = check_press(taken.image, reference=taken.reference)
    files = save_snapshot(
        taken.frame,
        workspace,
        target=number,
        when=taken.when,
        colour=lambda frame: _coloured(frame, map_name),
        about=_about(taken, flags),
    )
    try:
        target, notes = _target(store, taken, number)
        press = store.add_press(
            target,
            taken.image,
            role=taken.role,
            taken=taken.when.astimezone(UTC),
            probe=taken.probe,
            calibration=None if taken.calibration is None else taken.calibration.calibration,
            flags=tuple(flag.name for flag in flags),
        )
    except TsisError as error:
        raise RecordsError(
            f"the files are in {files.raw.parent}, but the press could not be kept in the store: {error} "
            f"(when that is mended, enter it with: tsis records import {files.sidecar})"
        ) from error
    return SavedPress(files=files, target=target, press=press, flags=flags, notes=notes)


def press_to_save(
    frame: ReceivedFrame, *, camera_controller: CameraController, in_force: ActiveCalibration, force: PressForce | None
) -> PressToSave:
    """A received frame as a press of the controller's role, under the active calibration."""
    subject = camera_controller.subject
    return PressToSave(
        frame=frame.frame,
        when=_moment(frame),
        image=frame.frame.tactile_image(mm_per_pixel=in_force.scale, force_n=None if force is None else force.value_n),
        force=force,
        role=camera_controller.role,
        probe=in_force.probe,
        calibration=in_force.calibration,
        reference=in_force.reference,
        name="" if subject is None else subject.name,
        truth={} if subject is None else subject.truth,
        virtual=subject is not None,
    )


def _moment(frame: ReceivedFrame) -> datetime:
    """When a frame came, with the zone of this place."""
    return datetime.now().astimezone() - timedelta(seconds=max(0.0, time.monotonic() - frame.arrived_s))


def _target(store: Store, taken: PressToSave, number: int) -> tuple[Target, tuple[str, ...]]:
    """The target of that number, entered where there is none, and what to know of it."""
    truth = taken.truth if store.kind == "phantom" else {}
    target = target_by_number(store, number)
    if target is None:
        try:
            return new_target(store, [taken.image], number=number, name=taken.name, truth=truth), ()
        except InputError:
            target = target_by_number(store, number)  # somebody else has entered it this moment
            if target is None:
                raise
    return target, tuple(truth_note(truth, target))


def _require_same_phantom(store: Store, taken: PressToSave, number: int) -> None:
    """Refuse, with `ControlError`, what would mix presses of several phantoms, or of a phantom with those of people."""
    if store.kind != "phantom":
        raise ControlError(
            f"the virtual probe presses phantoms, which a store of {store.kind}s does not keep: start the console with "
            "--kind phantom, or choose a camera"
        )
    target = target_by_number(store, number)
    if target is not None and target.truth and dict(target.truth) != dict(taken.truth):
        raise ControlError(
            f"target {number} is of {_phantom_words(target.name, target.truth)}; the virtual probe is on "
            f"{_phantom_words(taken.name, taken.truth)} now: choose another target with + or type its number"
        )


def _phantom_words(name: str, truth: Mapping[str, float]) -> str:
    """A phantom by its name and what is in it, for two may have the same name."""
    values = ", ".join(f"{name} {value:g}" for name, value in sorted(truth.items()))
    return f"{name or 'another phantom'} ({values or 'no inclusion'})"


def _about(taken: PressToSave, flags: tuple[GuardFlag, ...]) -> dict[str, Any]:
    return {
        "role": taken.role,
        "probe": taken.probe,
        "calibration": None if taken.calibration is None else taken.calibration.citation(),
        "force": None if taken.force is None else {"force_n": taken.force.value_n, "source": taken.force.source},
        "flags": [asdict(flag) for flag in flags],
    }


def _coloured(frame: Frame, map_name: str) -> NDArray[np.uint8]:
    return colour_map(frame.tactile_image(), name=map_name)
