"""Lines of single loadings, and the figures that compare loadings at common forces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration._measured import MeasuredValue
from tsis.errors import CalibrationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.force._loading import Loading


CLIPPED_FRACTION = 1e-4  # of a patch's pixels; a press with more is saturated
GRID = 20  # forces at which loadings are compared
FEWEST = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadingRun:
    """A loading's usable presses and the least-squares line through them."""

    tip_mm: float  # radius of the tip
    force_n: NDArray[np.float64]  # minus the gauge's zero, shape (n,)
    total_grey: NDArray[np.float64]  # sums of grey levels, shape (n,)
    rising: NDArray[np.bool]  # True on the loading branch, shape (n,)
    intercept: float
    slope: float

    @property
    def residual_grey(self) -> NDArray[np.float64]:
        """Residuals of the line, grey levels, shape (n,)."""
        return np.asarray(self.total_grey - self.intercept - self.slope * self.force_n)

    def sums_at(self, force_n: NDArray[np.float64], *, rising: bool) -> NDArray[np.float64]:
        """Sums of one branch at other forces, linear between presses."""
        branch = self.rising == rising
        if rising is False:  # the largest force belongs to both branches
            branch = branch | (self.force_n == self.force_n.max())
        order = np.argsort(self.force_n[branch])
        return np.asarray(np.interp(force_n, self.force_n[branch][order], self.total_grey[branch][order]))

    @property
    def has_both_branches(self) -> bool:
        """Whether each branch has 2 presses or more."""
        return min(int(self.rising.sum()), int((~self.rising).sum())) >= 2


def usable_presses(loading: Loading) -> NDArray[np.bool]:
    """Presses whose light stands out of the noise and does not clip, shape (n,)."""
    return np.asarray(loading.touched & (loading.total_grey > 0) & (loading.clipped <= CLIPPED_FRACTION))


def fit_run(loading: Loading) -> LoadingRun:
    """Fit the line of one loading.

    Raises `CalibrationError` when too few presses are usable, or the sum does not rise with the force.
    """
    good = usable_presses(loading)
    if int(good.sum()) < FEWEST:
        raise CalibrationError(
            f"a loading must hold at least {FEWEST} presses that are seen and do not clip; that of the "
            f"{loading.tip_radius_mm:g} mm tip holds {int(good.sum())} (change the exposure)"
        )
    force, total = loading.load_n[good], loading.total_grey[good]
    if np.ptp(force) <= 0:
        raise CalibrationError("a loading must hold different forces; the gauge showed one (is it connected?)")
    slope, intercept = (float(number) for number in np.polyfit(force, total, 1))
    if slope <= 0:
        raise CalibrationError(
            f"the sum of grey levels must rise with the force; it falls by {-slope:.3g} grey levels a newton under the "
            f"{loading.tip_radius_mm:g} mm tip (are forces and frames in one order?)"
        )
    return LoadingRun(
        tip_mm=loading.tip_radius_mm,
        force_n=force,
        total_grey=total,
        rising=loading.rising[good],
        intercept=intercept,
        slope=slope,
    )


def common_forces(runs: Sequence[LoadingRun]) -> NDArray[np.float64]:
    """Forces that every run covers, shape (GRID,)."""
    low = max(float(run.force_n.min()) for run in runs)
    high = min(float(run.force_n.max()) for run in runs)
    return np.linspace(low, high, GRID)


def mean_value(values: NDArray[np.float64], *, unit: str = "") -> MeasuredValue:
    """Mean of independent values and its standard error; 2 values or more."""
    count = len(values)
    sd = float(np.std(values, ddof=1)) / float(np.sqrt(count))
    return MeasuredValue(value=float(np.mean(values)), sd=sd, degrees_of_freedom=count - 1.0, unit=unit)


def spread_value(variance: float, freedom: float, *, unit: str = "") -> MeasuredValue:
    """A standard deviation with its own uncertainty from its degrees of freedom."""
    freedom = max(freedom, 1.0)
    sd = float(np.sqrt(variance))
    return MeasuredValue(value=sd, sd=sd / float(np.sqrt(2 * freedom)), degrees_of_freedom=freedom, unit=unit)


COMPARED_N = 0.8  # the source compares its tips at this force
FALSE_ALARMS, MISSES = 0.05, 0.05
HYSTERESIS_POINT = 0.6  # of the largest force
FEWEST_UNTOUCHED = 3


def loading_linearity(runs: Sequence[LoadingRun]) -> MeasuredValue:
    """Largest departure of the mean curve from a straight line over the largest sum, signed.

    The selection of the largest departure biases it upwards; the interval is that of the selected force.
    """
    force = common_forces(runs)
    curves = []
    for run in runs:
        branches = [run.sums_at(force, rising=way) for way in ((True, False) if run.has_both_branches else (True,))]
        line = run.intercept + run.slope * force
        curves.append((np.mean(branches, axis=0) - line) / line[-1])
    departures = np.array(curves)
    return mean_value(departures[:, int(np.abs(departures.mean(axis=0)).argmax())])


def loading_hysteresis(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Loading minus unloading over the range, at 0.6 of the largest force; None with fewer than two loops.

    Each run's loop is smoothed to ``f (1 - f) (c0 + c1 f)``, f the force over the largest one. The shape is closed at
    both ends. A steady drift of the lamps has the same shape, so the scatter between runs includes the drift. Both
    terms have more than 95 % of their largest width at 0.6. A force selected from the data would follow the noise.
    """
    loops = [run for run in runs if run.has_both_branches]
    if len(loops) < 2:
        return None
    return mean_value(np.array([float((_basis(np.array([HYSTERESIS_POINT])) @ _loop(run))[0]) for run in loops]))


def _basis(fraction: NDArray[np.float64]) -> NDArray[np.float64]:
    closed = fraction * (1 - fraction)
    return np.stack([closed, closed * fraction], axis=1)


def _loop(run: LoadingRun) -> NDArray[np.float64]:
    largest = float(run.force_n.max())
    force = np.unique(np.round(run.force_n[~run.rising], 12))
    width = (run.sums_at(force, rising=True) - run.sums_at(force, rising=False)) / (run.intercept + run.slope * largest)
    coefficients, *_ = np.linalg.lstsq(_basis(force / largest), width, rcond=None)
    return np.asarray(coefficients)


def loading_repeatability(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Standard deviation of repeated sums at one tip and force over the range; None without repeats."""
    squares, freedom = 0.0, 0
    for tip in {run.tip_mm for run in runs}:
        repeats = [run for run in runs if run.tip_mm == tip and run.has_both_branches]
        if len(repeats) < 2:
            continue
        force = common_forces(repeats)
        for rising in (True, False):
            sums = np.array([run.sums_at(force, rising=rising) for run in repeats])
            squares += float(np.mean(np.var(sums, axis=0, ddof=1))) / float(sums.max() ** 2) * (len(repeats) - 1)
        freedom += len(repeats) - 1
    # Presses of one run have its drift in common, so a run counts once.
    return spread_value(squares / (2 * freedom), freedom) if freedom else None


def tip_difference(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Line of the widest tip over that of the second widest at 0.8 N, minus 1; None with one tip."""
    tips = sorted({run.tip_mm for run in runs})
    if len(tips) < 2:
        return None
    sums = {tip: [run.intercept + run.slope * COMPARED_N for run in runs if run.tip_mm == tip] for tip in tips}
    differences = [_branch_difference(run) for run in runs if run.has_both_branches]
    # Loading and unloading are two readings of one run; half their difference is the error of its mean.
    error = float(np.sqrt(np.mean(np.square(differences)))) if differences else 0.0
    wide, other = np.mean(sums[tips[-1]]), np.mean(sums[tips[-2]])
    sd = error * np.sqrt(1 / len(sums[tips[-1]]) + 1 / len(sums[tips[-2]]))
    freedom = max(1.0, float(len(differences)))
    return MeasuredValue(value=float(wide / other - 1), sd=float(sd), degrees_of_freedom=freedom)


def _branch_difference(run: LoadingRun) -> float:
    up, down = (float(run.sums_at(np.array([COMPARED_N]), rising=way)[0]) for way in (True, False))
    return (up - down) / (up + down)


def detectable_n(loadings: Sequence[Loading], slope_grey_per_n: float) -> MeasuredValue | None:
    """Smallest force that the sum over the whole frame detects, newtons; None without untouched frames.

    Currie's limit ``(z_a + z_b) s sqrt(1 + 1 / n)`` of n untouched sums with the standard deviation s.
    """
    untouched = np.concatenate([loading.field_grey[~loading.touched] for loading in loadings])
    count = len(untouched)
    if count < FEWEST_UNTOUCHED:
        return None
    quantiles = float(scipy.stats.norm.isf(FALSE_ALARMS) + scipy.stats.norm.isf(MISSES))
    levels = float(quantiles * np.sqrt(1 + 1 / count) / slope_grey_per_n)
    return spread_value(float(np.var(untouched, ddof=1)) * levels**2, count - 1.0, unit="N")
