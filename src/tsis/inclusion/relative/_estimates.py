"""Relative size (6.2), relative depth (6.9) and relative hardness (6.10).

Depth is read at the centroid of the light, (6.7) and (6.8).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError, NotCalibratedError
from tsis.imaging import require_same_frame
from tsis.inclusion.relative._light import brightest, change_of_light, lit_part
from tsis.inclusion.relative._reading import RelativeReading, comparison_assumptions
from tsis.model.calibration import Calibration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model.image import TactileImage


def relative_depth(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Grey level at the centroid of the light, ``I(Xc, Yc)`` (6.9): it FALLS with depth and is not a length.

    The source multiplies it by the size of a pixel and calls the product millimetres; its "0.59 mm" is 87 grey levels.

    Parameters
    ----------
    image, reference, against, calibration, threshold_grey
        As for `relative_size`; the threshold bounds the part of the centroid.

    Returns
    -------
    RelativeReading
        In grey levels; None with the flag ``no_contact`` when nothing is lit, or with ``saturated`` when the camera
        clipped at the centroid.

    Raises
    ------
    InputError, ImageMismatchError
        As `relative_size`.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> hill = 60.0 * np.exp(-((x - 80) ** 2 + (y - 60) ** 2) / 800.0)
    >>> dark = TactileImage(grey=np.zeros((120, 160)), mm_per_pixel=(0.1, 0.1))
    >>> reading = relative_depth(TactileImage(grey=hill, mm_per_pixel=(0.1, 0.1)), dark, against="untouched probe")
    >>> round(reading.value), reading.unit
    (60, 'grey levels')
    """
    change = change_of_light(image, reference, against=against, calibration=calibration)
    lit = lit_part(change, threshold_grey)
    level, parts = None, {}
    if lit.centroid_px is not None:
        x, y = lit.centroid_px
        if not change.clipped[round(y), round(x)]:
            level = float(scipy.ndimage.map_coordinates(change.image.grey, np.array([[y], [x]]), order=1)[0])
        parts = {"centroid_x_px": x, "centroid_y_px": y}
    return RelativeReading(
        quantity="relative depth",
        value=level,
        unit="grey levels",
        against=against,
        assumptions=comparison_assumptions(
            against,
            calibration,
            "The compared inclusions are equally large and equally stiff: a grey level that falls with depth is no "
            "depth.",
        ),
        parts=parts,
        flags=lit.flags,
    )


def relative_size(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Diameter in mm of the disc with the area of the lit part, ``2 sqrt(A / pi)`` (6.2).

    It is the width of the light above the threshold, not of the inclusion: it grows with the force and falls with the
    depth. Pixels are counted after a blur of one pixel, in the largest connected part.

    Parameters
    ----------
    image
        Raw frame of the pressed probe, with ``mm_per_pixel``.
    reference
        One or more frames, whose mean is subtracted.
    against
        Content of the reference: ``"untouched probe"`` as in the source, where all light of the press counts, or
        ``"plain tissue"``, a reference press of equal force, where only the inclusion's light counts.
    calibration
        Its light map corrects non-uniform light; grey levels are then those of the brightest light.
    threshold_grey
        Level k above which a pixel counts as lit, above 0; the source's 5 of 255 levels when None.

    Returns
    -------
    RelativeReading
        In mm; 0 with the flag ``no_contact`` when nothing is lit.

    Raises
    ------
    InputError
        When a scale is unknown, the frame is mostly clipped or has no unlit pixel, or a reference's force contradicts
        ``against``.
    ImageMismatchError
        When the reference's size, scale, full scale or axis differ from the image's.

    Examples
    --------
    >>> import numpy as np
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> disc = np.where((x - 80) ** 2 + (y - 60) ** 2 < 900, 60.0, 10.0)
    >>> dark = TactileImage(grey=np.full((120, 160), 10.0), mm_per_pixel=(0.1, 0.1))
    >>> pressed = TactileImage(grey=disc, mm_per_pixel=(0.1, 0.1))
    >>> reading = relative_size(pressed, dark, against="untouched probe", threshold_grey=25.0)
    >>> round(reading.value, 1), reading.unit
    (6.0, 'mm')
    """
    lit = lit_part(change_of_light(image, reference, against=against, calibration=calibration), threshold_grey)
    return RelativeReading(
        quantity="relative size",
        value=lit.diameter_mm,
        unit="mm",
        against=against,
        assumptions=comparison_assumptions(
            against,
            calibration,
            "The compared inclusions are equally deep and equally stiff: the lit part is no outline of the inclusion.",
        ),
        parts={"area_mm2": lit.area_mm2},
        flags=lit.flags,
    )


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

    d1 and d2 are the `relative_size` of each press. Force, the sum of grey levels over the calibration's gain as in the
    source, and area are those of the second press. T is not a strain: the lit part widens because more of the same bump
    exceeds the threshold, for any stiffness.

    Parameters
    ----------
    first, second
        Raw presses of one target, the second harder.
    reference
        Reference of both; see `relative_size`.
    second_reference
        Reference of the second; ``reference`` when None. Reference presses must have the force of their press.
    against
        Content of the references: ``"untouched probe"`` or ``"plain tissue"``.
    calibration
        Its gain converts grey levels to pressure; its light map, if any, corrects the light.
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
        When the calibration is missing.
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
            f"calibration must be a Calibration, whose gain converts grey levels to pressure; got {calibration!r:.80}"
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
        assumptions=comparison_assumptions(
            against,
            calibration,
            "The compared inclusions are equally large and equally deep, and were pressed with the same two forces.",
            "Grey level is in proportion to pressure.",
            "The growth of the lit part replaces a strain, which it is not.",
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
