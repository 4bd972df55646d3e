"""Linearity of readings against reference targets, and the size of a study of repeatability."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.detection._inputs import LEVEL, Interval, checked_level, readings, same_length
from tsis.detection._repeatability import degrees_of_freedom, modified_large_samples, reproducibility_terms
from tsis.errors import InputError
from tsis.model import require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


FEWEST = 4  # targets: a parabola leaves one degree of freedom


@dataclass(frozen=True, slots=True, kw_only=True)
class Linearity:
    """Line of the readings over the true values of reference targets, each target once.

    Attributes
    ----------
    targets
        How many.
    slope, slope_sd
        Readings per true value, and its standard error; 1 is right.
    intercept, intercept_sd
        Reading at a true value of 0, and its standard error.
    r_squared
        Fraction of the variance of the readings that the line explains.
    scatter_sd
        Standard deviation of the readings about the line.
    curvature_p
        Two-sided p-value of a quadratic term beside the line; a small one means that the readings are not linear.
    """

    targets: int
    slope: float
    slope_sd: float
    intercept: float
    intercept_sd: float
    r_squared: float
    scatter_sd: float
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
    """Regress readings on the true values of reference targets.

    Parameters
    ----------
    measured
        One reading, or the mean of the repeats, of each target, shape (targets,), at least 4.
    true
        True values in the same unit, positive, at least 3 different ones.

    Raises
    ------
    InputError
        When a value is not finite, the lengths differ, or there are too few or too equal targets.

    Examples
    --------
    >>> line = linearity([4.1, 6.0, 8.2, 10.1, 12.0], [4.0, 6.0, 8.0, 10.0, 12.0])
    >>> round(line.slope, 3), [round(end, 3) for end in line.slope_interval()]
    (0.995, [0.947, 1.043])
    """
    y, x = readings("measured", measured, ndim=1), readings("true", true, ndim=1)
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
    """Coefficients, their standard errors, and the sum of squares that is left."""
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
    """A balanced study of repeatability that reaches a wanted width.

    Attributes
    ----------
    operators, repeats
        Of the design.
    phantoms
        The fewest that reach the width; None where no number up to 500 does, because operators are too few.
    upper_repeatability, upper_reproducibility
        Expected upper 95 % limit of each coefficient over its value, less 1; of 500 phantoms where None reach it.
    """

    operators: int
    repeats: int
    phantoms: int | None
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

    The limits are those of `Repeatability.interval` and `Reproducibility.interval` at the expected mean squares.

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
    level
        Confidence of the two-sided interval, in (0, 1).

    Raises
    ------
    InputError
        When a value lies outside its range.

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
    if not reaches(high):
        within, between = uppers(high)
        return PrecisionStudySize(
            operators=operators,
            repeats=repeats,
            phantoms=None,
            upper_repeatability=within,
            upper_reproducibility=between,
        )
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if reaches(middle) else (middle, high)
    within, between = uppers(high)
    return PrecisionStudySize(
        operators=operators, repeats=repeats, phantoms=high, upper_repeatability=within, upper_reproducibility=between
    )


def _upper_limits(
    shape: tuple[int, int, int], operator_sd: float, interaction_sd: float, level: float
) -> tuple[float, float]:
    """Upper limits of both coefficients over their values, less 1, where repeats have a standard deviation of 1."""
    n, _, r = shape
    *_, repeats = degrees_of_freedom(shape)
    within = math.sqrt(repeats / float(scipy.special.chdtri(repeats, 0.5 + level / 2))) - 1
    interaction = 1 + r * interaction_sd**2
    terms = reproducibility_terms(shape, (interaction + n * r * operator_sd**2, interaction, 1.0))
    _, high = modified_large_samples(terms, level)
    return within, high / math.sqrt(1 + operator_sd**2 + interaction_sd**2) - 1
