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
        Whose scale, axis and full scale the answer keeps.
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
    """Place and shape of the largest part above a threshold, every pixel of it counted alike.

    Raises
    ------
    InputError
        When the whole picture is above the threshold, so that nothing in it is background.
    """
    binary = binary_image(image, threshold_grey)
    if binary.grey.min() > 0:
        raise InputError(
            f"some of the picture must lie below the threshold of {threshold_grey:.4g} grey levels; "
            "got one that is lit to its last pixel (cropped, overexposed, or with the wrong reference)"
        )
    return features(binary, method="half")
