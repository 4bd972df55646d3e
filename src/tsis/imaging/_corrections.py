"""Corrections of a frame: dark level, uneven light, the untouched reference, drift of the lamps.

Each call takes frames and returns a new frame; nothing is clipped, for a noise that is cut at zero no longer averages
to zero.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import ImageMismatchError, InputError
from tsis.model import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray


SMALLEST_LIGHT = 1e-3  # share of a frame's median below which a pixel carries no light to divide by
SCALE_TOLERANCE = 1e-6  # relative; a scale that went through a file keeps its digits


def subtract_dark(image: TactileImage, dark: TactileImage) -> TactileImage:
    """Take away what the camera reads without light.

    Parameters
    ----------
    image
        Any frame, grey levels.
    dark
        A frame with the lamps off, of the same camera settings; best a mean of many.

    Returns
    -------
    TactileImage
        ``image - dark``; negative where noise says so.

    Raises
    ------
    ImageMismatchError
        When size, scale or full scale differ.
    """
    require_same_frame(image, dark, "dark")
    return replace(image, grey=image.grey - dark.grey)


def flatten(image: TactileImage, flat: TactileImage) -> TactileImage:
    """Divide by the light's own pattern, keeping the mean brightness.

    Parameters
    ----------
    image
        A frame whose dark level was taken away.
    flat
        A frame of something uniform under the same light, its dark level taken away too.

    Returns
    -------
    TactileImage
        ``image * mean(flat) / flat``.

    Raises
    ------
    ImageMismatchError
        When size, scale or full scale differ.
    InputError
        When the flat field has dark pixels, which nothing can be divided by.
    """
    require_same_frame(image, flat, "flat")
    floor = SMALLEST_LIGHT * float(np.median(flat.grey))
    unlit = int(np.count_nonzero(flat.grey <= max(floor, 0.0)))
    if unlit:
        raise InputError(
            f"flat must be lit everywhere; got {unlit} dark pixels out of {flat.grey.size} (light the whole field)"
        )
    return replace(image, grey=image.grey * (flat.grey.mean() / flat.grey))


def subtract_background(image: TactileImage, reference: TactileImage) -> TactileImage:
    """Take away the frame of the untouched probe: the change of grey level that the touch made.

    Raises
    ------
    ImageMismatchError
        When size, scale or full scale differ.
    """
    require_same_frame(image, reference, "reference")
    return replace(image, grey=image.grey - reference.grey)


def match_light(reference: TactileImage, image: TactileImage) -> TactileImage:
    """Bring the reference to the brightness that the lamps have in ``image``.

    Lamps drift by some per cent while they warm up. The ratio is the median of ``image / reference``, so it is the
    lamps' as long as less than half of the field is touched; do not use it on frames that are lit all over.

    Parameters
    ----------
    reference
        The untouched probe, lit somewhere.
    image
        A frame of the same probe, mostly untouched.

    Returns
    -------
    TactileImage
        The reference times the ratio.

    Raises
    ------
    ImageMismatchError
        When size, scale or full scale differ.
    InputError
        When the reference is dark.

    Examples
    --------
    >>> untouched = TactileImage(grey=np.full((8, 8), 100.0))
    >>> warmed_up = TactileImage(grey=np.full((8, 8), 104.0))
    >>> float(match_light(untouched, warmed_up).grey.max())
    104.0
    """
    require_same_frame(image, reference, "reference")
    lit = reference.grey > max(SMALLEST_LIGHT * reference.full_scale, 0.0)
    if 2 * np.count_nonzero(lit) < lit.size:
        raise InputError("reference must be lit in at least half of its pixels to compare lamps; got a dark frame")
    ratio = float(np.median(image.grey[lit] / reference.grey[lit]))
    return replace(reference, grey=reference.grey * ratio)


def signal(image: TactileImage, reference: TactileImage | None = None, *, invert: bool = False) -> TactileImage:
    """The change of grey level that the touch made, positive where the probe is pressed.

    Parameters
    ----------
    image
        The pressed probe.
    reference
        The untouched probe; None when ``image`` holds the change already.
    invert
        True for probes whose light FALLS where they are pressed: ``reference - image``.

    Returns
    -------
    TactileImage
        The change in grey levels, with the scale, force and name of ``image``.

    Raises
    ------
    ImageMismatchError
        When size, scale or full scale differ.
    InputError
        When ``invert`` is asked for without a reference: the level that the light falls from is not known.

    Examples
    --------
    >>> untouched = TactileImage(grey=np.full((2, 2), 100.0))
    >>> pressed = TactileImage(grey=[[100.0, 70.0], [100.0, 100.0]])
    >>> signal(pressed, untouched, invert=True).grey.tolist()
    [[0.0, 30.0], [0.0, 0.0]]
    """
    require_image("image", image)
    if reference is None:
        if invert:
            raise InputError("invert needs a reference, the level that the light falls from; got None")
        return image
    change = subtract_background(image, reference)
    return replace(change, grey=_negative(change.grey)) if invert else change


def _negative(grey: NDArray[np.float64]) -> NDArray[np.float64]:
    """``0 - grey``, which unlike ``-grey`` holds no negative zeros to print."""
    return 0.0 - grey


def require_image(name: str, image: object) -> None:
    """Refuse anything that is not a TactileImage, an array for instance."""
    if not isinstance(image, TactileImage):
        raise InputError(f"{name} must be a TactileImage; got {type(image).__name__} (wrap it: TactileImage(grey=...))")


def require_same_frame(image: TactileImage, other: TactileImage, name: str) -> None:
    """Refuse a companion frame whose size, scale or full scale is not that of ``image``."""
    require_image("image", image)
    require_image(name, other)
    if image.grey.shape != other.grey.shape:
        raise ImageMismatchError(
            f"{name} must have the image's shape {image.grey.shape}; got {other.grey.shape} (record both in one mode)"
        )
    if image.full_scale != other.full_scale:
        raise ImageMismatchError(
            f"{name} must have the image's full_scale {image.full_scale:g}; got {other.full_scale:g} "
            "(record both with one bit depth)"
        )
    ours, theirs = image.mm_per_pixel, other.mm_per_pixel
    if ours is not None and theirs is not None and not np.allclose(ours, theirs, rtol=SCALE_TOLERANCE, atol=0.0):
        raise ImageMismatchError(
            f"{name} must have the image's mm_per_pixel {ours}; got {theirs} (calibrate the scale once for both)"
        )
