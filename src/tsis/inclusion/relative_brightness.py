"""Relative depth: the grey level at the centroid of the light, (6.7) to (6.9)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from tsis.inclusion.relative_frames import change_of_light
from tsis.inclusion.relative_light import lit_part
from tsis.inclusion.relative_reading import COMPARED_WITH, ONE_SPHERE, RelativeReading, lit_alike

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.model import Calibration, TactileImage


def relative_depth(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
    threshold_grey: float | None = None,
) -> RelativeReading:
    """Grey level at the centroid of the light, ``I(Xc, Yc)`` (6.9): it FALLS with depth and is no length.

    The source multiplies it by the size of a pixel and calls the product millimetres. It is left as what it is; a
    printed "0.59 mm" is 87 grey levels.

    Parameters
    ----------
    image, reference, against, calibration, threshold_grey
        As for `relative_size`; the threshold bounds the part whose centroid is taken.

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
    >>> from tsis.model import TactileImage
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
            level = float(ndimage.map_coordinates(change.image.grey, np.array([[y], [x]]), order=1)[0])
        parts = {"centroid_x_px": x, "centroid_y_px": y}
    return RelativeReading(
        quantity="relative depth",
        value=level,
        unit="grey levels",
        against=against,
        assumptions=(
            ONE_SPHERE,
            COMPARED_WITH[against],
            lit_alike(calibration),
            "What is compared is equally large and equally stiff: a grey level that falls with depth is no depth.",
        ),
        parts=parts,
        flags=lit.flags,
    )
