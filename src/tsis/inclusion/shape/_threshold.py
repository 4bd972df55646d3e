"""Threshold between background and object by two means, initialised by the picture's corners, (6.12) and (6.13)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model import require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


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
        result = int(np.searchsorted(ascending, cut))
        if result in (0, count, below):  # one class only, or no pixel changed sides
            return TwoMeans(background_grey=low, object_grey=high, threshold_grey=cut, corners_grey=corners)
        below = result
        low, high = float(sums[below] / below), float((sums[-1] - sums[below]) / (count - below))
