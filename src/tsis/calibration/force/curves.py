"""Loadings brought to common forces, and the lines of single runs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.measured import MeasuredValue
from tsis.model.errors import CalibrationError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.force.loading import Loading

CLIPPED_SHARE = 1e-4  # of a patch's pixels; above it a press is saturated
GRID = 20  # forces at which loadings are compared
FEWEST = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoadingRun:
    """A loading's usable presses and the least-squares line through them.

    Attributes
    ----------
    tip_mm
        Radius of the tip.
    force_n, total_grey
        Forces less the gauge's zero, and sums of grey levels, shape (n,).
    rising
        True where the force was reached from below, shape (n,).
    intercept, slope
        Of the line.
    """

    tip_mm: float
    force_n: NDArray[np.float64]
    total_grey: NDArray[np.float64]
    rising: NDArray[np.bool]
    intercept: float
    slope: float

    @property
    def left(self) -> NDArray[np.float64]:
        """Departures from the line, grey levels, shape (n,)."""
        return np.asarray(self.total_grey - self.intercept - self.slope * self.force_n)

    def at(self, force_n: NDArray[np.float64], *, rising: bool) -> NDArray[np.float64]:
        """Sums of one branch at other forces, linear between presses."""
        branch = self.rising == rising
        if rising is False:  # the turn belongs to both
            branch = branch | (self.force_n == self.force_n.max())
        order = np.argsort(self.force_n[branch])
        return np.asarray(np.interp(force_n, self.force_n[branch][order], self.total_grey[branch][order]))

    @property
    def has_both_branches(self) -> bool:
        """Whether it was loaded and unloaded by two presses or more."""
        return min(int(self.rising.sum()), int((~self.rising).sum())) >= 2


def usable(loading: Loading) -> NDArray[np.bool]:
    """Presses whose light stands out of the noise and does not clip, shape (n,)."""
    return np.asarray(loading.touched & (loading.total_grey > 0) & (loading.clipped <= CLIPPED_SHARE))


def run_of(loading: Loading) -> LoadingRun:
    """The line of one loading.

    Raises
    ------
    CalibrationError
        When too few presses are usable, or the sum does not rise with the force.
    """
    good = usable(loading)
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


def mean_of(values: NDArray[np.float64], *, unit: str = "") -> MeasuredValue:
    """Mean of independent values and its standard error; 2 values or more."""
    count = len(values)
    sd = float(np.std(values, ddof=1)) / float(np.sqrt(count))
    return MeasuredValue(value=float(np.mean(values)), sd=sd, degrees_of_freedom=count - 1.0, unit=unit)


def spread_of(variance: float, freedom: float, *, unit: str = "") -> MeasuredValue:
    """A standard deviation that rests on so many degrees of freedom, with its own uncertainty."""
    freedom = max(freedom, 1.0)
    sd = float(np.sqrt(variance))
    return MeasuredValue(value=sd, sd=sd / float(np.sqrt(2 * freedom)), degrees_of_freedom=freedom, unit=unit)
