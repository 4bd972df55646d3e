"""Corrections of a frame: dark level, uneven light, the untouched reference, drift of the lamps.

Each call returns a new frame. Nothing is clipped, because noise clipped at zero does not average to zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tsis.errors import ImageMismatchError, InputError
from tsis.model.image import TactileImage

SMALLEST_LIGHT = 1e-3  # fraction of a frame's median; darker pixels carry no light to divide by
SCALE_TOLERANCE = 1e-6  # relative; far above the rounding of a scale in a file


def subtract_dark(image: TactileImage, dark: TactileImage) -> TactileImage:
    """Subtract the camera's dark level: a frame with the lamps off, at the same camera settings; best a mean of many.

    Noise can make the result negative. Raises `ImageMismatchError` when size, scale or full scale differ.
    """
    require_same_frame(image, dark, "dark")
    return replace(image, grey=image.grey - dark.grey)


def flatten(image: TactileImage, flat: TactileImage) -> TactileImage:
    """Divide by the light's pattern and preserve the mean brightness: ``image * mean(flat) / flat``.

    ``flat`` is a frame of a uniform object under the same light. Both are without dark level. Raises
    `ImageMismatchError` when size, scale or full scale differ; `InputError` when the flat field has dark pixels.
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
    """Subtract the frame of the untouched probe: the change of grey level by the contact.

    Raises `ImageMismatchError` when size, scale or full scale differ.
    """
    require_same_frame(image, reference, "reference")
    return replace(image, grey=image.grey - reference.grey)


def match_light(reference: TactileImage, image: TactileImage) -> TactileImage:
    """Scale the reference to the brightness of the lamps in ``image``.

    Lamps drift by some per cent while they warm up. The ratio is the median of ``image / reference``, so it is valid
    while less than half of the field is touched. Do not use it on frames with contact over the whole field. Raises
    `ImageMismatchError` when size, scale or full scale differ; `InputError` when the reference is dark.

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
    """The change of grey level by the contact, positive where the probe is pressed.

    Raises `ImageMismatchError` when size, scale or full scale differ; `InputError` when ``invert`` has no reference:
    the level that the light falls from is unknown.

    Parameters
    ----------
    image
        The pressed probe.
    reference
        The untouched probe; None when ``image`` is the change already.
    invert
        True for probes whose light FALLS where they are pressed: ``reference - image``.

    Returns
    -------
    TactileImage
        The change in grey levels, with the scale, force and name of ``image``.

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
    return replace(change, grey=0.0 - change.grey) if invert else change  # without negative zeros


def require_image(name: str, image: object) -> None:
    """Refuse a value that is no TactileImage."""
    if not isinstance(image, TactileImage):
        raise InputError(f"{name} must be a TactileImage; got {type(image).__name__} (wrap it: TactileImage(grey=...))")


def require_same_frame(image: TactileImage, other: TactileImage, name: str) -> None:
    """Refuse a companion frame with another size, scale or full scale than ``image``."""
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
    scale, scale_2 = image.mm_per_pixel, other.mm_per_pixel
    if scale is not None and scale_2 is not None and not np.allclose(scale, scale_2, rtol=SCALE_TOLERANCE, atol=0.0):
        raise ImageMismatchError(
            f"{name} must have the image's mm_per_pixel {scale}; got {scale_2} (calibrate the scale once for both)"
        )
