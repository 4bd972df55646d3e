"""The force line: the sum of grey levels against force (section 5.1).

A loading is one run of a tip with readings of camera and gauge in order of time. Errors of one run are correlated: the
lamps drift, the light at the tip's position differs, the probe has memory. The standard deviation of least squares
assumes independent errors and would be several times too small. The unit of the statistics is therefore the tip (its
repeats averaged), with a line for each tip. The result is the mean of the lines; its uncertainty follows from their
scatter by Student's t.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
import scipy
import skimage

from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, InputError
from tsis.imaging.patch import segment, smoothed
from tsis.model.budget import QuantityBudget, UncertaintyComponent
from tsis.model.image import TactileImage
from tsis.model.require import require_array, require_integer, require_number, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.camera_reference import CameraReference


PATCH_METHODS = ("threshold", "canny")
MARGIN = 0.06  # of the patch's radius; the mask grows by it to include the light of the edge
LEAST_MARGIN_PX = 3
MIDDLE = 0.3  # of the contact's radius
HERTZ_SPREAD = 2.5  # square of the radius over the mean square distance of a Hertzian contact's light
UPPER = 0.975  # quantile at the upper end of a 95 % interval
LARGEST_LOG = 14.0  # of degrees of freedom: a million is as good as infinity
LARGEST_GAUGE_N = 50.0  # range of the source's gauge; larger numbers are in another unit
TIPS_MM = (2.0, 10.0, 14.0)
LARGEST_N, STEP_N = 2.0, 0.1
UNTOUCHED_N = 0.005  # largest zero of a gauge without load
NUMBERS = ("force_n", "total_grey", "field_grey", "peak_grey", "mean_square_mm2", "clipped")  # of every press
CLIPPED_FRACTION = 1e-4  # of a patch's pixels; a press with more is saturated
GRID = 20  # forces at which loadings are compared
FEWEST = 4
COMPARED_N = 0.8  # the source compares its tips at this force
FALSE_ALARMS, MISSES = 0.05, 0.05
HYSTERESIS_POINT = 0.6  # of the largest force
FEWEST_UNTOUCHED = 3
GAUGE_ERROR = 0.001  # of the reading: a gauge of class 0.1 %
PRINTED_TIP_ERROR = 0.0245  # the source's difference between two tips, assumed where one tip was used


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadingFrame:
    """One frame with the gauge's force.

    Attributes
    ----------
    force_n
        Force of the gauge, newtons.
    touched
        Whether the tip touched the probe.
    total_grey, field_grey
        Sum of grey levels above no contact, over the bright patch (0 without one) and over all good pixels.
    peak_grey, mean_square_mm2
        Grey level in the middle, and mean square distance of the light from its centroid; 0 without a patch.
    clipped
        Fraction of the patch's pixels that clip.
    """

    force_n: float
    touched: bool
    total_grey: float
    field_grey: float
    peak_grey: float
    mean_square_mm2: float
    clipped: float


def read_loading_frame(
    image: TactileImage, reference: CameraReference, *, force_n: float, touched: bool, method: str = "threshold"
) -> LoadingFrame:
    """Read one frame of the loading procedure; clipped pixels are counted, not refused.

    Raises `ImageMismatchError` or `InputError` when the frame does not belong to the reference, the lamps changed or
    the scale is unknown.

    Parameters
    ----------
    image
        The raw camera frame.
    reference
        Its correction.
    force_n, touched
        As in `LoadingFrame`.
    method
        ``"threshold"`` or ``"canny"``.
    """
    grey = reference.touch_grey(image)
    scale = reference.mm_per_pixel or image.mm_per_pixel
    if scale is None:
        raise InputError("mm_per_pixel must be known to read a press; calibrate the scale first")
    mask = patch_mask(TactileImage(grey=grey, full_scale=reference.full_scale), method=method)
    lit = bool(mask.any())
    peak, spread = _shape(grey, mask, scale) if lit else (0.0, 0.0)
    return LoadingFrame(
        force_n=force_n,
        touched=touched,
        total_grey=float(grey[mask].sum()),
        field_grey=float(grey[reference.usable].sum()),
        peak_grey=peak,
        mean_square_mm2=spread,
        clipped=float(np.mean(image.grey[mask] >= image.full_scale)) if lit else 0.0,
    )


def total_grey(image: TactileImage, reference: CameraReference, *, method: str = "threshold") -> float:
    """Sum of grey levels above no contact over the bright patch, 0 when nothing stands out of the noise.

    It is the argument of `ForceLine.force_n`. Raises `ImageMismatchError` or `InputError` when the frame
    does not belong to the reference, is saturated, or the lamps changed.
    """
    corrected = reference.corrected(image)
    mask = patch_mask(corrected, method=method)
    # y of the source's (5.4): where grey level follows pressure as in (5.2), the sum follows the force, the integral of
    # the pressure (5.3).
    return float(corrected.grey[mask].sum())


def patch_mask(image: TactileImage, *, method: str = "threshold") -> NDArray[np.bool]:
    """The pixels of the bright patch of a corrected frame, with a margin for the light of its edge.

    ``"threshold"`` cuts six standard deviations of the noise above the dark side. ``"canny"`` fills the outline of
    Canny's edges, or uses the threshold's patch where they do not close.
    """
    require_one_of("segmentation method", method, PATCH_METHODS)
    patch = segment(image, method="noise")
    mask = np.asarray(patch.mask)
    if not patch.is_contact:
        return mask
    if method == "canny":
        mask = _within_edges(image.grey, mask, patch.threshold_grey)
    margin = max(LEAST_MARGIN_PX, round(MARGIN * float(np.sqrt(mask.sum() / np.pi))))
    return np.asarray(scipy.ndimage.distance_transform_edt(~mask) <= margin)


def _within_edges(grey: NDArray[np.float64], mask: NDArray[np.bool], threshold: float) -> NDArray[np.bool]:
    """The part of the patch that Canny's edges enclose."""
    smooth = smoothed(grey)
    top = float(smooth[mask].max())
    low = float(np.clip(threshold / top, 5 / 255, 100 / 255))
    levels = np.clip(smooth / top, 0, 1)
    edges = skimage.feature.canny(levels, 0, low, 2 * low, mode="nearest")  # type: ignore[no-untyped-call]
    filled = scipy.ndimage.binary_fill_holes(scipy.ndimage.grey_closing(edges, (5, 5), mode="nearest"))
    labels, count = scipy.ndimage.label(filled)
    if count == 0:
        return mask
    sizes = np.bincount(labels[mask], minlength=count + 1)
    sizes[0] = 0
    inside = labels == int(np.argmax(sizes))
    return np.asarray(inside) if inside[mask].mean() > 0.5 else mask


def _shape(grey: NDArray[np.float64], mask: NDArray[np.bool], scale: tuple[float, float]) -> tuple[float, float]:
    """Grey level in the middle, and mean square distance from the centroid, mm²."""
    rows, columns = np.nonzero(mask)
    light = grey[rows, columns]
    total = float(light.sum())
    x, y = columns * scale[0], rows * scale[1]
    away = (x - float(light @ x) / total) ** 2 + (y - float(light @ y) / total) ** 2
    spread = float(light @ away) / total
    middle = away < MIDDLE**2 * HERTZ_SPREAD * spread
    return float(light[middle].mean()) if middle.any() else float(light.max()), max(spread, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceLine:
    """``sum = intercept + slope * F`` with F in newtons, with the variances of a new force.

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
        force = (total - self.intercept_grey.value) / self.slope_grey_per_n.value  # (5.4)
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
    """Sum of independent variances with their degrees of freedom, and the degrees of freedom of the sum."""
    total = sum(variance for variance, _ in parts)
    if total <= 0:
        return 0.0, np.inf
    # Half of the 95 % interval of the sum is the root of the sum of squares of the parts' half intervals. The rule of
    # Welch and Satterthwaite gives too many degrees of freedom when a part with two or three values happens to be
    # small: with three tips its intervals covered the slope in 93 % of trials instead of 95 %.
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


def loading_forces(largest_n: float = LARGEST_N, step_n: float = STEP_N) -> tuple[float, ...]:
    """Forces of section 5.1 in newtons in order of time: 0 to the largest in steps, and back to 0.

    Raises `InputError` when either lies outside its range.

    Parameters
    ----------
    largest_n
        Largest force in newtons, in [0.001, 50].
    step_n
        Step in newtons, from 0.0001 to the largest.

    Examples
    --------
    >>> loading_forces(0.3)
    (0.0, 0.1, 0.2, 0.3, 0.2, 0.1, 0.0)
    """
    require_number("largest_n", largest_n, 1e-3, LARGEST_GAUGE_N, hint="newtons")
    steps = round(largest_n / require_number("step_n", step_n, 1e-4, largest_n, hint="newtons"))
    up = [round(largest_n * step / steps, 9) for step in range(steps + 1)]
    return (*up, *up[-2::-1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Loading:
    """One run of a tip from no contact to the largest force and back, in order of time.

    Parameters
    ----------
    tip_radius_mm
        Radius of the rigid tip, mm, in [0.1, 1000].
    force_n
        Gauge readings in newtons, shape (n,), n >= 6; within 50 N.
    total_grey
        Sum of grey levels above no contact of the bright patch, shape (n,).
    touched
        Whether the tip touched the probe, shape (n,); without contact the gauge shows its zero.
    field_grey
        The same sum over all good pixels, shape (n,).
    peak_grey, mean_square_mm2
        Grey level in the middle of the contact and mean square distance of its light from its centroid, shape (n,);
        0 without a patch.
    clipped
        Fraction of the patch's pixels that clip, shape (n,).
    run
        Number of the repeat, from 1.
    """

    tip_radius_mm: float
    force_n: NDArray[np.float64]
    total_grey: NDArray[np.float64]
    touched: NDArray[np.bool]
    field_grey: NDArray[np.float64]
    peak_grey: NDArray[np.float64]
    mean_square_mm2: NDArray[np.float64]
    clipped: NDArray[np.float64]
    run: int = 1

    def __post_init__(self) -> None:
        require_number("tip_radius_mm", self.tip_radius_mm, 0.1, 1000.0, hint="millimetres")
        require_integer("run", self.run, 1, 10_000)
        for name in NUMBERS:
            values = require_array(name, getattr(self, name), ndim=1)
            object.__setattr__(self, name, values)
            if len(values) != len(self.force_n):
                raise InputError(f"{name} must hold one number a press, {len(self.force_n)}; got {len(values)}")
        touched = np.array(self.touched, dtype=bool)
        if touched.shape != self.force_n.shape:
            raise InputError(f"touched must hold one truth value a press, {len(self.force_n)}; got {touched.shape}")
        touched.flags.writeable = False
        object.__setattr__(self, "touched", touched)
        largest = float(np.abs(self.force_n).max())
        if largest > LARGEST_GAUGE_N:
            raise InputError(
                f"force_n must hold newtons, at most {LARGEST_GAUGE_N:g}; got {largest:g} "
                "(millinewtons? divide them by 1000)"
            )
        if int(touched.sum()) < 4:
            raise CalibrationError(
                f"a loading must hold at least 4 presses with contact; got {int(touched.sum())} (take smaller steps)"
            )

    @classmethod
    def from_frames(cls, tip_radius_mm: float, readings: Sequence[LoadingFrame], *, run: int = 1) -> Self:
        """The loading of single frames."""
        columns = {name: np.array([getattr(reading, name) for reading in readings]) for name in (*NUMBERS, "touched")}
        return cls(tip_radius_mm=tip_radius_mm, run=run, **columns)

    @property
    def zero_n(self) -> float:
        """Gauge reading without contact, newtons; 0 without such frames."""
        return float(self.force_n[~self.touched].mean()) if (~self.touched).any() else 0.0

    @property
    def load_n(self) -> NDArray[np.float64]:
        """Forces minus the gauge's zero, shape (n,)."""
        return np.asarray(self.force_n - self.zero_n)

    @property
    def rising(self) -> NDArray[np.bool]:
        """True up to the largest force, shape (n,)."""
        return np.arange(len(self.force_n)) <= int(np.argmax(self.force_n))


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


def _spread_value(variance: float, freedom: float, *, unit: str = "") -> MeasuredValue:
    """A standard deviation with its own uncertainty from its degrees of freedom."""
    freedom = max(freedom, 1.0)
    sd = float(np.sqrt(variance))
    return MeasuredValue(value=sd, sd=sd / float(np.sqrt(2 * freedom)), degrees_of_freedom=freedom, unit=unit)


def _loading_linearity(runs: Sequence[LoadingRun]) -> MeasuredValue:
    """Largest departure of the mean curve from a straight line over the largest sum, signed."""
    force = common_forces(runs)
    curves = []
    for run in runs:
        branches = [run.sums_at(force, rising=way) for way in ((True, False) if run.has_both_branches else (True,))]
        line = run.intercept + run.slope * force
        curves.append((np.mean(branches, axis=0) - line) / line[-1])
    # The selection of the largest departure biases it upwards; the interval is that of the selected force.
    departures = np.array(curves)
    return mean_value(departures[:, int(np.abs(departures.mean(axis=0)).argmax())])


def _loading_hysteresis(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
    """Loading minus unloading over the range, at 0.6 of the largest force; None with fewer than two loops."""
    # Each run's loop is smoothed to f (1 - f) (c0 + c1 f), f the force over the largest one. The shape is closed at
    # both ends. A steady drift of the lamps has the same shape, so the scatter between runs includes the drift. Both
    # terms have more than 95 % of their largest width at 0.6. A force selected from the data would follow the noise.
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


def _loading_repeatability(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
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
    return _spread_value(squares / (2 * freedom), freedom) if freedom else None


def _tip_difference(runs: Sequence[LoadingRun]) -> MeasuredValue | None:
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


def _detectable_n(loadings: Sequence[Loading], slope_grey_per_n: float) -> MeasuredValue | None:
    """Smallest force that the sum over the whole frame detects, newtons; None without untouched frames."""
    untouched = np.concatenate([loading.field_grey[~loading.touched] for loading in loadings])
    count = len(untouched)
    if count < FEWEST_UNTOUCHED:
        return None
    # Currie's limit (z_a + z_b) s sqrt(1 + 1 / n) of n untouched sums with the standard deviation s.
    quantiles = float(scipy.stats.norm.isf(FALSE_ALARMS) + scipy.stats.norm.isf(MISSES))
    levels = float(quantiles * np.sqrt(1 + 1 / count) / slope_grey_per_n)
    return _spread_value(float(np.var(untouched, ddof=1)) * levels**2, count - 1.0, unit="N")


def fit_force_line(
    loadings: Sequence[Loading],
    *,
    reference: CameraReference,
    gauge_fraction: float = GAUGE_ERROR,
    drift_fraction: float | None = None,
    method: str = "threshold",
) -> tuple[ForceLine, ForceLineDiagnostics]:
    """Fit ``sum = a + b F`` to loadings and unloadings of one or more tips.

    Raises `CalibrationError` when there are fewer than two loadings, when presses are too few or clip, or the sum does
    not rise; `InputError` when forces are in another unit.

    Parameters
    ----------
    loadings
        At least two: different tips, best of 2, 10 and 14 mm radius, or repeats of one.
    reference
        The reference that corrected the frames.
    gauge_fraction
        Relative standard deviation of the force gauge's calibration, from its certificate.
    drift_fraction
        Relative standard deviation of the lamps after correction, between the reference and a later frame; that of
        ``reference`` when None.
    method
        Segmentation method of `read_loading_frame`.

    Returns
    -------
    The line, and its diagnostics.
    """
    for loading in loadings:
        require_type("loadings", loading, Loading)
    if len(loadings) < 2:
        raise CalibrationError(
            f"a force line needs at least 2 loadings, of two tips or repeats of one, for the lamps' drift hides in the "
            f"slope of a single one; got {len(loadings)}"
        )
    gauge = require_number("gauge_fraction", gauge_fraction, 0.0, 0.5, hint="a fraction of 1")
    runs = [fit_run(loading) for loading in loadings]
    tips = tuple(sorted({run.tip_mm for run in runs}))
    units = _units(runs)
    intercept, slope, covariance = _mean_line(units, gauge)
    residual_grey, residual_fraction = _residuals(runs, slope.value)
    detectable = _detectable_n(loadings, slope.value)
    least, most, saturated = _range(loadings, detectable)
    line = ForceLine(
        intercept_grey=intercept,
        slope_grey_per_n=slope,
        unit_covariance=(float(covariance[0, 0]), float(covariance[0, 1]), float(covariance[1, 1])),
        units=len(units),
        assumed_tip_share=PRINTED_TIP_ERROR if len(tips) == 1 else 0.0,
        residual_grey=residual_grey,
        residual_share=residual_fraction,
        drift_share=reference.drift_fraction if drift_fraction is None else drift_fraction,
        gauge_share=gauge,
        least_n=least,
        most_n=most,
        pixels=int(reference.dark_grey.size),
        full_scale=reference.full_scale,
        tips_mm=tips,
        method=method,
    )
    return line, _diagnostics(runs, line, detectable, saturated=saturated)


def _units(runs: Sequence[LoadingRun]) -> NDArray[np.float64]:
    """Intercept and slope of each tip, or of each repeat of a single tip, shape (units, 2)."""
    lines = np.array([(run.intercept, run.slope) for run in runs])
    tips = np.array([run.tip_mm for run in runs])
    if len(set(tips.tolist())) == 1:
        return lines
    return np.array([lines[tips == tip].mean(axis=0) for tip in sorted(set(tips.tolist()))])


def _mean_line(units: NDArray[np.float64], gauge: float) -> tuple[MeasuredValue, MeasuredValue, NDArray[np.float64]]:
    """Mean intercept and slope over the units, and the covariance of single units."""
    covariance = np.cov(units, rowvar=False)
    intercept, slope = (float(value) for value in units.mean(axis=0))
    count, freedom = len(units), len(units) - 1.0
    variance, slope_freedom = combine_variances(
        ((float(covariance[1, 1]) / count, freedom), ((gauge * slope) ** 2, np.inf))
    )
    return (
        MeasuredValue(
            value=intercept, sd=float(np.sqrt(covariance[0, 0] / count)), degrees_of_freedom=freedom, unit="grey"
        ),
        MeasuredValue(value=slope, sd=float(np.sqrt(variance)), degrees_of_freedom=slope_freedom, unit="grey/N"),
        covariance,
    )


def _residuals(runs: Sequence[LoadingRun], slope: float) -> tuple[MeasuredValue, MeasuredValue]:
    """Scatter of presses about the line of their run: a constant part, and a part proportional to the sum."""
    light = np.concatenate([slope * run.force_n for run in runs])
    squares = np.concatenate(
        [run.residual_grey**2 * len(run.residual_grey) / (len(run.residual_grey) - 2) for run in runs]
    )
    expected = np.full(len(light), float(squares.mean()))
    design = np.stack([np.ones_like(light), light**2], axis=1)
    parts = np.zeros(2)
    for _ in range(5):  # the variance of a square grows with its expectation
        scale = np.linalg.norm(design / expected[:, None], axis=0)
        parts = scipy.optimize.nnls(design / expected[:, None] / scale, squares / expected)[0] / scale
        expected = np.maximum(design @ parts, 1e-6 * float(squares.mean()) + 1e-12)
    freedom = len(light) - 2.0 * len(runs)
    return _spread_value(float(parts[0]), freedom, unit="grey"), _spread_value(float(parts[1]), freedom)


def _range(loadings: Sequence[Loading], detectable: MeasuredValue | None) -> tuple[float, float, bool]:
    """Smallest and largest force of the line's range, and whether clipping limits it."""
    touched = np.concatenate([loading.load_n[loading.touched] for loading in loadings])
    detected = np.concatenate([loading.total_grey[loading.touched] > 0 for loading in loadings])
    clipped = np.concatenate([loading.clipped[loading.touched] > CLIPPED_FRACTION for loading in loadings])
    whole = touched[~clipped & (touched < touched[clipped].min())] if clipped.any() else touched
    undetected = touched[~detected]
    dark_end = float(undetected.max()) if undetected.size else 0.0
    visible = touched[detected & (touched > dark_end)]
    least = max(float(visible.min()), 0.0 if detectable is None else detectable.value)
    most = float(whole.max()) if whole.size else 0.0
    if most <= least:
        raise CalibrationError(
            f"no range of force is left between {least:.3g} N, the smallest that is seen, and {most:.3g} N, the "
            "largest that does not clip (change the exposure)"
        )
    return least, most, bool(clipped.any())


def _diagnostics(
    runs: Sequence[LoadingRun], line: ForceLine, detectable: MeasuredValue | None, *, saturated: bool
) -> ForceLineDiagnostics:
    force = np.concatenate([run.force_n for run in runs])
    total = np.concatenate([run.total_grey for run in runs])
    residuals = total - line.intercept_grey.value - line.slope_grey_per_n.value * force
    own = np.concatenate([run.residual_grey for run in runs])
    return ForceLineDiagnostics(
        residual_sd_grey=float(np.sqrt(np.sum(own**2) / max(1, len(own) - 2 * len(runs)))),
        r_squared=float(1 - residuals.var() / total.var()),
        linearity=_loading_linearity(runs),
        exponent=float(np.polyfit(np.log(np.maximum(force, 1e-6)), np.log(total), 1)[0]),
        hysteresis=_loading_hysteresis(runs),
        repeatability=_loading_repeatability(runs),
        tip_difference=_tip_difference(runs),
        detectable_n=detectable,
        saturated=saturated,
    )
