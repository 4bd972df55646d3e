"""Agreement of two methods of measurement on the same targets, after Bland and Altman."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.detection._icc import squares
from tsis.detection._inputs import LEVEL, Interval, checked_level, choice, readings, same_length
from tsis.errors import InputError
from tsis.model import require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


COVERAGE = 0.95  # fraction of differences between the limits of agreement


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalBias:
    """Line of the differences over the means of both methods.

    Unequal scatter of the methods also causes a slope, without a proportional bias.

    Attributes
    ----------
    slope, intercept
        Difference per unit of the mean, and at a mean of 0.
    standard_error
        Of the slope.
    degrees_of_freedom
        Of the line, targets less 2.
    """

    slope: float
    intercept: float
    standard_error: float
    degrees_of_freedom: int

    @property
    def p(self) -> float:
        """Two-sided p-value of the slope."""
        if self.standard_error == 0:
            return 1.0 if self.slope == 0 else 0.0
        return float(2 * scipy.special.stdtr(self.degrees_of_freedom, -abs(self.slope) / self.standard_error))

    def interval(self, level: float = LEVEL) -> Interval:
        """Student's interval of the slope with the confidence ``level``, in (0, 1); else `InputError`."""
        half = (
            float(scipy.special.stdtrit(self.degrees_of_freedom, 0.5 + checked_level(level) / 2)) * self.standard_error
        )
        return Interval(low=self.slope - half, high=self.slope + half, level=level, method="t")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BlandAltman:
    """Differences of paired readings.

    Attributes
    ----------
    means, differences
        Mean, and first less second, of each target, shape (targets,), in the unit of the readings.
    """

    means: NDArray[np.float64]
    differences: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("means", "differences"):
            object.__setattr__(self, name, readings(name, getattr(self, name), ndim=1))
        same_length("means", self.means, "differences", self.differences)
        if len(self.differences) < 2:
            raise InputError(
                f"differences must be at least 2 to have a spread; got {len(self.differences)}: add targets"
            )

    @property
    def targets(self) -> int:
        """How many."""
        return len(self.differences)

    @property
    def bias(self) -> float:
        """Mean difference, in the unit of the readings."""
        return float(self.differences.mean())

    @property
    def standard_deviation(self) -> float:
        """Of the differences."""
        return float(self.differences.std(ddof=1))

    def bias_interval(self, level: float = LEVEL) -> Interval:
        """Student's interval of the mean difference with the confidence ``level``, in (0, 1).

        Raises `InputError` when the level is no probability, or all differences are equal.
        """
        quantile = float(scipy.special.stdtrit(self.targets - 1, 0.5 + checked_level(level) / 2))
        half = quantile * self._spread() / math.sqrt(self.targets)
        return Interval(low=self.bias - half, high=self.bias + half, level=level, method="t")

    def limits(self, coverage: float = COVERAGE) -> tuple[float, float]:
        """Limits of agreement: bias less and plus 1.96 standard deviations.

        ``coverage`` is the fraction of normal differences between them, in (0, 1); else `InputError` is raised.
        """
        away = _normal(coverage) * self.standard_deviation
        return self.bias - away, self.bias + away

    def limit_intervals(
        self, level: float = LEVEL, *, coverage: float = COVERAGE, method: str = "exact"
    ) -> tuple[Interval, Interval]:
        """Interval of the lower and of the upper limit of agreement, each by itself.

        Raises `InputError` when a fraction is out of range, the method is unknown, or all differences are equal.

        Parameters
        ----------
        level
            Confidence, in (0, 1).
        coverage
            As for `limits`.
        method
            ``"exact"``: from the noncentral t distribution, exact for normal differences (Carkeet, Optom. Vis. Sci. 92
            (2015) e71). ``"approximate"``: symmetric, of Bland and Altman (1999), too short outwards for few targets.
        """
        tail = (1 - checked_level(level)) / 2
        away, spread, n = _normal(coverage), self._spread(), self.targets
        if choice("method", method, ("exact", "approximate")) == "exact":
            noncentral = away * math.sqrt(n)
            near, far = (
                float(scipy.stats.nct.ppf(at, n - 1, noncentral)) * spread / math.sqrt(n) for at in (tail, 1 - tail)
            )
        else:
            half = -float(scipy.special.stdtrit(n - 1, tail)) * spread * math.sqrt(1 / n + away**2 / (2 * (n - 1)))
            near, far = away * spread - half, away * spread + half
        return (
            Interval(low=self.bias - far, high=self.bias - near, level=level, method=method),
            Interval(low=self.bias + near, high=self.bias + far, level=level, method=method),
        )

    @property
    def proportional(self) -> ProportionalBias:
        """Regression of the differences on the means, of at least 3 targets whose means differ."""
        centred = self.means - self.means.mean()
        square = squares(centred, self.means)
        if self.targets < 3 or square == 0:
            raise InputError(
                f"means must be at least 3 and differ for a line over them; got {self.targets} from "
                f"{self.means.min():g} to {self.means.max():g}: add targets that differ"
            )
        slope = float(centred @ self.differences) / square
        left = self.differences - self.bias - slope * centred
        free = self.targets - 2
        return ProportionalBias(
            slope=slope,
            intercept=self.bias - slope * float(self.means.mean()),
            standard_error=math.sqrt(float(left @ left) / free / square),
            degrees_of_freedom=free,
        )

    def _spread(self) -> float:
        if squares(self.differences - self.bias, np.concatenate([self.means, self.differences])) == 0:
            raise InputError(
                f"differences must vary for an interval; got {self.targets} of {self.bias:g}: record more digits"
            )
        return self.standard_deviation


def bland_altman(first: ArrayLike, second: ArrayLike) -> BlandAltman:
    """Compare two methods of measurement on the same targets.

    Raises `InputError` when a reading is not finite, the lengths differ, or there is only one target.

    Parameters
    ----------
    first, second
        One reading of each target by either method, shape (targets,), at least 2, in one unit.

    Examples
    --------
    >>> found = bland_altman([8.1, 10.2, 12.4, 6.0], [8.0, 9.9, 12.5, 5.7])
    >>> round(found.bias, 3), [round(limit, 3) for limit in found.limits()]
    (0.15, [-0.225, 0.525])
    """
    a, b = readings("first", first, ndim=1), readings("second", second, ndim=1)
    same_length("first", a, "second", b)
    return BlandAltman(means=(a + b) / 2, differences=a - b)


def _normal(coverage: float) -> float:
    fraction = require_number("coverage", coverage, 1e-6, 1 - 1e-9, hint="a fraction of differences, such as 0.95")
    return float(scipy.special.ndtri(0.5 + fraction / 2))
