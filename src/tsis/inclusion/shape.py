"""Shape of the lit part of a press: two-means threshold (6.12), (6.13), binary image (6.11), ellipse and outline."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.imaging.patch import NOISE_FACTOR
from tsis.inclusion.frames import binary_features
from tsis.inclusion.relative import COMPARED_WITH, change_of_light, equal_light_assumption, notes_of
from tsis.model.require import freeze_arrays, require_array, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

    from tsis.inclusion.prior import Floats
    from tsis.model.calibration import Calibration
    from tsis.model.image import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoMeans:
    """Two classes of grey levels.

    Attributes
    ----------
    background_grey, object_grey
        Mean of the levels below the threshold, and of the others.
    threshold_grey
        Midpoint of both means.
    corners_grey
        Mean of the four corner pixels, the initial background.
    """

    background_grey: float
    object_grey: float
    threshold_grey: float
    corners_grey: float


def two_means(grey: ArrayLike) -> TwoMeans:
    """Divide grey levels into background and object.

    Initially the corners are background and the rest object; the threshold is the midpoint of both means, iterated
    until no pixel changes class. The source also demands "reducing the threshold" in each round, which contradicts its
    conditions (6.12) and (6.13) and is omitted.

    Parameters
    ----------
    grey
        Grey levels, shape (rows, columns), with at least two rows and columns.

    Returns
    -------
    TwoMeans
        Both means equal the level when all pixels are equal.

    Raises
    ------
    InputError
        When the levels are not a finite array of two axes.

    Examples
    --------
    >>> grey = np.full((8, 8), 10.0)
    >>> grey[3:5, 3:5] = 90.0
    >>> two_means(grey).threshold_grey
    50.0
    """
    levels = require_array("grey", grey, ndim=2)
    for axis, name in enumerate(("rows", "columns")):
        require_number(f"number of {name} of grey", levels.shape[axis], 2, np.inf)
    corners = float(levels[[0, 0, -1, -1], [0, -1, 0, -1]].mean())
    ascending = np.sort(levels, axis=None)
    sums = np.concatenate([[0.0], np.cumsum(ascending)])
    count = ascending.size
    others = (sums[-1] - 4.0 * corners) / (count - 4) if count > 4 else corners
    low, high, below = corners, float(others), -1
    while True:
        cut = (low + high) / 2.0
        darker = int(np.searchsorted(ascending, cut))
        if darker in (0, count, below):  # one class only, or no pixel changed sides
            return TwoMeans(background_grey=low, object_grey=high, threshold_grey=cut, corners_grey=corners)
        below = darker
        low, high = float(sums[below] / below), float((sums[-1] - sums[below]) / (count - below))


ASSUMPTIONS = (
    "There is one object, brighter than its surroundings, and the picture's corners are background.",
    "The outline is that of the light, near half the height of a rounded bump; for a deep object it is wider and "
    "rounder than the object.",
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObjectShape:
    """Shape of the lit part; all fields are None when no part exceeds the noise.

    Attributes
    ----------
    levels
        The two classes of grey levels and the threshold between them.
    area_mm2
        Area of the part.
    centre_mm
        Its centroid (x, y) from the probe's axis, with equal weight of the pixels.
    semi_axes_mm, angle_deg
        Semi-axes (long, short) of the ellipse with its second moments, and the direction of the long one in [0, 180),
        from x towards y: clockwise in the picture.
    eccentricity
        ``sqrt(1 - (short / long)²)``: 0 for a circle.
    circularity
        ``4 pi area / perimeter²``: 1 for a circle.
    contour_mm
        Closed outline, (n, 2) points (x, y) from the probe's axis; shape (0, 2) when there is none.
    against
        Content of the reference.
    assumptions
        Assumptions of the shape, a message each.
    flags
        Short names of the defects.
    """

    levels: TwoMeans
    area_mm2: float | None = None
    centre_mm: tuple[float, float] | None = None
    semi_axes_mm: tuple[float, float] | None = None
    angle_deg: float | None = None
    eccentricity: float | None = None
    circularity: float | None = None
    contour_mm: Floats
    against: str
    assumptions: tuple[str, ...]
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze_arrays(self, "contour_mm")

    @property
    def notes(self) -> tuple[str, ...]:
        """The message of each flag."""
        return notes_of(self.flags)


def object_shape(
    image: TactileImage,
    reference: TactileImage | Sequence[TactileImage],
    *,
    against: str,
    calibration: Calibration | None = None,
) -> ObjectShape:
    """Area, ellipse, circularity and outline of the lit part of a press.

    `two_means` divides the change of light into a binary image (6.11), whose largest part is measured.

    Parameters
    ----------
    image, reference, against, calibration
        As for `relative_size`.

    Returns
    -------
    ObjectShape
        With the flag ``no_contact`` when the two classes differ by no more than noise.

    Raises
    ------
    InputError, ImageMismatchError
        As `relative_size`.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> y, x = np.mgrid[:120, :160]
    >>> ellipse = np.where(((x - 80) / 40) ** 2 + ((y - 60) / 20) ** 2 < 1, 60.0, 0.0)
    >>> dark, pressed = (TactileImage(grey=grey, mm_per_pixel=(0.1, 0.1)) for grey in (0 * ellipse, ellipse))
    >>> shape = object_shape(pressed, dark, against="untouched probe")
    >>> [round(axis, 1) for axis in shape.semi_axes_mm], round(shape.eccentricity, 2)
    ([4.0, 2.0], 0.87)
    """
    change = change_of_light(image, reference, against=against, calibration=calibration)
    levels = two_means(change.image.grey)
    assumptions = (*ASSUMPTIONS, COMPARED_WITH[against], equal_light_assumption(calibration))
    nothing = ObjectShape(
        levels=levels, contour_mm=np.empty((0, 2)), against=against, assumptions=assumptions, flags=("no_contact",)
    )
    if levels.object_grey - levels.background_grey <= NOISE_FACTOR * change.noise_grey:
        return nothing
    lit = binary_features(change.image, levels.threshold_grey)
    if not lit.contact:
        return nothing
    scale, axis = image.scale(), image.axis()
    defects = {
        "cropped": lit.cropped,
        "saturated": bool(change.clipped[lit.patch.mask].any()),
        "corners_lit": levels.corners_grey >= levels.threshold_grey,
    }
    return ObjectShape(
        levels=levels,
        area_mm2=lit.area_mm2,
        centre_mm=lit.centroid_mm,
        semi_axes_mm=lit.semi_axes_mm,
        angle_deg=lit.angle_deg,
        eccentricity=lit.eccentricity,
        circularity=lit.circularity,
        contour_mm=(lit.patch.contour_px - axis) * scale,
        against=against,
        assumptions=assumptions,
        flags=tuple(flag for flag, is_so in defects.items() if is_so),
    )
