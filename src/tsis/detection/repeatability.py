"""How far readings of one operator on one target lie apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from tsis.detection.inputs import readings as checked_readings
from tsis.detection.interval import LEVEL, Interval, checked_level
from tsis.detection.two_way import squares
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike

APART = 1.959963984540054 * math.sqrt(2)  # standard deviations between two readings, which 95 % do not exceed


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeatability:
    """Scatter of readings within and between targets, in the unit of the readings.

    Attributes
    ----------
    within_sd
        Standard deviation of readings of one target.
    between_sd
        Standard deviation of the true values of targets; 0 where ``between_truncated``.
    between_truncated
        Whether the estimated variance between targets was negative, and was cut at 0.
    degrees_of_freedom
        On which ``within_sd`` rests: readings less targets.
    mean
        Of all readings.
    """

    within_sd: float
    between_sd: float
    between_truncated: bool
    degrees_of_freedom: int
    mean: float

    @property
    def coefficient(self) -> float:
        """Repeatability coefficient: two readings of a target differ by less with a probability of 95 %; 2.77 sd."""
        return APART * self.within_sd

    def interval(self, level: float = LEVEL) -> Interval:
        """Interval of the repeatability coefficient, exact for normal readings.

        Parameters
        ----------
        level
            Confidence, in (0, 1).

        Raises
        ------
        InputError
            When the level is no probability, or readings of a target never differ.
        """
        tail, free = (1 - checked_level(level)) / 2, self.degrees_of_freedom
        if self.within_sd == 0:
            raise InputError(
                "readings of a target must differ for an interval; got repeats that are all equal: record more digits"
            )
        low, high = (self.coefficient * math.sqrt(free / float(chdtri(free, at))) for at in (tail, 1 - tail))
        return Interval(low=low, high=high, level=level, method="chi-square")


def repeatability(readings: Sequence[ArrayLike]) -> Repeatability:
    """Repeatability from repeats on several targets, by the one-way analysis of variance.

    Parameters
    ----------
    readings
        One row of finite readings a target, at least 2 targets; rows may differ in length, and at least one holds 2.

    Raises
    ------
    InputError
        When a row is empty or not finite, or there are fewer than 2 targets or no repeats.

    Examples
    --------
    >>> found = repeatability([[8.1, 8.3], [10.0, 10.3, 10.1], [6.2, 6.2]])
    >>> round(found.within_sd, 3), round(found.coefficient, 3), [round(end, 2) for end in found.interval()]
    (0.129, 0.358, [0.21, 1.03])
    """
    rows = [checked_readings(f"readings[{index}]", row, ndim=1) for index, row in enumerate(readings)]
    sizes = np.array([len(row) for row in rows])
    if len(rows) < 2 or sizes.max() < 2:
        most = int(sizes.max()) if len(sizes) else 0
        raise InputError(
            f"readings must hold at least 2 targets, one of them read twice; got {len(rows)} of at most {most} readings"
        )
    together = np.concatenate(rows)
    mean, means = float(together.mean()), np.array([row.mean() for row in rows])
    free, total = int(sizes.sum()) - len(rows), int(sizes.sum())
    within = squares(together - np.repeat(means, sizes), together) / free
    between = squares(np.sqrt(sizes) * (means - mean), together) / (len(rows) - 1)
    size = (total - float((sizes**2).sum()) / total) / (len(rows) - 1)  # of a target, for unequal numbers of readings
    variance = (between - within) / size
    return Repeatability(
        within_sd=math.sqrt(within),
        between_sd=math.sqrt(max(variance, 0.0)),
        between_truncated=variance < 0,
        degrees_of_freedom=free,
        mean=mean,
    )


__all__ = ["APART", "Repeatability", "repeatability"]
