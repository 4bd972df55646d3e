"""Repeatability, reproducibility and linearity of readings.

The analyses of variance are our own, with the exact and the modified intervals that statsmodels lacks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.require import require_integer, require_number
from tsis.study.agreement import squares
from tsis.study.proportions import LEVEL, Interval, checked_level, checked_readings, same_length

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike


REPEATABILITY_SD = math.sqrt(2) * 1.959963984540054  # standard deviations that 95 % of differences do not exceed
COCHRAN_LEVEL = 0.05  # ISO 5725-2 calls a variance beyond it a straggler


def _chi_square_interval(coefficient: float, degrees_of_freedom: int, level: float) -> Interval:
    """Interval of a repeatability coefficient, exact for normal readings."""
    tail = (1 - checked_level(level)) / 2
    if coefficient == 0:
        raise InputError("readings must differ between repeats for an interval; got equal ones: record more digits")
    low, high = (
        coefficient * math.sqrt(degrees_of_freedom / float(scipy.special.chdtri(degrees_of_freedom, at)))
        for at in (tail, 1 - tail)
    )
    return Interval(low=low, high=high, level=level, method="chi-square")


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeatability:
    """Scatter of readings within and between targets, in the unit of the readings."""

    within_sd: float  #: standard deviation of readings of one target
    between_sd: float  #: standard deviation of the true values of targets; 0 where ``between_truncated``
    between_truncated: bool  #: whether the estimated variance between targets was negative, and was set to 0
    degrees_of_freedom: int  #: of ``within_sd``: readings less targets
    mean: float  #: of all readings
    #: root mean square of the coefficients of variation of single targets (QIBA's wCV), weighted by their degrees of
    #: freedom; None where the mean of a repeated target is not positive
    within_cv: float | None
    #: Cochran's C: the largest variance of a target over the sum of all; None where targets differ in their numbers of
    #: readings, or repeats never differ
    largest_variance_fraction: float | None
    cochran_limit: float | None  #: value that C exceeds by chance in 5 of 100 studies (ISO 5725-2); None where C is

    @property
    def coefficient(self) -> float:
        """Repeatability coefficient: two readings of a target differ by less with a probability of 95 %; 2.77 sd."""
        return REPEATABILITY_SD * self.within_sd

    def interval(self, level: float = LEVEL) -> Interval:
        """Interval of the repeatability coefficient, exact for normal readings.

        ``level`` is the confidence, in (0, 1). Raises `InputError` when it is not, or when repeats never differ.
        """
        return _chi_square_interval(self.coefficient, self.degrees_of_freedom, level)


def repeatability(readings: Sequence[ArrayLike]) -> Repeatability:
    """Repeatability from repeats on several targets, by the one-way analysis of variance.

    ``readings`` has one row of finite readings for each of at least 2 targets; rows may differ in length, and one has
    at least 2. Other rows raise `InputError`.

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
    repeated = [row for row in rows if len(row) > 1]
    variances = np.array([row.var(ddof=1) for row in repeated])
    relative = [row.var(ddof=1) / row.mean() ** 2 * (len(row) - 1) for row in repeated if row.mean() > 0]
    equal = sizes.min() == sizes.max() and within > 0
    return Repeatability(
        within_sd=math.sqrt(within),
        between_sd=math.sqrt(max(variance, 0.0)),
        between_truncated=variance < 0,
        degrees_of_freedom=free,
        mean=mean,
        within_cv=math.sqrt(sum(relative) / free) if len(relative) == len(repeated) else None,
        largest_variance_fraction=float(variances.max() / variances.sum()) if equal else None,
        cochran_limit=_cochran_limit(len(rows), int(sizes[0])) if equal else None,
    )


def _cochran_limit(targets: int, repeats: int) -> float:
    """Critical value of Cochran's C at 5 %, from the F distribution."""
    ratio = float(scipy.special.fdtri(repeats - 1, (targets - 1) * (repeats - 1), 1 - COCHRAN_LEVEL / targets))
    return ratio / (ratio + targets - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproducibility:
    """Scatter of a balanced study of targets, operators and repeats, in the unit of the readings."""

    #: target_sd, operator_sd, interaction_sd, repeat_sd: standard deviations of targets, of operators,
    #: of their interaction, and of repeats
    target_sd: float
    operator_sd: float
    interaction_sd: float
    repeat_sd: float
    #: names of the first three that were set to 0, because their estimated variance was negative
    truncated: tuple[str, ...]
    mean_squares: tuple[float, float, float, float]  #: of targets, operators, interaction and repeats
    degrees_of_freedom: tuple[int, int, int, int]  #: of the same
    shape: tuple[int, int, int]  #: targets, operators, repeats

    @property
    def repeatability_coefficient(self) -> float:
        """Two readings of a target by one operator differ by less with a probability of 95 %."""
        return REPEATABILITY_SD * self.repeat_sd

    @property
    def sd(self) -> float:
        """Reproducibility standard deviation, s_R of ISO 5725: of a reading of a given target by any operator."""
        return self.coefficient / REPEATABILITY_SD

    @property
    def coefficient(self) -> float:
        """Two readings of a target by two operators differ by less with a probability of 95 %.

        From the sum of the three estimated variances, before any is set to 0; it cannot be negative.
        """
        return REPEATABILITY_SD * math.sqrt(sum(weight * square for weight, square, _ in self._terms()))

    def repeatability_interval(self, level: float = LEVEL) -> Interval:
        """Interval of the repeatability coefficient; see `Repeatability.interval`."""
        return _chi_square_interval(self.repeatability_coefficient, self.degrees_of_freedom[3], level)

    def interval(self, level: float = LEVEL) -> Interval:
        """Interval of the coefficient between operators, by Graybill and Wang's modified large samples.

        With two or three operators its upper end is large. ``level`` is the confidence, in (0, 1). Raises `InputError`
        when it is not, or when repeats never differ.
        """
        if self.repeat_sd == 0:
            raise InputError("readings must differ between repeats for an interval; got equal ones: record more digits")
        low, high = _modified_large_samples(self._terms(), checked_level(level))
        return Interval(
            low=REPEATABILITY_SD * low, high=REPEATABILITY_SD * high, level=level, method="modified large samples"
        )

    def _terms(self) -> tuple[tuple[float, float, int], ...]:
        """Weight, mean square and degrees of freedom of the components of a reading on a given target."""
        return _reproducibility_terms(self.shape, self.mean_squares[1:])


def degrees_of_freedom(shape: tuple[int, int, int]) -> tuple[int, int, int, int]:
    """Degrees of freedom of targets, operators, interaction and repeats in a balanced study of that shape."""
    n, k, r = shape
    return n - 1, k - 1, (n - 1) * (k - 1), n * k * (r - 1)


def _reproducibility_terms(
    shape: tuple[int, int, int], mean_squares: Sequence[float]
) -> tuple[tuple[float, float, int], ...]:
    """Weight, mean square and degrees of freedom of operators, interaction and repeats in the variance of a reading."""
    targets, _, repeats = shape
    weights = (1 / (targets * repeats), (targets - 1) / (targets * repeats), (repeats - 1) / repeats)
    return tuple(zip(weights, mean_squares, degrees_of_freedom(shape)[1:], strict=True))


def _modified_large_samples(terms: Sequence[tuple[float, float, int]], level: float) -> tuple[float, float]:
    """Graybill and Wang's interval of the root of a sum of weighted mean squares, as (low, high)."""
    tail = (1 - level) / 2
    middle = sum(weight * square for weight, square, _ in terms)
    below = above = 0.0
    for weight, square, free in terms:
        below += ((1 - free / float(scipy.special.chdtri(free, tail))) * weight * square) ** 2
        above += ((free / float(scipy.special.chdtri(free, 1 - tail)) - 1) * weight * square) ** 2
    return math.sqrt(max(middle - math.sqrt(below), 0.0)), math.sqrt(middle + math.sqrt(above))


def reproducibility(readings: ArrayLike) -> Reproducibility:
    """Reproducibility from a balanced study, by the two-way analysis of variance with interaction, all random.

    ``readings`` is finite, of shape (targets, operators, repeats), at least 2 of each; else `InputError` is raised.

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
    free = degrees_of_freedom((n, k, r))
    squared = (
        k * r * squares(rows, table) / free[0],
        n * r * squares(columns, table) / free[1],
        r * squares(cells - rows[:, None] - columns, table) / free[2],
        squares(centred - cells[:, :, None], table) / free[3],
    )
    variances = {
        "target": (squared[0] - squared[2]) / (k * r),
        "operator": (squared[1] - squared[2]) / (n * r),
        "interaction": (squared[2] - squared[3]) / r,
    }
    cut = {name: math.sqrt(max(variance, 0.0)) for name, variance in variances.items()}
    return Reproducibility(
        target_sd=cut["target"],
        operator_sd=cut["operator"],
        interaction_sd=cut["interaction"],
        repeat_sd=math.sqrt(squared[3]),
        truncated=tuple(name for name, variance in variances.items() if variance < 0),
        mean_squares=squared,
        degrees_of_freedom=free,
        shape=(n, k, r),
    )


FEWEST = 4  # targets: a parabola leaves one degree of freedom


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearity:
    """Line of the readings over the true values of reference targets, each target once."""

    targets: int  #: how many
    #: slope, slope_sd: readings per true value, and its standard error; 1 is right
    slope: float
    slope_sd: float
    #: intercept, intercept_sd: reading at a true value of 0, and its standard error
    intercept: float
    intercept_sd: float
    r_squared: float  #: fraction of the variance of the readings that the line explains
    scatter_sd: float  #: standard deviation of the readings about the line
    #: two-sided p-value of a quadratic term beside the line; a small one means that the readings are not linear
    curvature_p: float

    def slope_interval(self, level: float = LEVEL) -> Interval:
        """Student's interval of the slope; ``level`` in (0, 1), else `InputError`."""
        return self._interval(self.slope, self.slope_sd, level)

    def intercept_interval(self, level: float = LEVEL) -> Interval:
        """Student's interval of the intercept; ``level`` in (0, 1), else `InputError`."""
        return self._interval(self.intercept, self.intercept_sd, level)

    def _interval(self, value: float, sd: float, level: float) -> Interval:
        half = float(scipy.special.stdtrit(self.targets - 2, 0.5 + checked_level(level) / 2)) * sd
        return Interval(low=value - half, high=value + half, level=level, method="t")


def linearity(measured: ArrayLike, true: ArrayLike) -> Linearity:
    """Regress readings, or means of repeats, on the ``true`` values of at least 4 reference targets, shapes (targets,).

    Both have one unit; the true values are positive, at least 3 of them different. Raises `InputError` when a value is
    not finite, the lengths differ, or there are too few or too equal targets.

    Examples
    --------
    >>> line = linearity([4.1, 6.0, 8.2, 10.1, 12.0], [4.0, 6.0, 8.0, 10.0, 12.0])
    >>> round(line.slope, 3), [round(end, 3) for end in line.slope_interval()]
    (0.995, [0.947, 1.043])
    """
    y, x = checked_readings("measured", measured, ndim=1), checked_readings("true", true, ndim=1)
    same_length("measured", y, "true", x)
    if len(x) < FEWEST or len(np.unique(x)) < 3 or (x <= 0).any():
        raise InputError(
            f"true must hold at least {FEWEST} positive values, 3 of them different, for a line; got {len(x)} from "
            f"{x.min():g} to {x.max():g}: add reference targets"
        )
    coefficients, errors, left = _least_squares(np.column_stack([np.ones_like(x), x]), y)
    centred = (x - x.mean()) / np.ptp(x)  # keeps the parabola well conditioned
    curved, curved_errors, _ = _least_squares(np.column_stack([np.ones_like(x), centred, centred**2]), y)
    total = float(((y - y.mean()) ** 2).sum())
    return Linearity(
        targets=len(x),
        slope=coefficients[1],
        slope_sd=errors[1],
        intercept=coefficients[0],
        intercept_sd=errors[0],
        r_squared=1 - left / total if total > 0 else 0.0,
        scatter_sd=math.sqrt(left / (len(x) - 2)),
        curvature_p=_two_sided(curved[2], curved_errors[2], len(x) - 3),
    )


def _least_squares(design: np.ndarray, y: np.ndarray) -> tuple[list[float], list[float], float]:
    """Coefficients, their standard errors, and the sum of squares that is left; statsmodels gives the same digits."""
    fitted = np.linalg.lstsq(design, y, rcond=None)[0]
    left = float(((y - design @ fitted) ** 2).sum())
    covariance = np.linalg.inv(design.T @ design) * left / (len(y) - design.shape[1])
    return fitted.tolist(), np.sqrt(np.diag(covariance)).tolist(), left


def _two_sided(value: float, sd: float, free: int) -> float:
    if sd == 0:
        return 1.0 if value == 0 else 0.0
    return float(2 * scipy.special.stdtr(free, -abs(value) / sd))


MOST_PHANTOMS = 500


@dataclass(frozen=True, slots=True, kw_only=True)
class PrecisionStudySize:
    """A balanced study of repeatability that reaches a wanted width."""

    #: operators, repeats: of the design
    operators: int
    repeats: int
    #: the fewest that reach the width; None where no number up to 500 does, because operators are too few
    phantoms: int | None
    #: upper_repeatability, upper_reproducibility: expected upper 95 % limit of each coefficient over its value,
    #: less 1; of 500 phantoms where None reach it
    upper_repeatability: float
    upper_reproducibility: float

    @property
    def presses(self) -> int | None:
        """Presses of the whole study."""
        return None if self.phantoms is None else self.phantoms * self.operators * self.repeats


def study_size(
    width: float,
    *,
    operators: int,
    repeats: int,
    operator_sd: float = 0.0,
    interaction_sd: float = 0.0,
    reproducibility_too: bool = False,
    level: float = LEVEL,
) -> PrecisionStudySize:
    """The fewest phantoms for which the upper limit of a coefficient exceeds it by less than the fraction ``width``.

    The limits are those of `Repeatability.interval` and `Reproducibility.interval` at the expected mean squares, two-
    sided with the confidence ``level``. Raises `InputError` when a value lies outside its range.

    Parameters
    ----------
    width
        Wanted excess of the upper limit, in [0.01, 10].
    operators, repeats
        Of the design, at least 2 each.
    operator_sd, interaction_sd
        Expected standard deviations over that of repeats, in [0, 100].
    reproducibility_too
        Whether the coefficient between operators must reach the width as well.

    Examples
    --------
    >>> size = study_size(0.2, operators=2, repeats=3)
    >>> size.phantoms, size.presses, round(size.upper_repeatability, 3)
    (18, 108, 0.195)
    """
    require_number("width", width, 0.01, 10.0, hint="a fraction, such as 0.2")
    require_integer("operators", operators, 2, 1000)
    require_integer("repeats", repeats, 2, 1000)
    ratios = [
        require_number(name, value, 0.0, 100.0)
        for name, value in (("operator_sd", operator_sd), ("interaction_sd", interaction_sd))
    ]
    checked_level(level)

    def uppers(phantoms: int) -> tuple[float, float]:
        return _upper_limits((phantoms, operators, repeats), ratios[0], ratios[1], level)

    def reaches(phantoms: int) -> bool:
        within, between = uppers(phantoms)
        return within <= width and (between <= width or not reproducibility_too)

    low, high = 1, MOST_PHANTOMS
    enough = reaches(high)
    while enough and high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reaches(middle) else (middle, high)
    within, between = uppers(high)
    return PrecisionStudySize(
        operators=operators,
        repeats=repeats,
        phantoms=high if enough else None,
        upper_repeatability=within,
        upper_reproducibility=between,
    )


def _upper_limits(
    shape: tuple[int, int, int], operator_sd: float, interaction_sd: float, level: float
) -> tuple[float, float]:
    """Upper limits of both coefficients over their values, less 1, where repeats have a standard deviation of 1."""
    n, _, r = shape
    *_, repeats = degrees_of_freedom(shape)
    within = math.sqrt(repeats / float(scipy.special.chdtri(repeats, 0.5 + level / 2))) - 1
    interaction = 1 + r * interaction_sd**2
    terms = _reproducibility_terms(shape, (interaction + n * r * operator_sd**2, interaction, 1.0))
    _, high = _modified_large_samples(terms, level)
    return within, high / math.sqrt(1 + operator_sd**2 + interaction_sd**2) - 1
