"""Relative size: the diameter of the lit part, (6.1) and (6.2)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.inclusion.relative_frames import change_of_light
from tsis.inclusion.relative_light import lit_part
from tsis.inclusion.relative_reading import COMPARED_WITH, ONE_SPHERE, RelativeReading, lit_alike

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model import Calibration, TactileImage


def relative_size(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Diameter in mm of the disc with the area of the lit part, ``2 sqrt(A / pi)`` (6.2).

    It is as wide as the light above the threshold and not as the inclusion: it grows with the force and falls with the
    depth. Pixels are counted behind a blur of one pixel, in the largest connected part.

    Parameters
    ----------
    image
        The pressed probe as the camera delivered it, with ``mm_per_pixel``.
    reference
        One or more frames (their mean is taken) to compare with.
    against
        What the reference shows: ``"untouched probe"``, the source's way, where all light of the press counts, or
        ``"plain tissue"`` pressed as hard, where only the inclusion's share of it counts.
    calibration
        Where it knows how unevenly the face is lit, that is divided out, and grey levels are those of the best lit
        place.
    threshold_grey
        Level k above which a pixel counts as lit, above 0; the source's 5 of 255 levels when None.

    Returns
    -------
    RelativeReading
        In mm; 0 with the flag ``no_contact`` when nothing is lit.

    Raises
    ------
    InputError
        When a scale is unknown, the frame is mostly clipped or lit to its last pixel, or a reference's force
        contradicts ``against``.
    ImageMismatchError
        When the reference's size, scale, full scale or axis differ from the image's.

    Examples
    --------
    >>> import numpy as np
    >>> from tsis.model import TactileImage
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
        assumptions=(
            ONE_SPHERE,
            COMPARED_WITH[against],
            lit_alike(calibration),
            "What is compared lies equally deep and is equally stiff: the lit part is no outline of the inclusion.",
        ),
        parts={"area_mm2": lit.area_mm2},
        flags=lit.flags,
    )
