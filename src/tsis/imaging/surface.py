"""A signal as a surface in space, or a surface from its slopes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.imaging.corrections import require_image
from tsis.imaging.pixels import block_means
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeightSurface:
    """Heights over a grid of the face.

    Attributes
    ----------
    x_mm, y_mm
        Positions of columns and rows relative to the image's ``axis_px``, mm; y runs down the image.
    height
        Heights, shape (len(y_mm), len(x_mm)), in grey levels times ``height_per_grey``.
    """

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    height: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name, ndim in (("x_mm", 1), ("y_mm", 1), ("height", 2)):
            object.__setattr__(self, name, require_array(name, getattr(self, name), ndim=ndim))


def height_surface(image: TactileImage, *, max_points: int = 128, height_per_grey: float = 1.0) -> HeightSurface:
    """Convert a signal to a surface of at most ``max_points`` along either side.

    Raises `InputError` when the image has no scale or ``max_points`` lies outside its range.

    Parameters
    ----------
    max_points
        Greatest number of rows and of columns, in [2, 4096].
    height_per_grey
        Height of one grey level, in the unit of the calibration.

    Returns
    -------
    HeightSurface
        Each height is the mean over a block of pixels.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> flat = height_surface(TactileImage(grey=np.full((100, 200), 7.0), mm_per_pixel=(0.1, 0.1)), max_points=50)
    >>> flat.height.shape, round(float(flat.x_mm[-1] - flat.x_mm[0]), 6)
    ((25, 50), 19.6)
    """
    require_image("image", image)
    limit = int(require_number("max_points", max_points, 2, 4096))
    require_number("height_per_grey", height_per_grey, -1e9, 1e9)
    scale, axis = image.scale(), image.axis()
    rows, columns = image.grey.shape
    shrink = max(1.0, max(rows, columns) / limit)
    size = (max(1, round(columns / shrink)), max(1, round(rows / shrink)))
    height: NDArray[np.float64] = image.grey
    if shrink > 1.0:
        height = block_means(image.grey, size[::-1])
    return HeightSurface(
        x_mm=(_block_centres(columns, size[0]) - axis[0]) * scale[0],
        y_mm=(_block_centres(rows, size[1]) - axis[1]) * scale[1],
        height=height * height_per_grey,
    )


def _block_centres(pixels: int, blocks: int) -> NDArray[np.float64]:
    """Pixel coordinates of the centres of equal blocks that cover a row of pixels."""
    centres: NDArray[np.float64] = (np.arange(blocks, dtype=np.float64) + 0.5) * (pixels / blocks) - 0.5
    return centres


def integrate_gradients(
    slope_x: NDArray[Any], slope_y: NDArray[Any], mm_per_pixel: tuple[float, float]
) -> NDArray[np.float64]:
    """The surface whose slopes are nearest, by least squares with free borders (Poisson's equation by DCT).

    Parameters
    ----------
    slope_x, slope_y
        Slopes along the columns' index and the rows', shape (rows, columns).
    mm_per_pixel
        Size (x, y) of a pixel, mm.

    Returns
    -------
    numpy.ndarray
        Heights in mm with mean 0, shape (rows, columns).

    Examples
    --------
    >>> y, x = np.mgrid[:40, :50] * 0.1
    >>> plane = integrate_gradients(np.full(x.shape, 0.2), np.full(x.shape, -0.1), (0.1, 0.1))
    >>> bool(np.abs(plane - plane.mean() - (0.2 * x - 0.1 * y - (0.2 * x - 0.1 * y).mean())).max() < 1e-9)
    True
    """
    rows, columns = slope_x.shape
    sx, sy = mm_per_pixel
    # Differences between neighbours are the means of their slopes; their divergence has zero flux at the border.
    across = (slope_x[:, 1:] + slope_x[:, :-1]) * 0.5
    down = (slope_y[1:] + slope_y[:-1]) * 0.5
    source = np.zeros((rows, columns), dtype=across.dtype)
    source[:, :-1] += across / sx
    source[:, 1:] -= across / sx
    source[:-1] += down / sy
    source[1:] -= down / sy
    eigen = (2.0 - 2.0 * np.cos(np.pi * np.arange(columns) / columns)) / sx**2
    other = (2.0 - 2.0 * np.cos(np.pi * np.arange(rows) / rows)) / sy**2
    total = (eigen[None, :] + other[:, None]).astype(source.dtype)
    total[0, 0] = 1.0
    spectrum = scipy.fft.dctn(source, type=2, norm="ortho") / -total
    spectrum[0, 0] = 0.0
    return np.asarray(scipy.fft.idctn(spectrum, type=2, norm="ortho"))
