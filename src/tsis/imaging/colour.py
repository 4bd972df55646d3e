"""Change of a colour frame as one number a pixel, and grey levels as colours."""

from __future__ import annotations

from functools import cache, reduce
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.corrections import require_image
from tsis.imaging.patch import segment
from tsis.model.image import TactileImage
from tsis.model.require import require_array, require_number, require_one_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


COLOUR_MAPS = ("cividis", "inferno", "viridis")  # perceptually uniform and readable without red-green vision


def change_magnitude(
    frame_rgb: NDArray[Any], reference_rgb: NDArray[Any], *, equalise_lamps: bool = False
) -> NDArray[np.float64]:
    """Magnitude of the change of colour: the root of the sum over channels of the squared change.

    A coloured lamp on each side codes the slope of a soft face as colour (GelSight): a grey level may not change where
    the colour does.

    Raises `InputError` when an array is no colour frame or is not finite; `ImageMismatchError` when the shapes differ.

    Parameters
    ----------
    frame_rgb, reference_rgb
        The pressed and the untouched probe, shape (rows, columns, channels), any number type.
    equalise_lamps
        First divide each channel by the standard deviation of its change inside the patch, so that a brighter lamp does
        not shift the contact to its side; the mean inside the patch does not change.

    Returns
    -------
    numpy.ndarray
        Shape (rows, columns), grey levels, >= 0.

    Examples
    --------
    >>> pressed, untouched = np.zeros((1, 1, 3)), np.zeros((1, 1, 3))
    >>> pressed[0, 0] = (3.0, -4.0, 0.0)
    >>> change_magnitude(pressed, untouched).tolist()
    [[5.0]]
    """
    frame = require_array("frame_rgb", frame_rgb, ndim=3)
    reference = require_array("reference_rgb", reference_rgb, ndim=3)
    if frame.shape != reference.shape:
        raise ImageMismatchError(f"reference_rgb must have the frame's shape {frame.shape}; got {reference.shape}")
    change = frame - reference
    magnitude: NDArray[np.float64] = np.sqrt(np.square(change).sum(axis=2))
    if not equalise_lamps:
        return magnitude
    mask = segment(TactileImage(grey=magnitude)).mask
    spread = change[mask].std(axis=0) if mask.any() else np.zeros(change.shape[2])
    lit = spread > 0
    if not lit.any():
        return magnitude
    equal = np.sqrt(np.square(change[..., lit] / spread[lit]).sum(axis=2))
    result: NDArray[np.float64] = equal * (magnitude[mask].mean() / equal[mask].mean())
    return result


def colour_map(
    image: TactileImage, *, name: str = "viridis", low: float = 0.0, high: float | None = None
) -> NDArray[np.uint8]:
    """Colours of grey levels, as red, green, blue.

    Raises `UnknownNameError` when no map has that name; `InputError` when ``high`` does not exceed ``low``.

    Parameters
    ----------
    image
        Any frame or signal.
    name
        ``"cividis"``, ``"inferno"`` or ``"viridis"``.
    low, high
        Grey levels at the ends of the map; levels beyond them get the end's colour; ``high`` None is the full scale.

    Returns
    -------
    numpy.ndarray
        Shape (rows, columns, 3), uint8.
    """
    require_image("image", image)
    require_one_of("colour map", name, COLOUR_MAPS)
    top = image.full_scale if high is None else high
    low, top = require_number("low", low, -1e9, 1e9), require_number("high", top, -1e9, 1e9)
    if top <= low:
        raise InputError(f"high must exceed low = {low:g}; got {top:g}")
    levels = np.rint(np.clip((image.grey - low) / (top - low), 0.0, 1.0) * 255.0).astype(np.uint8)
    return _table(name)[levels]


@cache
def _table(name: str) -> NDArray[np.uint8]:
    """Red, green and blue of the levels 0 to 255, shape (256, 3)."""
    from matplotlib import colormaps

    table: NDArray[np.uint8] = colormaps[name](np.arange(256), bytes=True)[:, :3]
    return table


FOREIGN_PATTERN, FOREIGN_LEVELS = 0.5, 4.0  # change over the reference's own unevenness, and its least size, levels
PATTERN_BLUR_PX = 2.0


def require_pattern(
    levels: NDArray[Any], reference: NDArray[Any], what: str, *, blur_px: float = PATTERN_BLUR_PX
) -> None:
    """Refuse a reference whose uneven light is not that of the frame: one of another sensor, as bright as it may be."""
    blur = (blur_px, blur_px, 0.0)
    smooth, pattern = scipy.ndimage.gaussian_filter(levels, blur), scipy.ndimage.gaussian_filter(reference, blur)
    left, own = (
        float(np.median(np.abs(part - np.median(part, axis=(0, 1))).max(axis=2)))
        for part in (smooth - pattern, pattern)
    )
    if left > max(FOREIGN_LEVELS, FOREIGN_PATTERN * own):
        raise ImageMismatchError(
            f"reference must be an untouched frame of the sensor that took {what}, under the same light; got one whose "
            f"pattern differs by {left:.0f} levels over half of the frame; its own varies by {own:.0f}"
        )


def largest_channel(levels: NDArray[Any]) -> NDArray[Any]:
    """The largest level of each pixel, shape (rows, columns): 10 times as fast as ``max(axis=2)``."""
    return np.asarray(reduce(np.maximum, np.moveaxis(levels, 2, 0)))
