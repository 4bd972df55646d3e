"""The straight line of the sum of grey levels against force, and its diagnostics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.force._frame import PATCH_METHODS
from tsis.errors import InputError
from tsis.model.budget import QuantityBudget, UncertaintyComponent
from tsis.model.require import require_integer, require_number, require_one_of, require_type

UPPER = 0.975  # quantile at the upper end of a 95 % interval
LARGEST_LOG = 14.0  # of degrees of freedom: a million is as good as infinity
LARGEST_GAUGE_N = 50.0  # range of the source's gauge; larger numbers are in another unit


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceLine:
    """``sum = intercept + slope * F`` with F in newtons, the source's (5.4), with the variances of a new force.

    Raises `InputError` when a value lies outside its range, or the line exceeds the largest possible sum within its
    range of force: then forces were not in newtons.

    Parameters
    ----------
    intercept_grey, slope_grey_per_n
        The mean line of the loaded units, under the light of the untouched reference. The slope's standard deviation
        includes that of the force gauge.
    unit_covariance
        Covariance of the lines of single units (tips; repeats where one tip was used): variance of the intercept
        (grey²), covariance (grey²/N), variance of the slope (grey²/N²).
    units
        Number of units, 2 or more.
    assumed_tip_share
        Relative standard deviation between tips, assumed when one tip was used; 0 when it was measured.
    residual_grey, residual_share
        Scatter of a single press about the line of its unit: a standard deviation in grey levels, and a fraction of
        the sum, which add in squares; both include hysteresis and departures from a straight line.
    drift_share
        Relative standard deviation of the lamps between the reference and a new frame, after their correction.
    gauge_share
        Relative standard deviation of the force gauge's own calibration.
    least_n, most_n
        Range of force, newtons: detectable, and without saturation.
    pixels, full_scale
        Size of the frame and its clipping level, which limit the sum.
    tips_mm
        Radii of the tips, one or more, each in [0.1, 1000] mm.
    method
        Segmentation method of the bright patch, ``"threshold"`` or ``"canny"``.
    soft_ratio
        Force that the line gives for soft flat pads, over their true force: their dents change the light otherwise than
        those of tips. None where no pad was pressed.

    Examples
    --------
    >>> def exact(value, unit):
    ...     return MeasuredValue(value=value, sd=0.0, unit=unit)
    >>> line = ForceLine(intercept_grey=exact(0.056e6, "grey"), slope_grey_per_n=exact(1.4778e6, "grey/N"), units=3,
    ...     unit_covariance=(0.0, 0.0, 0.0), residual_grey=exact(500.0, "grey"), residual_share=exact(0.0, ""),
    ...     least_n=0.1, most_n=2.0, pixels=768 * 492, full_scale=255.0, tips_mm=(2.0,))
    >>> force = line.force_n(0.056e6 + 1.4778e6)
    >>> f"{force.value:.3f} N, sd {1000 * force.sd:.2f} mN"
    '1.000 N, sd 0.34 mN'
    """

    intercept_grey: MeasuredValue
    slope_grey_per_n: MeasuredValue
    unit_covariance: tuple[float, float, float]
    units: int
    residual_grey: MeasuredValue
    residual_share: MeasuredValue
    least_n: float
    most_n: float
    pixels: int
    full_scale: float
    tips_mm: tuple[float, ...]
    assumed_tip_share: float = 0.0
    drift_share: float = 0.0
    gauge_share: float = 0.0
    method: str = "threshold"
    soft_ratio: MeasuredValue | None = None

    def __post_init__(self) -> None:
        if self.soft_ratio is not None:
            require_type("soft_ratio", self.soft_ratio, MeasuredValue)
            require_number("soft_ratio", self.soft_ratio.value, 0.01, 100.0, hint="a ratio of forces")
        for name in ("intercept_grey", "slope_grey_per_n", "residual_grey", "residual_share"):
            require_type(name, getattr(self, name), MeasuredValue)
        require_number("slope_grey_per_n", self.slope_grey_per_n.value, 1e-9, 1e15, hint="grey levels a newton")
        for value, least in zip(self.unit_covariance, (0.0, -1e30, 0.0), strict=True):
            require_number("unit_covariance", value, least, 1e30, hint="variance, covariance, variance")
        require_integer("units", self.units, 2, 10_000)
        for name in ("assumed_tip_share", "drift_share", "gauge_share"):
            require_number(name, getattr(self, name), 0.0, 1.0, hint="a fraction of 1")
        require_number("most_n", self.most_n, 0.0, LARGEST_GAUGE_N, hint="newtons")
        require_number("least_n", self.least_n, 0.0, self.most_n, hint="newtons, at most most_n")
        require_integer("pixels", self.pixels, 1, 2**40)
        require_number("full_scale", self.full_scale, 1.0, 65535.0)
        if not self.tips_mm:
            raise InputError("tips_mm must hold the radius of at least one tip; got none")
        for tip in self.tips_mm:
            require_number("tips_mm", tip, 0.1, 1000.0, hint="millimetres")
        require_one_of("segmentation method", self.method, PATCH_METHODS)
        largest = self.intercept_grey.value + self.slope_grey_per_n.value * self.most_n
        if largest > self.largest_grey:
            raise InputError(
                f"the line must stay within the largest possible sum, {self.largest_grey:.3g} grey levels; it reaches "
                f"{largest:.3g} at most_n = {self.most_n:g}, {largest / self.largest_grey:.0f} times as much "
                "(give forces in newtons, not millinewtons)"
            )

    @property
    def largest_grey(self) -> float:
        """Sum of a frame at full scale everywhere."""
        return self.pixels * self.full_scale

    def force_n(self, total_grey: float) -> MeasuredValue:
        """The force of a new frame in newtons, of an object other than the tips.

        Raises `InputError` when the force lies outside the valid range.

        Parameters
        ----------
        total_grey
            Sum of grey levels above no contact of the bright patch, segmented with ``method``.

        Returns
        -------
        MeasuredValue
            Force with its prediction uncertainty: line, new object, single press, lamps and gauge.
        """
        total = require_number("total_grey", total_grey, -1e15, 1e15)
        force = (total - self.intercept_grey.value) / self.slope_grey_per_n.value
        if not self.least_n <= force <= self.most_n:
            raise InputError(
                f"total_grey must belong to a force within [{self.least_n:.3g}, {self.most_n:.3g}] N, for which the "
                f"line was calibrated; got {total:.4g}, which would be {force:.3g} N (press within the range)"
            )
        return self.with_uncertainty(force)

    def soft_force_n(self, total_grey: float) -> MeasuredValue:
        """The force of a new frame of soft tissue; parameters and errors as `force_n`.

        Where pads were pressed, their ratio corrects the line of the tips.
        """
        by_tips, ratio = self.force_n(total_grey), self.soft_ratio
        if ratio is None:
            return by_tips
        force = by_tips.value / ratio.value
        parts = (
            (by_tips.sd / ratio.value, by_tips.degrees_of_freedom),
            (force * ratio.sd / ratio.value, ratio.degrees_of_freedom),
        )
        variance, freedom = combine_variances(tuple((sd**2, of) for sd, of in parts))
        return MeasuredValue(value=force, sd=float(np.sqrt(variance)), degrees_of_freedom=freedom, unit="N")

    def with_uncertainty(self, force_n: float) -> MeasuredValue:
        """A force in newtons with the prediction uncertainty of one new frame."""
        budget = self.budget(force_n)
        return MeasuredValue(value=force_n, sd=budget.combined, degrees_of_freedom=budget.degrees_of_freedom, unit="N")

    def budget(self, force_n: float) -> QuantityBudget:
        """The uncertainty budget of a force in newtons that the line gives for one new frame."""
        slope = self.slope_grey_per_n.value
        a, ab, b = self.unit_covariance
        units = np.sqrt(max(a + 2 * ab * force_n + b * force_n**2, 0.0) * (1 + 1 / self.units))
        scatter, relative = self.residual_grey, self.residual_share
        sources = (
            ("line of the tip or object", "A", float(units), "grey", 1 / slope, self.units - 1.0),
            ("scatter of a press", "A", scatter.value, "grey", 1 / slope, scatter.degrees_of_freedom),
            ("relative scatter of a press", "A", relative.value, "1", force_n, relative.degrees_of_freedom),
            ("difference of tips, assumed", "B", self.assumed_tip_share, "1", force_n, np.inf),
            ("drift of the lamps", "B", self.drift_share, "1", force_n, np.inf),
            ("force gauge of the calibration", "B", self.gauge_share, "1", force_n, np.inf),
        )
        _, freedom = combine_variances(
            tuple(((sd * sensitivity) ** 2, freedom) for _, _, sd, _, sensitivity, freedom in sources)
        )
        components = tuple(
            UncertaintyComponent(
                source=source,
                evaluation=evaluation,
                distribution="normal" if np.isinf(freedom) else "Student's t",
                standard_uncertainty=abs(sd),
                unit=unit,
                contribution=abs(sd * sensitivity),
            )
            for source, evaluation, sd, unit, sensitivity, freedom in sources
        )
        return QuantityBudget(
            name="force_n", value=force_n, unit="N", components=components, degrees_of_freedom=freedom
        )


def combine_variances(parts: tuple[tuple[float, float], ...]) -> tuple[float, float]:
    """Sum of independent variances with their degrees of freedom, and the degrees of freedom of the sum.

    Half of the 95 % interval of the sum is the root of the sum of squares of the parts' half intervals. The rule of
    Welch and Satterthwaite gives too many degrees of freedom when a part with two or three values happens to be small:
    with three tips its intervals covered the slope in 93 % of trials instead of 95 %.

    Examples
    --------
    >>> combine_variances(((4.0, 2.0), (0.0, np.inf)))
    (4.0, 2.0)
    """
    total = sum(variance for variance, _ in parts)
    if total <= 0:
        return 0.0, np.inf
    half = sum(variance * float(scipy.stats.t.ppf(UPPER, freedom)) ** 2 for variance, freedom in parts)
    quantile = float(np.sqrt(half / total))

    def excess(logarithm: float) -> float:
        return float(scipy.stats.t.ppf(UPPER, np.exp(logarithm))) - quantile

    if excess(LARGEST_LOG) >= 0:
        return total, np.inf
    return total, max(1.0, round(float(np.exp(scipy.optimize.brentq(excess, -1e-9, LARGEST_LOG))), 9))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceLineDiagnostics:
    """How well a straight line describes the loadings.

    Attributes
    ----------
    residual_sd_grey
        Root mean square residual of single presses from the line of their own unit, grey levels.
    r_squared
        Fraction of the variance of all sums that the mean line explains.
    linearity
        Largest departure of the mean curve from the line over the largest sum, with its uncertainty.
    exponent
        Power of the force in the sums, 1 for a straight line through zero.
    hysteresis
        Loading minus unloading over the range at 0.6 of the largest force, where loops are widest within 5 %; None
        with fewer than two loadings with both branches.
    repeatability
        Standard deviation of repeated sums at one tip and force over the range; None without repeats.
    tip_difference
        Line of the widest tip over that of the second widest at 0.8 N, minus 1; None with one tip.
    detectable_n
        Smallest force detected with 5 % false alarms and 5 % misses; None without untouched frames.
    saturated
        True when clipping limits the valid range.
    """

    residual_sd_grey: float
    r_squared: float
    linearity: MeasuredValue
    exponent: float
    hysteresis: MeasuredValue | None
    repeatability: MeasuredValue | None
    tip_difference: MeasuredValue | None
    detectable_n: MeasuredValue | None
    saturated: bool
