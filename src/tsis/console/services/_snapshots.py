"""Saving a press: its files in the workspace, and the press in the store of records."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

from tsis.calibration.guard import check_press
from tsis.errors import ControlError, InputError, RecordsError, TsisError
from tsis.imaging import colour_map
from tsis.instrument import save_snapshot
from tsis.records.importing import new_target, target_by_number, truth_note

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from tsis.calibration.guard import GuardFlag
    from tsis.console.services._active_calibration import ActiveCalibration
    from tsis.console.services._subject import PressForce, VirtualSubject
    from tsis.instrument import Snapshot
    from tsis.instrument.acquisition import ReceivedFrame
    from tsis.model.image import TactileImage
    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressToSave:
    """A press to save."""

    received: ReceivedFrame
    force: PressForce | None
    role: str
    active: ActiveCalibration
    subject: VirtualSubject | None  # of the virtual probe

    @property
    def image(self) -> TactileImage:
        """The frame with scale and force."""
        force_n = None if self.force is None else self.force.value_n
        return self.received.frame.tactile_image(mm_per_pixel=self.active.scale, force_n=force_n)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavedPress:
    """A press that is on the disk and in the store, with its files in the workspace."""

    files: Snapshot
    target: Target
    press: StoredPress
    flags: tuple[GuardFlag, ...]
    notes: tuple[str, ...]


def save_press(press: PressToSave, *, number: int, workspace: Path, store: Store, map_name: str) -> SavedPress:
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
    if press.subject is not None:  # only the virtual probe can repeat a press that is refused
        _require_same_phantom(store, press.subject, number)
    image, calibration = press.image, press.active.calibration
    when = datetime.now().astimezone() - timedelta(seconds=max(0.0, time.monotonic() - press.received.arrived_s))
    flags = check_press(image, reference=press.active.reference)
    files = save_snapshot(
        press.received.frame,
        workspace,
        target=number,
        when=when,
        colour=lambda frame: colour_map(frame.tactile_image(), name=map_name),
        about={
            "role": press.role,
            **press.active.sidecar_entries(),
            "force": None if press.force is None else {"force_n": press.force.value_n, "source": press.force.source},
            "flags": [asdict(flag) for flag in flags],
        },
    )
    try:
        target, notes = _target(store, image, press.subject, number)
        stored = store.add_press(
            target,
            image,
            role=press.role,
            taken=when.astimezone(UTC),
            probe=press.active.probe,
            calibration=None if calibration is None else calibration.calibration,
            flags=tuple(flag.name for flag in flags),
        )
    except TsisError as error:
        raise RecordsError(
            f"the files are in {files.raw.parent}, but the press could not be saved in the store: {error} "
            f"(when that is fixed, import it with: tsis records import {files.sidecar})"
        ) from error
    return SavedPress(files=files, target=target, press=stored, flags=flags, notes=notes)


def _target(
    store: Store, image: TactileImage, subject: VirtualSubject | None, number: int
) -> tuple[Target, tuple[str, ...]]:
    """The target of that number, created when absent, and notes about it."""
    name, truth = ("", {}) if subject is None else (subject.name, subject.truth if store.kind == "phantom" else {})
    target = target_by_number(store, number)
    if target is None:
        try:
            return new_target(store, [image], number=number, name=name, truth=truth), ()
        except InputError:
            target = target_by_number(store, number)  # somebody else has entered it this moment
            if target is None:
                raise
    return target, tuple(truth_note(truth, target))


def _require_same_phantom(store: Store, subject: VirtualSubject, number: int) -> None:
    """Refuse, with `ControlError`, what would mix presses of several phantoms, or of a phantom with those of people."""
    if store.kind != "phantom":
        raise ControlError(
            f"the virtual probe presses phantoms, which a store of {store.kind}s does not keep: start the console with "
            "--kind phantom, or choose a camera"
        )
    target = target_by_number(store, number)
    if target is not None and target.truth and dict(target.truth) != dict(subject.truth):
        raise ControlError(
            f"target {number} is of {_phantom_text(target.name, target.truth)}; the virtual probe is on "
            f"{_phantom_text(subject.name, subject.truth)} now: choose another target with + or type its number"
        )


def _phantom_text(name: str, truth: Mapping[str, float]) -> str:
    """A phantom by its name and its inclusion, since two may have the same name."""
    values = ", ".join(f"{name} {value:g}" for name, value in sorted(truth.items()))
    return f"{name or 'another phantom'} ({values or 'no inclusion'})"
