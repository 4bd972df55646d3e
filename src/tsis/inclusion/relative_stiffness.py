"""Relative hardness: force per lit area over the growth of the lit part between two presses, (6.10)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging.correct import require_same_frame
from tsis.inclusion.relative_frames import brightest, change_of_light
from tsis.inclusion.relative_light import lit_part
from tsis.inclusion.relative_reading import COMPARED_WITH, ONE_SPHERE, RelativeReading, lit_alike
from tsis.model import Calibration, TactileImage
from tsis.model.errors import InputError, NotCalibratedError

if TYPE_CHECKING:
    from collections.abc import Sequence

    Frames = TactileImage | Sequence[TactileImage]


def relative_hardness(
    first: TactileImage,
    second: TactileImage,
    *,
    reference: Frames,
    second_reference: Frames | None = None,
    against: str,
    calibration: Calibration,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Force per lit area over ``T = |d1 - d2| / d1`` (6.10), from two presses of one target, the second one harder.

    d1 and d2 are the `relative_size` of each press. The force is the sum of grey levels over the calibration's gain, as
    the source takes it, and force and area are those of the second press. T is not a strain: where light follows
    pressure, the lit part widens because more of the same bump exceeds the threshold, stiff or not.

    Parameters
    ----------
    first, second
        Presses of one target, the second harder, as the camera delivered them.
    reference
        What both are compared with; see `relative_size`.
    second_reference
        What the second is compared with; ``reference`` when None. Against plain tissue each force needs its own.
    against
        What the references show: ``"untouched probe"`` or ``"plain tissue"``.
    calibration
        Its gain turns grey levels into pressure; its light, where it is known, is divided out.
    threshold_grey
        As for `relative_size`.

    Returns
    -------
    RelativeReading
        In kPa; None when nothing is lit or the lit part does not grow.

    Raises
    ------
    InputError
        As `relative_size`, and when both presses are the same frame or their known forces do not rise.
    NotCalibratedError
        When there is no calibration.
    ImageMismatchError
        As `relative_size`, and when the presses differ in size, scale or full scale.

    Examples
    --------
    >>> y, x = np.mgrid[:120, :160]
    >>> hill = np.exp(-((x - 80) ** 2 + (y - 60) ** 2) / 800.0)
    >>> dark, weak, strong = (TactileImage(grey=level * hill, mm_per_pixel=(0.1, 0.1)) for level in (0, 40, 80))
    >>> gain = Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
    >>> found = relative_hardness(weak, strong, reference=dark, against="untouched probe", calibration=gain)
    >>> round(found.value, 1), round(found.parts["growth"], 3)
    (2.9, 0.155)
    """
    if not isinstance(calibration, Calibration):
        raise NotCalibratedError(
            f"calibration must be a Calibration, whose gain turns grey levels into pressure; got {calibration!r:.80}"
        )
    _check_rising(first, second)
    second_reference = reference if second_reference is None else second_reference
    weak = lit_part(change_of_light(first, reference, against=against, calibration=calibration), threshold_grey)
    harder = change_of_light(second, second_reference, against=against, calibration=calibration)
    strong = lit_part(harder, threshold_grey)
    flags = tuple(dict.fromkeys(weak.flags + strong.flags))
    value, parts = None, {"first_size_mm": weak.diameter_mm, "second_size_mm": strong.diameter_mm}
    if "no_contact" not in flags:
        growth = (strong.diameter_mm - weak.diameter_mm) / weak.diameter_mm
        pixel_mm2 = float(np.prod(second.scale()))
        gain = calibration.gain_grey_per_kpa * brightest(calibration)
        stress = strong.total_grey * pixel_mm2 / gain / strong.area_mm2
        parts |= {"growth": growth, "stress_kpa": stress}
        value = stress / growth if growth > 0 else None
        flags += () if growth > 0 else ("no_growth",)
    return RelativeReading(
        quantity="relative hardness",
        value=value,
        unit="kPa",
        against=against,
        assumptions=(
            ONE_SPHERE,
            COMPARED_WITH[against],
            lit_alike(calibration),
            "What is compared is equally large and lies equally deep, and was pressed with the same two forces.",
            "Grey level is in proportion to pressure.",
            "The growth of the lit part stands for a strain, which it is not.",
        ),
        parts=parts,
        flags=flags,
    )


def _check_rising(first: TactileImage, second: TactileImage) -> None:
    """Refuse presses that are the same frame, of different cameras, or in the wrong order."""
    require_same_frame(first, second, "second")
    if np.array_equal(first.grey, second.grey):
        raise InputError("first and second must be two presses; got the same frame twice")
    if first.force_n is not None and second.force_n is not None and second.force_n <= first.force_n:
        raise InputError(
            f"second must be pressed harder than first, {first.force_n:g} N; got {second.force_n:g} N (swap them)"
        )
