"""What was taken and estimated here and now gets into a store at once: presses, calibration, estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError, RecordsError, TsisError
from tsis.instrument import whole_levels
from tsis.records._values import LONGEST_NAME
from tsis.records.importing import enter_estimate, new_target, numbered, truth_note

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.calibration.file import ProbeCalibration
    from tsis.model import Estimate, TactileImage
    from tsis.records._values import StoredPress, Target
    from tsis.records.store import Store


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavableResult:
    """An estimate with all that it rests on, ready to be kept.

    Attributes
    ----------
    kind, estimate, probe, options
        As of `StoredEstimate`.
    frames
        As the camera gave them, by the role of their presses: those of the target first.
    calibration
        The calibration.
    name, truth
        Of a new target.
    """

    kind: str
    estimate: Estimate
    probe: str
    calibration: ProbeCalibration
    frames: Mapping[str, Sequence[TactileImage]]
    options: Mapping[str, Any] = field(default_factory=dict)
    name: str = ""
    truth: Mapping[str, float] = field(default_factory=dict)


def require_savable(frames: Sequence[TactileImage]) -> None:
    """Refuse frames of which a store could not keep name and every level, before anything is computed."""
    for frame in frames:
        if len(frame.name) > LONGEST_NAME:
            raise InputError(
                f"the name of a file must have at most {LONGEST_NAME} characters, to be kept; {frame.name[:40]!r}... "
                f"has {len(frame.name)} (give it a shorter one, or leave out --save)"
            )
        try:
            whole_levels(frame.grey, frame.full_scale)
        except InputError as error:
            raise InputError(
                f"{frame.name!r} must hold the grey levels that the camera gave, to be kept; got levels between them, "
                "as of a colour picture (save it as a grey PNG file and use that everywhere, or leave out --save)"
            ) from error


def save_results(store: Store, keepable: SavableResult, *, number: int | None = None) -> dict[str, Any]:
    """Store presses, calibration and estimate; what a result says of it.

    Parameters
    ----------
    store
        Open for writing.
    keepable
        What goes into it; a truth only where the store is of phantoms.
    number
        Of the target, which is entered when there is none; a new one when it is not given.

    Raises
    ------
    RecordsError
        When it could not be stored as a whole; it says how much was.
    """
    frames = [(role, frame) for role, item in keepable.frames.items() for frame in item]
    truth = keepable.truth if store.kind == "phantom" else {}
    presses: list[StoredPress] = []
    target: Target | None = None
    try:
        target = None if number is None else numbered(store, number)
        if target is None:
            images = [frame for _, frame in frames]
            target = new_target(store, images, number=number, name=keepable.name, truth=truth)
        moment = datetime.now(UTC)
        for at, (role, frame) in enumerate(frames):
            taken = moment + timedelta(microseconds=at)  # so that their order is kept
            presses.append(
                store.add_press(
                    target, frame, role=role, taken=taken, probe=keepable.probe, calibration=keepable.calibration
                )
            )
        stored = enter_estimate(
            store,
            target,
            keepable.estimate,
            kind=keepable.kind,
            presses=presses,
            probe=keepable.probe,
            calibration=keepable.calibration,
            options=keepable.options,
        )
    except TsisError as error:
        where = "" if target is None else f" in target {target.number}"
        raise RecordsError(f"{error}; {len(presses)} of {len(frames)} presses are stored{where}") from error
    return {
        "store": str(store.folder.resolve()),
        "target": target.number,
        "estimate": stored.id,
        "notes": list(truth_note(truth, target)),
    }


def saved_notes(saved: Mapping[str, Any]) -> tuple[str, ...]:
    """What to tell people."""
    return (f"Kept as target {saved['target']} in {saved['store']}.", *saved["notes"])
