"""The area under a curve and DeLong's variance as they are defined: every pair of targets compared."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def area_and_variance(scores: NDArray[np.float64], present: NDArray[np.bool_]) -> tuple[float, float]:
    """Area and variance of scores of shape (targets,), by a matrix of present times absent.

    Examples
    --------
    >>> import numpy as np
    >>> area_and_variance(np.array([1.0, 3.0, 2.0, 4.0]), np.array([False, False, True, True]))
    (0.75, 0.125)
    """
    inside, outside = scores[present][:, None], scores[~present][None, :]
    won = (inside > outside) + 0.5 * (inside == outside)
    variance = won.mean(axis=1).var(ddof=1) / len(inside) + won.mean(axis=0).var(ddof=1) / outside.size
    return float(won.mean()), float(variance)
