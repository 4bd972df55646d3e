"""Mean squares of a table of targets and raters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection.inputs import readings
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


SMALLEST = 1e-70  # deviation; the fourth power of a smaller one is lost


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanSquares:
    """What a table of ratings scatters by, from the analysis of variance.

    Attributes
    ----------
    targets, raters
        Between targets, and between raters.
    residual
        What neither explains.
    within
        Within targets: raters and residual together.
    target_count, rater_count
        Rows and columns.
    """

    targets: float
    raters: float
    residual: float
    within: float
    target_count: int
    rater_count: int

    @classmethod
    def of(cls, ratings: ArrayLike) -> MeanSquares:
        """Mean squares of a table.

        Parameters
        ----------
        ratings
            Finite, shape (targets, raters), at least 2 by 2.

        Raises
        ------
        InputError
            When the table is not finite or too small.

        Examples
        --------
        >>> MeanSquares.of([[1, 2], [3, 4]])
        MeanSquares(targets=4.0, raters=1.0, residual=0.0, within=0.5, target_count=2, rater_count=2)
        """
        table = readings("ratings", ratings, ndim=2)
        n, k = table.shape
        if n < 2 or k < 2:
            raise InputError(
                f"ratings must have at least 2 targets (rows) and 2 raters (columns); got {n} and {k}: add some"
            )
        centred = table - table.mean()
        rows, columns = centred.mean(axis=1), centred.mean(axis=0)
        residual = squares(centred - rows[:, None] - columns, table)
        by_raters = n * squares(columns, table)
        return cls(
            targets=k * squares(rows, table) / (n - 1),
            raters=by_raters / (k - 1),
            residual=residual / ((n - 1) * (k - 1)),
            within=(residual + by_raters) / (n * (k - 1)),
            target_count=n,
            rater_count=k,
        )


def squares(deviations: NDArray[np.float64], measured: NDArray[np.float64]) -> float:
    """Sum of squares of deviations of what was ``measured``; 0 where rounding alone made them."""
    rounding = max(8 * np.finfo(float).eps * float(np.abs(measured).max()), SMALLEST)
    return float((deviations**2).sum()) if np.abs(deviations).max() > rounding else 0.0


__all__ = ["MeanSquares", "squares"]
