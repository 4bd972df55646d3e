"""How far readings of one target by different operators lie apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scipy.special import chdtri

from tsis.detection.inputs import readings as checked_readings
from tsis.detection.interval import LEVEL, Interval, checked_level
from tsis.detection.repeatability import APART
from tsis.detection.two_way import squares
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproducibility:
    """Scatter of a balanced study of targets, operators and repeats, in the unit of the readings.

    Attributes
    ----------
    target_sd, operator_sd, interaction_sd, repeat_sd
        Standard deviations of targets, of operators, of what operators do differently on each target, of repeats.
    truncated
        Which of the first three were cut at 0, because their estimated variance was negative.
    mean_squares
        Of targets, operators, interaction and repeats.
    degrees_of_freedom
        Of the same.
    shape
        Targets, operators, repeats.
    """

    target_sd: float
    operator_sd: float
    interaction_sd: float
    repeat_sd: float
    truncated: tuple[str, ...]
    mean_squares: tuple[float, float, float, float]
    degrees_of_freedom: tuple[int, int, int, int]
    shape: tuple[int, int, int]

    @property
    def repeatability_coefficient(self) -> float:
        """Two readings of a target by one operator differ by less with a probability of 95 %."""
        return APART * self.repeat_sd

    @property
    def coefficient(self) -> float:
        """Two readings of a target by two operators differ by less with a probability of 95 %.

        From the sum of the three variances as estimated, before any is cut at 0; it cannot be negative.
        """
        return APART * math.sqrt(sum(weight * square for weight, square, _ in self._terms()))

    def repeatability_interval(self, level: float = LEVEL) -> Interval:
        """Interval of the repeatability coefficient, exact for normal readings.

        Parameters
        ----------
        level
            Confidence, in (0, 1).

        Raises
        ------
        InputError
            When the level is no probability, or repeats never differ.
        """
        tail, free = (1 - checked_level(level)) / 2, self.degrees_of_freedom[3]
        self._require_scatter()
        middle = self.repeatability_coefficient
        low, high = (middle * math.sqrt(free / float(chdtri(free, at))) for at in (tail, 1 - tail))
        return Interval(low=low, high=high, level=level, method="chi-square")

    def interval(self, level: float = LEVEL) -> Interval:
        """Interval of the coefficient between operators, by Graybill and Wang's modified large samples.

        With two or three operators its upper end is far away, as it must be.

        Parameters
        ----------
        level
            Confidence, in (0, 1).

        Raises
        ------
        InputError
            When the level is no probability, or repeats never differ.
        """
        tail = (1 - checked_level(level)) / 2
        self._require_scatter()
        middle = (self.coefficient / APART) ** 2
        below = above = 0.0
        for weight, square, free in self._terms():
            below += ((1 - free / float(chdtri(free, tail))) * weight * square) ** 2
            above += ((free / float(chdtri(free, 1 - tail)) - 1) * weight * square) ** 2
        return Interval(
            low=APART * math.sqrt(max(middle - math.sqrt(below), 0.0)),
            high=APART * math.sqrt(middle + math.sqrt(above)),
            level=level,
            method="modified large samples",
        )

    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        """Weight, mean square and degrees of freedom, of what makes up a reading on a given target."""
        targets, _, repeats = self.shape
        weights = (1 / (targets * repeats), (targets - 1) / (targets * repeats), (repeats - 1) / repeats)
        return tuple(zip(weights, self.mean_squares[1:], self.degrees_of_freedom[1:], strict=True))

    def _require_scatter(self) -> None:
        if self.repeat_sd == 0:
            raise InputError("readings must differ between repeats for an interval; got equal ones: record more digits")


def reproducibility(readings: ArrayLike) -> Reproducibility:
    """Reproducibility from a balanced study, by the two-way analysis of variance with interaction, all random.

    Parameters
    ----------
    readings
        Finite, shape (targets, operators, repeats), at least 2 of each.

    Raises
    ------
    InputError
        When the table is not finite or too small.

    Examples
    --------
    >>> found = reproducibility([[[8.1, 8.3], [8.6, 8.5]], [[10.0, 10.2], [10.4, 10.6]], [[6.2, 6.1], [6.4, 6.6]]])
    >>> round(found.repeatability_coefficient, 2), round(found.coefficient, 2), found.truncated
    (0.34, 0.76, ('interaction',))
    """
    table = checked_readings("readings", readings, ndim=3)
    n, k, r = table.shape
    if min(n, k, r) < 2:
        raise InputError(f"readings must have at least 2 targets, operators and repeats; got shape {table.shape}")
    centred = table - table.mean()
    cells = centred.mean(axis=2)
    rows, columns = cells.mean(axis=1), cells.mean(axis=0)
    free = (n - 1, k - 1, (n - 1) * (k - 1), n * k * (r - 1))
    found = (
        k * r * squares(rows, table) / free[0],
        n * r * squares(columns, table) / free[1],
        r * squares(cells - rows[:, None] - columns, table) / free[2],
        squares(centred - cells[:, :, None], table) / free[3],
    )
    variances = {
        "target": (found[0] - found[2]) / (k * r),
        "operator": (found[1] - found[2]) / (n * r),
        "interaction": (found[2] - found[3]) / r,
    }
    cut = {name: math.sqrt(max(variance, 0.0)) for name, variance in variances.items()}
    return Reproducibility(
        target_sd=cut["target"],
        operator_sd=cut["operator"],
        interaction_sd=cut["interaction"],
        repeat_sd=math.sqrt(found[3]),
        truncated=tuple(name for name, variance in variances.items() if variance < 0),
        mean_squares=found,
        degrees_of_freedom=free,
        shape=(n, k, r),
    )


__all__ = ["Reproducibility", "reproducibility"]
