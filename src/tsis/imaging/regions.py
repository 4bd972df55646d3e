"""What an observer measures on a frame: a profile along a line, statistics of a rectangle or an ellipse, a distance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import skimage

from tsis.errors import InputError
from tsis.imaging.corrections import require_image
from tsis.model.require import freeze_arrays, require_integer, require_number, require_one_of, require_pair

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


SHAPES = ("rectangle", "ellipse")
WIDEST_PX = 101  # over which a profile is averaged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineProfile:
    """Grey level along a line.

    Attributes
    ----------
    distance
        From the start of the line, shape (n,), in ``unit``.
    grey
        Grey level there, shape (n,), interpolated between pixels.
    unit
        ``"mm"``, or ``"px"`` where the scale is unknown.
    """

    distance: NDArray[np.float64]
    grey: NDArray[np.float64]
    unit: str

    def __post_init__(self) -> None:
        freeze_arrays(self, "distance", "grey")


@dataclass(frozen=True, slots=True, kw_only=True)
class RegionStatistics:
    """Statistics of the pixels whose centres lie in a region.

    Attributes
    ----------
    count, clipped_count
        Number of pixels, and of those at full scale.
    mean, sd, minimum, median, maximum
        Of their grey levels; ``sd`` is that of the sample, 0 of one pixel.
    area
        Number of pixels times the area of a pixel, in ``unit`` squared.
    unit
        ``"mm"``, or ``"px"`` where the scale is unknown.
    """

    count: int
    clipped_count: int
    mean: float
    sd: float
    minimum: float
    median: float
    maximum: float
    area: float
    unit: str


def line_profile(
    image: TactileImage, start_px: tuple[float, float], end_px: tuple[float, float], *, width_px: int = 1
) -> LineProfile:
    """Grey levels from one point of a frame to another, about one a pixel, each a mean across ``width_px`` pixels.

    Parameters
    ----------
    start_px, end_px
        Points (x, y) in pixels; the centre of the first pixel is (0, 0). Parts outside the frame take its border's.
    width_px
        In [1, 101].

    Raises
    ------
    InputError
        When the points are equal or not finite, or lie farther from the frame than it is large.
    """
    require_image("image", image)
    (x, y), (end_x, end_y) = (_point(image, name, point) for name, point in (("start", start_px), ("end", end_px)))
    if (x, y) == (end_x, end_y):
        raise InputError(f"end_px must differ from start_px; both are {x:g}, {y:g}")
    width = require_integer("width_px", width_px, 1, WIDEST_PX, hint="pixels across the line")
    grey = skimage.measure.profile_line(  # type: ignore[no-untyped-call]
        image.grey, (y, x), (end_y, end_x), linewidth=width, order=1, mode="nearest", reduce_func=np.mean
    )
    length, unit = distance(image, (x, y), (end_x, end_y))
    return LineProfile(distance=np.linspace(0.0, length, grey.size), grey=grey, unit=unit)


def distance(image: TactileImage, start_px: tuple[float, float], end_px: tuple[float, float]) -> tuple[float, str]:
    """Distance of two points (x, y) in pixels, and its unit: ``"mm"``, or ``"px"`` where the scale is unknown."""
    start, end = _point(image, "start", start_px), _point(image, "end", end_px)
    scale, unit = ((1.0, 1.0), "px") if image.mm_per_pixel is None else (image.mm_per_pixel, "mm")
    return math.hypot((end[0] - start[0]) * scale[0], (end[1] - start[1]) * scale[1]), unit


def region_mask(
    shape: tuple[int, int], kind: str, corner_px: tuple[float, float], other_px: tuple[float, float]
) -> NDArray[np.bool_]:
    """Pixels of a frame of ``shape`` (rows, columns) whose centres lie in or on a region.

    Parameters
    ----------
    kind
        ``"rectangle"``, or ``"ellipse"`` for the one that touches the rectangle's sides; else `UnknownNameError`.
    corner_px, other_px
        Opposite corners (x, y) of the rectangle in pixels.
    """
    require_one_of("kind", kind, SHAPES)
    y, x = np.ogrid[: shape[0], : shape[1]]
    (left, right), (top, bottom) = (sorted(pair) for pair in zip(corner_px, other_px, strict=True))
    mask: NDArray[np.bool_] = (x >= left) & (x <= right) & (y >= top) & (y <= bottom)
    if kind == "ellipse":
        # ((x - x0) b)² + ((y - y0) a)² <= (a b)² also holds for a flat one
        a, b = (right - left) / 2, (bottom - top) / 2
        mask &= ((x - (left + right) / 2) * b) ** 2 + ((y - (top + bottom) / 2) * a) ** 2 <= (a * b) ** 2
    return mask


def region_statistics(
    image: TactileImage, kind: str, corner_px: tuple[float, float], other_px: tuple[float, float]
) -> RegionStatistics:
    """Statistics of a region as of `region_mask`; also `InputError` when it has no pixel of the frame."""
    require_image("image", image)
    corner, other = _point(image, "corner", corner_px), _point(image, "other", other_px)
    rows, columns = image.grey.shape
    grey = image.grey[region_mask((rows, columns), kind, corner, other)]
    if not grey.size:
        raise InputError(f"the {kind} must have pixels of the frame; it has none (draw it larger, on the frame)")
    scale, unit = ((1.0, 1.0), "px") if image.mm_per_pixel is None else (image.mm_per_pixel, "mm")
    return RegionStatistics(
        count=grey.size,
        clipped_count=int(np.count_nonzero(grey >= image.full_scale)),
        mean=float(grey.mean()),
        sd=float(grey.std(ddof=1)) if grey.size > 1 else 0.0,
        minimum=float(grey.min()),
        median=float(np.median(grey)),
        maximum=float(grey.max()),
        area=grey.size * scale[0] * scale[1],
        unit=unit,
    )


def _point(image: TactileImage, name: str, point: tuple[float, float]) -> tuple[float, float]:
    """A point not farther from the frame than the frame is large."""
    rows, columns = image.grey.shape
    x, y = require_pair(f"{name}_px", point)
    return (
        require_number(f"{name}_px", x, -columns, 2.0 * columns, hint="pixels, across"),
        require_number(f"{name}_px", y, -rows, 2.0 * rows, hint="pixels, down"),
    )
