"""The binary tactile image (6.11): object above a threshold, background below."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.imaging import Features, features
from tsis.model import require_number

if TYPE_CHECKING:
    from tsis.model import TactileImage


def binary_image(image: TactileImage, threshold_grey: float) -> TactileImage:
    """Full scale where the image reaches the threshold, zero elsewhere (6.11).

    Parameters
    ----------
    image
        The image; the result has its scale, axis and full scale.
    threshold_grey
        In grey levels, at most the full scale above or below zero.

    Raises
    ------
    InputError
        When the threshold lies outside its range.

    Examples
    --------
    >>> from tsis.model import TactileImage
    >>> binary_image(TactileImage(grey=[[3.0, 5.0, 9.0]]), 5.0).grey.tolist()
    [[0.0, 255.0, 255.0]]
    """
    require_number("threshold_grey", threshold_grey, -image.full_scale, image.full_scale)
    return replace(image, grey=np.where(image.grey >= threshold_grey, image.full_scale, 0.0))


def binary_features(image: TactileImage, threshold_grey: float) -> Features:
    """Position and shape of the largest part above a threshold, which the whole picture must not exceed."""
    binary = binary_image(image, threshold_grey)
    if binary.grey.min() > 0:
        raise InputError(
            f"some of the picture must lie below the threshold of {threshold_grey:.4g} grey levels; "
            "got one with all pixels above it (cropped, overexposed, or with the wrong reference)"
        )
    return features(binary, method="half")
