"""Agreement of raters and of methods of measurement on the same targets: intraclass correlation, Bland and Altman.

Both are our own: no library under a permissive licence has their intervals.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.require import require_number
from tsis.study.proportions import LEVEL, Interval, checked_level, checked_readings, choice, same_length

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


SMALLEST = 1e-70  # deviation whose fourth power does not underflow


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanSquares:
    """Mean squares of a table of ratings: between targets, between raters, of the residual of both, and within targets.

    Within a target, the scatter is that of raters and residual together.
    """

    targets: float
    raters: float
    residual: float
    within: float
    target_count: int
    rater_count: int

    @classmethod
    def of(cls, ratings: ArrayLike) -> MeanSquares:
        """Mean squares of a finite table of shape (targets, raters), at least 2 by 2; else `InputError`.

        Examples
        --------
        >>> MeanSquares.of([[1, 2], [3, 4]])
        MeanSquares(targets=4.0, raters=1.0, residual=0.0, within=0.5, target_count=2, rater_count=2)
        """
        table = checked_readings("ratings", ratings, ndim=2)
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
    """Sum of squared deviations of ``measured``; 0 within rounding."""
    rounding = max(8 * np.finfo(float).eps * float(np.abs(measured).max()), SMALLEST)
    return float((deviations**2).sum()) if np.abs(deviations).max() > rounding else 0.0


FORMS = ("ICC(1,1)", "ICC(2,1)", "ICC(3,1)", "ICC(1,k)", "ICC(2,k)", "ICC(3,k)")


@dataclass(frozen=True, slots=True, kw_only=True)
class IntraclassCorrelation:
    """One of the six forms of Shrout and Fleiss, Psychol. Bull. 86 (1979) 420."""

    #: ``"ICC(1,1)"``: each target has other raters. ``"ICC(2,1)"``: raters are a random sample; absolute agreement.
    #: ``"ICC(3,1)"``: raters are fixed; consistency. With ``k`` for the 1: of the mean of all raters.
    form: str
    value: float  #: at most 1; below 0 where targets differ less than expected by chance
    mean_squares: MeanSquares  #: mean squares of the table

    @property
    def f(self) -> float:
        """F of no difference between targets; infinite where raters do not scatter."""
        residual = self._residual
        return self.mean_squares.targets / residual if residual > 0 else float("inf")

    @property
    def degrees_of_freedom(self) -> tuple[int, int]:
        """Degrees of freedom of ``f``."""
        m = self.mean_squares
        n, k = m.target_count, m.rater_count
        return n - 1, n * (k - 1) if self._one_way else (n - 1) * (k - 1)

    @property
    def p(self) -> float:
        """p-value of ``f``."""
        return float(scipy.special.fdtrc(*self.degrees_of_freedom, self.f)) if np.isfinite(self.f) else 0.0

    def interval(self, level: float = LEVEL) -> Interval:
        """Interval from the F distribution; that of the forms 2 is approximate, after Satterthwaite.

        ``level`` is the confidence, in (0, 1). Raises `InputError` when it is not, when raters do not scatter, or when
        targets are alike.
        """
        tail = (1 - checked_level(level)) / 2
        if self._residual == 0:
            raise InputError(
                "ratings must scatter within targets for an interval; got raters who agree exactly: record more digits"
            )
        if self.f == 0:  # both ends would be the value, as if it were certain
            raise InputError(
                f"ratings must differ more between targets for an interval of {self.form}; got F = 0: rate more targets"
            )
        low, high = self._agreement(tail) if self.form.startswith("ICC(2") else self._by_f(tail)
        if self.form.endswith("k)"):
            low, high = self._of_mean(low), self._of_mean(high)
        return Interval(low=min(low, high), high=high, level=level, method="f")

    @property
    def _one_way(self) -> bool:
        return self.form.startswith("ICC(1")

    @property
    def _residual(self) -> float:
        return self.mean_squares.within if self._one_way else self.mean_squares.residual

    def _by_f(self, tail: float) -> tuple[float, float]:
        first, second = self.degrees_of_freedom
        ends = (
            self.f / scipy.special.fdtri(first, second, 1 - tail),
            self.f * scipy.special.fdtri(second, first, 1 - tail),
        )
        others = self.mean_squares.rater_count - 1
        low, high = ((end - 1) / (end + others) for end in ends)
        return float(low), float(high)

    def _agreement(self, tail: float) -> tuple[float, float]:
        m = self.mean_squares
        n, k = m.target_count, m.rater_count
        single = _value("ICC(2,1)", m)
        by_targets, by_raters = m.targets / m.residual, m.raters / m.residual
        part, rest = k * single * by_raters, n * (1 + (k - 1) * single) - k * single
        spread = (n - 1) * part**2 + rest**2
        freedom = (k - 1) * (n - 1) * (part + rest) ** 2 / spread if spread > 0 else 0.0
        # The edge of McGraw and Wong's formula (Psychol. Methods 1 (1996) 30, table 7): Satterthwaite's sum of mean
        # squares has positive weights, and so at least one degree of freedom, unless the correlation is below 0. There
        # the sum may vanish, with 0 or 0/0 degrees of freedom; its quantiles fall below 1, and the interval misses the
        # value. With less than one degree of freedom those of the residual are taken, as at a correlation of 0, the
        # least that a population has.
        if freedom < 1:
            freedom = (k - 1) * (n - 1)
        above, below = (
            float(scipy.special.fdtri(n - 1, freedom, 1 - tail)),
            float(scipy.special.fdtri(freedom, n - 1, 1 - tail)),
        )
        between = k * by_raters + k * n - k - n
        low = n * (by_targets - above) / (above * between + n * by_targets)
        high = n * (below * by_targets - 1) / (between + n * below * by_targets)
        return low, high

    def _of_mean(self, single: float) -> float:
        """Spearman-Brown formula from one rater to the mean of all; unbounded below -1 / (k - 1)."""
        k = self.mean_squares.rater_count
        left = 1 + (k - 1) * single
        return k * single / left if left > 0 else -math.inf


def intraclass_correlation(ratings: ArrayLike, form: str = "ICC(2,1)") -> IntraclassCorrelation:
    """Intraclass correlation of a finite table of ratings, shape (targets, raters), at least 2 by 2.

    A rater may be a repeat or an instrument; the ``form`` is that of `IntraclassCorrelation`. Raises `InputError` when
    the table is bad, the form unknown, or the ratings do not vary as it needs.

    Examples
    --------
    The example that Shrout and Fleiss print:

    >>> table = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]]
    >>> [round(intraclass_correlation(table, form).value, 2) for form in FORMS]
    [0.17, 0.29, 0.71, 0.44, 0.62, 0.91]
    >>> [round(end, 2) for end in intraclass_correlation(table).interval()]
    [0.02, 0.76]
    """
    choice("form", form, FORMS)
    mean_squares = MeanSquares.of(ratings)
    return IntraclassCorrelation(form=form, value=_value(form, mean_squares), mean_squares=mean_squares)


def _value(form: str, m: MeanSquares) -> float:
    n, k = m.target_count, m.rater_count
    raters = (m.raters - m.residual) / n
    above, below = {
        "ICC(1,1)": (m.targets - m.within, m.targets + (k - 1) * m.within),
        "ICC(2,1)": (m.targets - m.residual, m.targets + (k - 1) * m.residual + k * raters),
        "ICC(3,1)": (m.targets - m.residual, m.targets + (k - 1) * m.residual),
        "ICC(1,k)": (m.targets - m.within, m.targets),
        "ICC(2,k)": (m.targets - m.residual, m.targets + raters),
        "ICC(3,k)": (m.targets - m.residual, m.targets),
    }[form]
    if below <= 0:
        raise InputError(f"ratings must differ between targets for {form}; got targets alike: rate more that differ")
    return above / below


COVERAGE = 0.95  # fraction of differences between the limits of agreement


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalBias:
    """Line of the differences over the means of both methods.

    Unequal scatter of the methods also causes a slope, without a proportional bias.
    """

    #: slope, intercept: difference per unit of the mean, and at a mean of 0
    slope: float
    intercept: float
    standard_error: float  #: standard error of the slope
    degrees_of_freedom: int  #: degrees of freedom of the line, targets less 2

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
    """Differences of paired readings."""

    #: means, differences: mean, and first less second, of each target, shape (targets,), in the unit of the
    #: readings
    means: NDArray[np.float64]
    differences: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("means", "differences"):
            object.__setattr__(self, name, checked_readings(name, getattr(self, name), ndim=1))
        same_length("means", self.means, "differences", self.differences)
        if len(self.differences) < 2:
            raise InputError(
                f"differences must be at least 2 to have a spread; got {len(self.differences)}: add targets"
            )

    @property
    def targets(self) -> int:
        """Number of targets."""
        return len(self.differences)

    @property
    def bias(self) -> float:
        """Mean difference, in the unit of the readings."""
        return float(self.differences.mean())

    @property
    def standard_deviation(self) -> float:
        """Standard deviation of the differences."""
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
        """Interval of the lower and of the upper limit of agreement, each by itself, with the confidence ``level``.

        The method ``"exact"`` is from the noncentral t distribution, exact for normal differences (Carkeet, Optom. Vis.
        Sci. 92 (2015) e71); ``"approximate"`` is symmetric, of Bland and Altman (1999), too short outwards for few
        targets. Raises `InputError` when a fraction is not in (0, 1), the method is unknown, or all differences are
        equal.
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
    """Compare two methods of measurement by one reading of each target in one unit, shapes (targets,), at least 2.

    Raises `InputError` when a reading is not finite, the lengths differ, or there is only one target.

    Examples
    --------
    >>> found = bland_altman([8.1, 10.2, 12.4, 6.0], [8.0, 9.9, 12.5, 5.7])
    >>> round(found.bias, 3), [round(limit, 3) for limit in found.limits()]
    (0.15, [-0.225, 0.525])
    """
    a, b = checked_readings("first", first, ndim=1), checked_readings("second", second, ndim=1)
    same_length("first", a, "second", b)
    return BlandAltman(means=(a + b) / 2, differences=a - b)


def _normal(coverage: float) -> float:
    fraction = require_number("coverage", coverage, 1e-6, 1 - 1e-9, hint="a fraction of differences, such as 0.95")
    return float(scipy.special.ndtri(0.5 + fraction / 2))
