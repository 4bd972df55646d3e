"""Coordinates of a grid, and values between its points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tsis.model.check import require_array
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from scipy.sparse import csr_array


def require_ascending(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Check a coordinate of a grid: at least two numbers, each above the one before."""
    result: NDArray[np.float64] = require_array(name, values, ndim=1)
    if len(result) < 2 or (np.diff(result) <= 0).any():
        raise InputError(f"{name} must hold at least two ascending numbers; got {values!r:.80}")
    return result


def interpolation_matrix(
    knots: NDArray[np.float64], at: ArrayLike, *, outside: Literal["edge", "zero"] = "edge"
) -> csr_array[Any, tuple[int, int]]:
    """Matrix from values at ascending ``knots`` to values at ``at``, shape (len(at), len(knots)): linear between.

    Beyond the knots values are those of the edge, or zero. Two numbers a row are all it holds, so a map of m rows and n
    columns is brought to another grid in a time that goes with the grid's points.

    Examples
    --------
    >>> interpolation_matrix(np.array([0.0, 2.0]), [-1.0, 0.5, 2.0]).toarray().tolist()
    [[1.0, 0.0], [0.75, 0.25], [0.0, 1.0]]
    >>> interpolation_matrix(np.array([0.0, 2.0]), [-1.0], outside="zero").toarray().tolist()
    [[0.0, 0.0]]
    """
    from scipy.sparse import csr_array  # as long to load as all the rest of the model

    places = np.asarray(at, dtype=float)
    left = np.clip(np.searchsorted(knots, places, side="right") - 1, 0, len(knots) - 2)
    part = np.clip((places - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
    weights = np.column_stack([1 - part, part])
    if outside == "zero":
        weights[(places < knots[0]) | (places > knots[-1])] = 0.0
    columns = np.column_stack([left, left + 1])
    rows = np.arange(0, 2 * len(places) + 1, 2)
    return csr_array((weights.ravel(), columns.ravel(), rows), shape=(len(places), len(knots)))
