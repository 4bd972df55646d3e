"""Saving a result of this session in a store: presses, calibration, estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError, RecordsError, TsisError
from tsis.instrument import whole_levels
from tsis.records._values import LONGEST_NAME
from tsis.records.importing import enter_estimate, new_target, target_by_number, truth_note

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.calibration.file import ProbeCalibration
    from tsis.model import Estimate, TactileImage
    from tsis.records._values import StoredPress, Target
    from tsis.records.store import Store


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SavableResult:
    """An estimate with its frames and calibration, ready to be saved.

    ``kind``, ``probe`` and ``options`` are as in `StoredEstimate`, ``name`` and ``truth`` those of a new target.
    ``frames`` has the camera frames by the role of their presses, those of the target first.
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
    """Refuse, before any computation, frames that a store cannot save exactly."""
    for frame in frames:
        if len(frame.name) > LONGEST_NAME:
            raise InputError(
                f"the name of a file must have at most {LONGEST_NAME} characters, to be saved; {frame.name[:40]!r}... "
                f"has {len(frame.name)} (give it a shorter one, or leave out --keep)"
            )
        try:
            whole_levels(frame.grey, frame.full_scale)
        except InputError as error:
            raise InputError(
                f"{frame.name!r} must hold the grey levels that the camera gave, to be saved; got levels between them, "
                "as of a colour picture (save it as a grey PNG file and use that everywhere, or leave out --keep)"
            ) from error


def save_results(store: Store, result: SavableResult, *, number: int | None = None) -> dict[str, Any]:
    """Save presses, calibration and estimate; return store, target, estimate and notes for the result document.

    A store of subjects ignores the truth. ``number`` is that of the target, which is entered where it is missing; by
    default a new one.

    Raises
    ------
    RecordsError
        When not everything could be saved; the message tells how many presses were.
    """
    frames = [(role, frame) for role, item in result.frames.items() for frame in item]
    truth = result.truth if store.kind == "phantom" else {}
    presses: list[StoredPress] = []
    target: Target | None = None
    try:
        target = None if number is None else target_by_number(store, number)
        if target is None:
            images = [frame for _, frame in frames]
            target = new_target(store, images, number=number, name=result.name, truth=truth)
        moment = datetime.now(UTC)
        for at, (role, frame) in enumerate(frames):
            taken = moment + timedelta(microseconds=at)  # preserves their order
            presses.append(
                store.add_press(
                    target, frame, role=role, taken=taken, probe=result.probe, calibration=result.calibration
                )
            )
        stored = enter_estimate(
            store,
            target,
            result.estimate,
            kind=result.kind,
            presses=presses,
            probe=result.probe,
            calibration=result.calibration,
            options=result.options,
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
    """Messages for the user."""
    return (f"Saved as target {saved['target']} in {saved['store']}.", *saved["notes"])
