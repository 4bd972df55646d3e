"""Colour in and colour out: colour frames to grey levels, grey levels to colours for the eye."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tsis.imaging.correct import check_image
from tsis.imaging.patch import segment
from tsis.model import TactileImage, check
from tsis.model.errors import ImageMismatchError, InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

REC_709 = (0.2126, 0.7152, 0.0722)  # luma weights of red, green, blue (ITU-R BT.709-6, item 3.2)
FULL_SCALE = {"uint8": 255.0, "uint16": 65535.0}
COLOUR_MAPS = {  # perceptually uniform and readable without red-green vision
    "cividis": cv2.COLORMAP_CIVIDIS,
    "inferno": cv2.COLORMAP_INFERNO,
    "viridis": cv2.COLORMAP_VIRIDIS,
}


def to_grey(pixels: NDArray[Any]) -> tuple[NDArray[np.float64], float]:
    """Grey levels of a colour frame: Rec. 709 luma of its stored values.

    Parameters
    ----------
    pixels
        Shape (rows, columns), (rows, columns, 3) red, green, blue, or (rows, columns, 4) with alpha, which is dropped;
        uint8 or uint16. Sixteen bits are kept, not scaled down.

    Returns
    -------
    tuple
        The grey levels, shape (rows, columns), and the level at which the camera clips: 255 or 65535.

    Raises
    ------
    InputError
        When shape or type is another.

    Examples
    --------
    >>> grey, full_scale = to_grey(np.full((1, 1, 3), 200, dtype=np.uint8))
    >>> round(float(grey[0, 0]), 6), full_scale
    (200.0, 255.0)
    """
    kind = str(pixels.dtype) if isinstance(pixels, np.ndarray) else type(pixels).__name__
    if kind not in FULL_SCALE:
        raise InputError(f"pixels must be an array of uint8 or uint16; got {kind}")
    if pixels.size == 0:
        raise InputError(f"pixels must not be empty; got shape {pixels.shape}")
    if pixels.ndim == 2:
        return pixels.astype(np.float64), FULL_SCALE[kind]
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4):
        raise InputError(f"pixels must have shape (rows, columns[, 3 or 4]); got {pixels.shape}")
    return pixels[..., :3] @ np.array(REC_709), FULL_SCALE[kind]


def change_magnitude(
    frame_rgb: NDArray[Any], reference_rgb: NDArray[Any], *, equalise_lamps: bool = False
) -> NDArray[np.float64]:
    """How much the colour changed: the root of the sum over channels of the squared change.

    A coloured lamp on each side codes the slope of a soft face as colour (GelSight): a grey level may not change where
    the colour does.

    Parameters
    ----------
    frame_rgb, reference_rgb
        The pressed and the untouched probe, shape (rows, columns, channels), any number type.
    equalise_lamps
        Divide each channel by the standard deviation of its change inside the patch first, so that a brighter lamp does
        not pull the contact to its side; the mean inside the patch stays as it was.

    Returns
    -------
    numpy.ndarray
        Shape (rows, columns), grey levels, >= 0.

    Raises
    ------
    InputError
        When an array is no colour frame or is not finite.
    ImageMismatchError
        When the shapes differ.

    Examples
    --------
    >>> pressed, untouched = np.zeros((1, 1, 3)), np.zeros((1, 1, 3))
    >>> pressed[0, 0] = (3.0, -4.0, 0.0)
    >>> change_magnitude(pressed, untouched).tolist()
    [[5.0]]
    """
    frame = check.array("frame_rgb", frame_rgb, ndim=3)
    reference = check.array("reference_rgb", reference_rgb, ndim=3)
    if frame.shape != reference.shape:
        raise ImageMismatchError(f"reference_rgb must have the frame's shape {frame.shape}; got {reference.shape}")
    change = frame - reference
    magnitude = np.sqrt(np.square(change).sum(axis=2))
    return _equalised(change, magnitude) if equalise_lamps else magnitude


def _equalised(change: NDArray[np.float64], magnitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """The magnitude with channels of equal spread inside the patch; as it was where there is no patch."""
    mask = segment(TactileImage(grey=magnitude)).mask
    if not mask.any():
        return magnitude
    spread = change[mask].std(axis=0)
    lit = spread > 0
    if not lit.any():
        return magnitude
    equal = np.sqrt(np.square(change[..., lit] / spread[lit]).sum(axis=2))
    result: NDArray[np.float64] = equal * (magnitude[mask].mean() / equal[mask].mean())
    return result


def colour_map(
    image: TactileImage, *, name: str = "viridis", low: float = 0.0, high: float | None = None
) -> NDArray[np.uint8]:
    """Colours of grey levels for the eye, as red, green, blue.

    Parameters
    ----------
    image
        Any frame or signal.
    name
        ``"cividis"``, ``"inferno"`` or ``"viridis"``.
    low, high
        Grey levels of the map's two ends; levels beyond them get the end's colour; ``high`` None is the full scale.

    Returns
    -------
    numpy.ndarray
        Shape (rows, columns, 3), uint8.

    Raises
    ------
    UnknownNameError
        When no map has that name.
    InputError
        When ``high`` does not exceed ``low``.
    """
    check_image("image", image)
    check.known("colour map", name, COLOUR_MAPS)
    top = image.full_scale if high is None else high
    low, top = check.number("low", low, -1e9, 1e9), check.number("high", top, -1e9, 1e9)
    if top <= low:
        raise InputError(f"high must exceed low = {low:g}; got {top:g}")
    levels = np.rint(np.clip((image.grey - low) / (top - low), 0.0, 1.0) * 255.0).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels, COLOUR_MAPS[name])[..., ::-1], dtype=np.uint8)
