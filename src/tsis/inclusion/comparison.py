"""Comparison of presses with each other: relative size, depth and hardness, and the shape of the lit area."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from tsis.inclusion.relative import (
    RelativeReading,
    change_of_light,
    matching_references,
    relative_depth,
    relative_hardness,
    relative_size,
)
from tsis.inclusion.shape import ObjectShape, object_shape

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressComparison:
    """Relative readings of presses, for comparisons with each other only.

    Attributes
    ----------
    against
        Kind of the references: ``"untouched probe"`` or ``"plain tissue"``.
    relative
        Relative readings by name: of a press, or of two presses of different force.
    shapes
        Shape of the lit area of each press, by the name of the frame.
    changes
        Change of light of each press, by the name of the frame.
    missing
        A message for each reading that the frames do not allow.
    """

    against: str
    relative: tuple[tuple[str, RelativeReading], ...]
    shapes: tuple[tuple[str, ObjectShape], ...]
    changes: tuple[tuple[str, TactileImage], ...]
    missing: tuple[str, ...] = ()


def compare_presses(
    images: Sequence[TactileImage],
    references: Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    relative: bool = True,
    shape: bool = True,
) -> PressComparison:
    """Relative readings and shapes of presses, each against references of the same force.

    The frames have a scale. ``against`` is the kind of the references: ``"untouched probe"`` or ``"plain tissue"``.
    Relative hardness requires a calibration, whose gain converts grey levels to pressure. ``relative`` and ``shape``
    select what is read.

    Raises
    ------
    InputError, ImageMismatchError
        As `tsis.inclusion.relative.relative_size`; when an image has no reference of the same force.
    """
    fitting = [matching_references(image, references, against=against) for image in images]
    common: dict[str, Any] = {"against": against, "calibration": calibration}
    readings, shapes, changes = [], [], []
    for image, own in zip(images, fitting, strict=True):
        if relative:
            readings += [(image.name, read(image, own, **common)) for read in (relative_size, relative_depth)]
        if shape:
            shapes.append((image.name, object_shape(image, own, **common)))
        changes.append((image.name, change_of_light(image, own, **common).image))
    rising = sorted(zip(images, fitting, strict=True), key=lambda pair: pair[0].force_n or 0.0)
    pairs = [(one, other) for one, other in pairwise(rising) if (one[0].force_n or 0.0) < (other[0].force_n or 0.0)]
    missing = _missing(pairs, calibration) if relative else ()
    if relative and not missing and calibration is not None:
        for (first, plain), (second, second_plain) in pairs:
            reading = relative_hardness(first, second, reference=plain, second_reference=second_plain, **common)
            readings.append((f"{first.name}, {second.name}", reading))
    return PressComparison(
        against=against, relative=tuple(readings), shapes=tuple(shapes), changes=tuple(changes), missing=missing
    )


def _missing(pairs: Sequence[Any], calibration: Calibration | None) -> tuple[str, ...]:
    if calibration is None:
        return ("Relative hardness is not read: it needs a calibration, whose gain turns grey levels into pressure.",)
    if not pairs:
        return ("Relative hardness is not read: it needs two presses on one target with different known forces.",)
    return ()
