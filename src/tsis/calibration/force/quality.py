"""How straight, how repeatable and how free of memory the sums of grey levels are."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration.force.curves import common_forces, mean_of, spread_of
from tsis.calibration.measured import MeasuredValue

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.force.curves import LoadingRun
    from tsis.calibration.force.loading import Loading

COMPARED_N = 0.8  # where the source compares its tips
FALSE_ALARMS, MISSES = 0.05, 0.05
WIDEST = 0.6  # of the largest force
FEWEST_UNTOUCHED = 3


def loading_linearity(runs: Sequence[LoadingRun]) -> MeasuredValue:
    """Largest departure of the mean curve from a straight line over the largest sum, signed.

    The place is picked for being largest, so noise makes it larger; the interval is that of the picked place.
    """
    force = common_forces(runs)
    curves = []
    for run in runs:
        branches = [run.at(force, rising=way) for way in ((True, False) if run.has_both_branches else (True,))]
        line = run.intercept + run.slope * force
        curves.append((np.mean(branches, axis=0) - line) / line[-1])
    found = np.array(curves)
    return mean_of(found[:, int(np.abs(found.mean(axis=0)).argmax())])


def loading_hysteresis(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Loading less unloading over the range, at 0.6 of the largest force; None with fewer than two loops.

    Each run's loop is smoothed to ``f (1 - f) (c0 + c1 f)``, f the force over the largest one, which is closed at both
    ends and which a steady drift of the lamps makes too; the scatter between runs then holds what drift left. Both
    shapes have more than 95 % of their largest width there; a place picked from the data would be picked for its noise.
    """
    loops = [run for run in runs if run.has_both_branches]
    if len(loops) < 2:
        return None
    return mean_of(np.array([float((_basis(np.array([WIDEST])) @ _loop(run))[0]) for run in loops]))


def _basis(share: NDArray[np.float64]) -> NDArray[np.float64]:
    closed = share * (1 - share)
    return np.stack([closed, closed * share], axis=1)


def _loop(run: LoadingRun) -> NDArray[np.float64]:
    largest = float(run.force_n.max())
    force = np.unique(np.round(run.force_n[~run.rising], 12))
    width = (run.at(force, rising=True) - run.at(force, rising=False)) / (run.intercept + run.slope * largest)
    found, *_ = np.linalg.lstsq(_basis(force / largest), width, rcond=None)
    return np.asarray(found)


def loading_repeatability(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Standard deviation of sums of one tip and force in repeated loadings over the range; None without repeats."""
    squares, freedom = 0.0, 0
    for tip in {run.tip_mm for run in runs}:
        repeats = [run for run in runs if run.tip_mm == tip and run.has_both_branches]
        if len(repeats) < 2:
            continue
        force = common_forces(repeats)
        for rising in (True, False):
            sums = np.array([run.at(force, rising=rising) for run in repeats])
            squares += float(np.mean(np.var(sums, axis=0, ddof=1))) / float(sums.max() ** 2) * (len(repeats) - 1)
        freedom += len(repeats) - 1
    # Presses of one run share its drift, so a run counts once.
    return spread_of(squares / (2 * freedom), freedom) if freedom else None


def tip_difference(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Line of the widest tip over that of the second widest at 0.8 N, less one; None with one tip."""
    tips = sorted({run.tip_mm for run in runs})
    if len(tips) < 2:
        return None
    sums = {tip: [run.intercept + run.slope * COMPARED_N for run in runs if run.tip_mm == tip] for tip in tips}
    legs = [_legs(run) for run in runs if run.has_both_branches]
    # Loading and unloading are two readings of one run; half their difference is the error of its mean.
    error = float(np.sqrt(np.mean(np.square(legs)))) if legs else 0.0
    wide, other = np.mean(sums[tips[-1]]), np.mean(sums[tips[-2]])
    sd = error * np.sqrt(1 / len(sums[tips[-1]]) + 1 / len(sums[tips[-2]]))
    return MeasuredValue(value=float(wide / other - 1), sd=float(sd), degrees_of_freedom=max(1.0, float(len(legs))))


def _legs(run: LoadingRun) -> float:
    up, down = (float(run.at(np.array([COMPARED_N]), rising=way)[0]) for way in (True, False))
    return (up - down) / (up + down)


def detectable_n(loadings: Sequence[Loading], slope_grey_per_n: float) -> MeasuredValue | None:
    """Smallest force that the sum over the whole frame tells from no contact, newtons; None without untouched frames.

    Currie's limit ``(z_a + z_b) s sqrt(1 + 1 / n)`` of n untouched sums with the standard deviation s.
    """
    untouched = np.concatenate([loading.field_grey[~loading.touched] for loading in loadings])
    count = len(untouched)
    if count < FEWEST_UNTOUCHED:
        return None
    levels = (
        float(scipy.stats.norm.isf(FALSE_ALARMS) + scipy.stats.norm.isf(MISSES))
        * np.sqrt(1 + 1 / count)
        / slope_grey_per_n
    )
    return spread_of(float(np.var(untouched, ddof=1)) * float(levels) ** 2, count - 1.0, unit="N")
