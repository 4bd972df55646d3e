"""The least spread of any unbiased estimate: the Cramér–Rao bound of a Fisher information."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def least_sd(information: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least standard deviation of each parameter, shape (..., k), of information (..., k, k).

    Infinite for all of them where some combination of them is not told at all.
    """
    values, directions = np.linalg.eigh(information)
    told = values[..., :1] > np.finfo(float).eps * values[..., -1:]  # they ascend
    variance = np.einsum("...ij,...j->...i", directions**2, 1 / np.where(told, values, 1.0))
    return np.asarray(np.where(told, np.sqrt(variance), np.inf))
