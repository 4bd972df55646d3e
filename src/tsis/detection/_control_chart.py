"""Control charts of single values: Shewhart and EWMA limits from a baseline, and run lengths of the EWMA rule."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.detection._inputs import readings as checked_readings
from tsis.errors import InputError
from tsis.model import require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


LEAST_BASELINE = 8
WIDTH = 3.0  # of the Shewhart limits, standard deviations of a normal variable
EWMA_WEIGHT, EWMA_WIDTH = 0.2, 2.962  # 500 checks on average between false alarms (Lucas and Saccucci 1990)
NODES = 80


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControlChart:
    """A chart of single values in order of time; arrays have the shape (checks,).

    Attributes
    ----------
    values, baseline
        All values, and how many of the first set the limits.
    centre, sd
        Mean and standard deviation of the baseline.
    shewhart
        Half width of the limits of a new value: Student's prediction interval with the probability of three sd.
    ewma
        Exponentially weighted mean of the values after the baseline; the centre during it.
    ewma_half
        Half widths of its limits; NaN during the baseline.
    """

    values: NDArray[np.float64]
    baseline: int
    centre: float
    sd: float
    shewhart: float
    ewma: NDArray[np.float64]
    ewma_half: NDArray[np.float64]

    @property
    def beyond_shewhart(self) -> NDArray[np.bool_]:
        """Checks after the baseline with a value beyond the Shewhart limits."""
        late = np.arange(len(self.values)) >= self.baseline
        return late & (np.abs(self.values - self.centre) > self.shewhart)

    @property
    def beyond_ewma(self) -> NDArray[np.bool_]:
        """Checks after the baseline with a weighted mean beyond its limits."""
        with np.errstate(invalid="ignore"):
            return np.abs(self.ewma - self.centre) > self.ewma_half

    @property
    def first_warning(self) -> int | None:
        """Index of the first check that either rule marks; None without one."""
        marked = np.flatnonzero(self.beyond_shewhart | self.beyond_ewma)
        return int(marked[0]) if len(marked) else None


def control_chart(
    values: ArrayLike, *, baseline: int, weight: float = EWMA_WEIGHT, width: float = EWMA_WIDTH
) -> ControlChart:
    """Chart of single values; Student's t widens both limits for the error of ``sd``.

    After t checks the EWMA has the variance ``sd² (w / (2 - w) (1 - (1 - w)^(2t)) + (1 - (1 - w)^t)² / baseline)``; the
    second part is the centre's. Raises `InputError` for a value out of range, or equal values in the baseline.

    Parameters
    ----------
    values
        Finite, shape (checks,), in order of time, at least ``baseline``.
    baseline
        Checks that set the limits, in [8, 300].
    weight
        Of the newest value in the EWMA, in (0, 1].
    width
        Half width of the EWMA limits, standard deviations of a long baseline.

    Examples
    --------
    >>> steady = [10.0, 10.2, 9.9, 10.1, 9.8, 10.0, 10.1, 9.9]
    >>> control_chart([*steady, 10.1, 9.9, 10.7], baseline=8).first_warning
    10
    """
    taken = checked_readings("values", values, ndim=1)
    require_integer("baseline", baseline, LEAST_BASELINE, 300)
    require_number("weight", weight, 1e-3, 1.0)
    require_number("width", width, 0.5, 6.0)
    if len(taken) < baseline:
        raise InputError(f"values must be at least the {baseline} of the baseline; got {len(taken)}")
    first, late = taken[:baseline], taken[baseline:]
    centre, sd = float(first.mean()), float(first.std(ddof=1))
    if sd <= 1e-12 * abs(centre):
        raise InputError("values of the baseline must differ; got equal ones: record more digits")
    ewma, half = np.full(len(taken), centre), np.full(len(taken), np.nan)
    for index, value in enumerate(late, start=baseline):
        ewma[index] = (1 - weight) * ewma[index - 1] + weight * value
    fading = (1 - weight) ** np.arange(1, len(late) + 1)
    variance = weight / (2 - weight) * (1 - fading**2) + (1 - fading) ** 2 / baseline
    half[baseline:] = _student(width, baseline - 1) * sd * np.sqrt(variance)
    shewhart = _student(WIDTH, baseline - 1) * sd * math.sqrt(1 + 1 / baseline)
    return ControlChart(
        values=taken, baseline=baseline, centre=centre, sd=sd, shewhart=shewhart, ewma=ewma, ewma_half=half
    )


def _student(width: float, free: int) -> float:
    """The quantile of Student's t with the probability of ``width`` standard deviations of a normal variable."""
    return -float(scipy.special.stdtrit(free, scipy.special.ndtr(-width)))


def ewma_run_length(shift: float, *, weight: float = EWMA_WEIGHT, width: float = EWMA_WIDTH) -> float:
    """Mean number of checks to an EWMA alarm with steady limits and a known baseline (Crowder 1987).

    ``shift`` is that of the mean in standard deviations of a value, in [-6, 6].

    Examples
    --------
    >>> round(ewma_run_length(0.0)), round(ewma_run_length(1.0), 1)
    (500, 10.5)
    """
    require_number("shift", shift, -6.0, 6.0, hint="standard deviations")
    require_number("weight", weight, 0.01, 1.0)
    half = require_number("width", width, 0.5, 6.0) * math.sqrt(weight / (2 - weight))
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    at = half * nodes
    step = (at[None, :] - (1 - weight) * at[:, None]) / weight - shift
    kernel = half / weight * weights * np.exp(-(step**2) / 2) / math.sqrt(2 * math.pi)
    lengths = np.linalg.solve(np.eye(NODES) - kernel, np.ones(NODES))
    start = (at / weight) - shift
    return 1 + float(half / weight * (weights * np.exp(-(start**2) / 2)) @ lengths / math.sqrt(2 * math.pi))


def shewhart_run_length(shift: float, *, width: float = WIDTH) -> float:
    """Mean number of checks to a Shewhart alarm with a known baseline; ``shift`` as `ewma_run_length`."""
    require_number("shift", shift, -6.0, 6.0, hint="standard deviations")
    return 1 / float(scipy.special.ndtr(-width - shift) + scipy.special.ndtr(-width + shift))
