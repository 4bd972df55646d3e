"""The one linear system of all methods: normal equations with a ridge on their diagonal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve

if TYPE_CHECKING:
    from numpy.typing import NDArray


def ridge_solution(
    normal: NDArray[np.float64], right: NDArray[np.float64], ridge: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Solution x of ``(normal + diag(ridge)) x = right``, shape (k, d); unchecked, for inner loops.

    ``normal``, shape (k, k), is symmetric and used up: its content is another one afterwards.
    """
    normal[np.diag_indices_from(normal)] += ridge
    factor = cho_factor(normal, overwrite_a=True, check_finite=False)
    return np.asarray(cho_solve(factor, right, check_finite=False))
