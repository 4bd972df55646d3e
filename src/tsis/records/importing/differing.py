"""What a frame that is there already is said to be now, and is not in the store."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from tsis.calibration.file import calibration_sha256

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from tsis.records.importing.found import IncomingPress
    from tsis.records.values import StoredPress, Target

EDITABLE = ("role", "force_n")  # of these; the others are as they came


def differing_notes(
    frames: Sequence[IncomingPress], held: Sequence[StoredPress | None], number: int
) -> tuple[str, ...]:
    """One sentence for each thing that is said of frames otherwise than it is stored, with what to do about it.

    Parameters
    ----------
    frames
        What was to be entered.
    held
        The press of each that was there already; None for others.
    number
        Of the target.
    """
    pairs = ((each, press) for each, press in zip(frames, held, strict=True) if press is not None)
    counts = Counter(name for each, press in pairs for name in _differences(each, press))
    edit, anew = f"tsis records edit {number} --press", "tsis records import --target new"
    return tuple(
        f"{name} of {count} that {'was' if count == 1 else 'were'} there already is stored otherwise and stays so "
        f"(to have it as it is here: {edit if name in EDITABLE else anew})"
        for name, count in counts.items()
    )


def truth_note(truth: Mapping[str, float], target: Target) -> tuple[str, ...]:
    """One sentence where frames come with another truth than their target has."""
    if not truth or dict(truth) == dict(target.truth):
        return ()
    return (
        f"target {target.number} has another truth than these frames came with (tsis records edit {target.number} "
        "--truth, or import them with --target new)",
    )


def _differences(each: IncomingPress, press: StoredPress) -> Iterator[str]:
    """Names of what was said and is not so; what nobody said is no difference."""
    known = None if each.calibration is None else calibration_sha256(each.calibration)
    said: Iterable[tuple[str, object, object]] = (
        ("role", each.role, press.role),
        ("force_n", each.force_n, press.force_n),
        ("mm_per_pixel", each.mm_per_pixel, press.mm_per_pixel),
        ("calibration", known, press.calibration),
    )
    for name, now, stored in said:
        if now is not None and now != stored:
            yield name
