"""Mean grey level in rings around a point of the face."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging.corrections import require_image, require_same_frame
from tsis.imaging.pixels import ring_sums
from tsis.model.require import freeze_arrays, require_array, require_pair

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.model.image import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RadialProfile:
    """Grey level against distance from a point, ring by ring.

    Attributes
    ----------
    edges_mm
        Ring boundaries, shape (n + 1,); a pixel belongs to the ring ``[low, high)`` of its centre.
    mean_grey
        Mean grey level of the unclipped pixels, shape (n,); NaN in a ring without them.
    standard_error_grey
        Standard deviation of the ring's pixels over the square root of their number, shape (n,); NaN below two pixels.
        It includes the slope inside the ring and the noise.
    count
        Number of unclipped pixels, shape (n,).
    clipped_count
        Number of clipped pixels, which are left out, shape (n,).
    """

    edges_mm: NDArray[np.float64]
    mean_grey: NDArray[np.float64]
    standard_error_grey: NDArray[np.float64]
    count: NDArray[np.int64]
    clipped_count: NDArray[np.int64]

    def __post_init__(self) -> None:
        freeze_arrays(self, "edges_mm", "mean_grey", "standard_error_grey", "count", "clipped_count")

    @property
    def radius_mm(self) -> NDArray[np.float64]:
        """Mean radius over each ring's area, mm: 2/3 (r2³ - r1³)/(r2² - r1²)."""
        inner, outer = self.edges_mm[:-1], self.edges_mm[1:]
        radius: NDArray[np.float64] = (inner**2 + inner * outer + outer**2) / (inner + outer) * (2.0 / 3.0)
        return radius


def radial_profile(
    image: TactileImage,
    *,
    edges_mm: ArrayLike,
    centre_px: tuple[float, float] | None = None,
    reference: TactileImage | None = None,
) -> RadialProfile:
    """Mean grey level in rings, with pixels of unequal width and height measured in mm.

    Pass the frame and the reference as the camera delivered them: a corrected frame does not show clipped pixels, which
    are left out and counted.

    Raises `InputError` when the scale is unknown or the edges do not ascend; `ImageMismatchError` when the reference's
    size, scale or full scale differ from the image's.

    Parameters
    ----------
    image
        A frame with ``mm_per_pixel``.
    edges_mm
        Ring boundaries in mm, ascending, the first >= 0, at least two.
    centre_px
        Centre (x, y) of the rings in pixels; the image's ``axis_px`` when None.
    reference
        The untouched probe, subtracted pixel by pixel.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> frame = TactileImage(grey=np.full((64, 64), 20.0), mm_per_pixel=(0.1, 0.1))
    >>> radial_profile(frame, edges_mm=[0.0, 1.0, 2.0]).mean_grey.tolist()
    [20.0, 20.0]
    """
    require_image("image", image)
    edges: NDArray[np.float64] = require_array("edges_mm", edges_mm, ndim=1)
    if edges.size < 2 or edges[0] < 0 or np.any(np.diff(edges) <= 0):
        raise InputError(f"edges_mm must be at least two ascending radii, the first >= 0; got {edges.tolist()}")
    centre = image.axis() if centre_px is None else require_pair("centre_px", centre_px)
    rings = _ring_of_pixel(image.grey.shape, image.scale(), centre, edges.tobytes())
    grey, clipped = image.grey, image.grey >= image.full_scale
    if reference is not None:
        require_same_frame(image, reference, "reference")
        grey, clipped = grey - reference.grey, clipped | (reference.grey >= reference.full_scale)
    n = edges.size - 1
    # Deviations from a level near the data avoid cancellation in the squares.
    level = float(grey.mean())
    count, clipped_count, total, square = ring_sums(grey.ravel(), clipped.ravel(), rings, n, level)
    mean = np.divide(total, count, out=np.full(n, np.nan), where=count > 0)
    spread = np.maximum(square - total * np.nan_to_num(mean), 0.0)
    variance = np.divide(spread, count - 1.0, out=np.full(n, np.nan), where=count > 1)
    return RadialProfile(
        edges_mm=edges,
        mean_grey=mean + level,
        standard_error_grey=np.sqrt(variance / np.maximum(count, 1)),
        count=count,
        clipped_count=clipped_count,
    )


@lru_cache(maxsize=8)
def _ring_of_pixel(
    shape: tuple[int, int], scale: tuple[float, float], centre: tuple[float, float], edges: bytes
) -> NDArray[np.intp]:
    """Ring index of each pixel, flat; cached for the frames of one camera."""
    limits = np.frombuffer(edges)
    x_mm = (np.arange(shape[1]) - centre[0]) * scale[0]
    y_mm = (np.arange(shape[0]) - centre[1]) * scale[1]
    squared = y_mm[:, None] ** 2 + x_mm[None, :] ** 2
    rings = np.searchsorted(limits**2, squared.ravel(), side="right") - 1
    rings[rings < 0] = limits.size - 1
    rings.flags.writeable = False
    return rings
