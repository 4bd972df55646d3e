"""Drift and warm-up of lamps, by a reference patch.

Lamps also drift at random. A fit that assumes white noise gives intervals several times too short, so the noise model
is white noise plus a random walk. Its variance and the time constant are integrated over a grid, level and amplitude
in closed form.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, InputError
from tsis.imaging.corrections import require_image, require_same_frame
from tsis.imaging.patch import pixel_noise
from tsis.model.require import require_array, require_integer, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from tsis.model.image import TactileImage


LEAST_LIT = 0.02  # of full scale: a darker patch shows the black level, not the lamps
LEAST_PIXELS = 16
ROUNDING = 12.0**-0.5  # standard deviation of rounding to whole grey levels
FEWEST = 12  # values: four parameters and enough degrees of freedom
MOST = 150  # longer series are averaged down to this length
TAUS = 100  # time constants, from a step of the series to `LONGEST_TIME_CONSTANT` times its length
LONGEST_TIME_CONSTANT = 3.0  # beyond it an exponential is a line
WALKS = (0.0, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0)  # final variance of the walk over the noise's
NEGLIGIBLE = 1e-6  # probability of a time constant on the first, coarse grid
EDGE = 0.5  # probability of time constants longer than the series from which the level counts as unknown
SIGNIFICANT = 0.95

PixelBox = tuple[int, int, int, int]  # left, top, right, bottom


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferencePatch:
    """A rectangle of the frame that the lamps light outside every contact.

    Raises `InputError` when the ends do not ascend or hold too few pixels.

    Parameters
    ----------
    first_row, last_row, first_column, last_column
        Its ends in pixels, the last ones excluded; at least 16 pixels together.

    Examples
    --------
    >>> ReferencePatch(first_row=0, last_row=20, first_column=700, last_column=768).pixels
    1360
    """

    first_row: int
    last_row: int
    first_column: int
    last_column: int

    def __post_init__(self) -> None:
        for first, last in (("first_row", "last_row"), ("first_column", "last_column")):
            start = require_integer(first, getattr(self, first), 0, 65534, hint="pixels")
            end = require_integer(last, getattr(self, last), start + 1, 65535, hint="pixels, beyond the first")
            object.__setattr__(self, first, start)
            object.__setattr__(self, last, end)
        if self.pixels < LEAST_PIXELS:
            raise InputError(f"a reference patch must hold at least {LEAST_PIXELS} pixels; got {self.pixels}")

    @classmethod
    def from_px(cls, patch_px: PixelBox) -> Self:
        """The patch from (left, top, right, bottom) in pixels, right and bottom excluded, as in files.

        Examples
        --------
        >>> ReferencePatch.from_px((700, 0, 768, 20)).pixels
        1360
        """
        if len(patch_px) != 4:
            raise InputError(f"patch_px must hold left, top, right, bottom; got {patch_px!r:.80}")
        left, top, right, bottom = patch_px
        return cls(first_row=top, last_row=bottom, first_column=left, last_column=right)

    @property
    def patch_px(self) -> PixelBox:
        """Left, top, right, bottom."""
        return self.first_column, self.first_row, self.last_column, self.last_row

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return (self.last_row - self.first_row) * (self.last_column - self.first_column)

    def of(self, image: TactileImage) -> TactileImage:
        """The patch of a frame; `InputError` when it extends beyond the frame."""
        require_image("image", image)
        self.require_inside(image.grey.shape)
        return replace(image, grey=self.cut(image.grey), axis_px=None)

    def require_inside(self, shape: tuple[int, ...]) -> None:
        """Refuse a frame of (rows, columns) that does not contain the patch."""
        rows, columns = shape
        if self.last_row > rows or self.last_column > columns:
            raise InputError(
                f"reference patch must lie inside the frame of {rows} x {columns} pixels; it ends at row "
                f"{self.last_row}, column {self.last_column}"
            )

    def cut(self, pixels: NDArray[Any]) -> NDArray[Any]:
        """The patch of an array of shape (..., rows, columns); a view."""
        return pixels[..., self.first_row : self.last_row, self.first_column : self.last_column]


def require_lit(light_grey: float, full_scale: float) -> None:
    """Refuse a patch so near the dark level that it shows the black level, not the lamps."""
    if light_grey < LEAST_LIT * full_scale:
        raise InputError(
            f"reference patch must be lit by at least {LEAST_LIT:.0%} of full scale to follow the lamps; it is "
            f"{light_grey:.3g} grey levels above dark: choose a part of the frame that the lamps light"
        )


def patch_ratio(
    image: TactileImage, reference: TactileImage, *, patch: ReferencePatch, dark_grey: float = 0.0
) -> MeasuredValue:
    """Brightness of the lamps relative to the reference.

    Raises `InputError` when the patch leaves the frame, is clipped, or is too dark to show the lamps;
    `ImageMismatchError` when the frames differ in size, scale or full scale.

    Parameters
    ----------
    image, reference
        Raw frames of one camera and mode; the patch is untouched in both.
    patch
        Part of the frame that is compared.
    dark_grey
        Camera level without light, grey levels; includes ambient light that is the same in both.

    Returns
    -------
    MeasuredValue
        Ratio of the patch's means above ``dark_grey``, with the uncertainty from noise and rounding of the pixels.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> before, after = (TactileImage(grey=np.full((40, 40), grey)) for grey in (100.0, 103.0))
    >>> corner = ReferencePatch(first_row=0, last_row=10, first_column=0, last_column=10)
    >>> round(patch_ratio(after, before, patch=corner).value, 4)
    1.03
    """
    require_same_frame(image, reference, "reference")
    require_number("dark_grey", dark_grey, 0.0, image.full_scale)
    now, now_sd = _level("image", image, patch, dark_grey)
    before, before_sd = _level("reference", reference, patch, dark_grey)
    require_lit(before, reference.full_scale)
    ratio = now / before
    return MeasuredValue(value=ratio, sd=float(np.hypot(now_sd, ratio * before_sd)) / before)


def _level(name: str, image: TactileImage, patch: ReferencePatch, dark_grey: float) -> tuple[float, float]:
    """Mean of the patch above dark and its standard deviation."""
    grey = patch.of(image).grey
    clipped = int(np.count_nonzero(grey >= image.full_scale))
    if clipped:
        raise InputError(f"reference patch of the {name} must not be clipped; {clipped} of {grey.size} pixels are")
    noise = max(pixel_noise(grey), ROUNDING)
    return float(grey.mean()) - dark_grey, noise / float(np.sqrt(grey.size))


def drift_corrected(image: TactileImage, ratio: MeasuredValue | float, *, dark_grey: float = 0.0) -> TactileImage:
    """Scale the light of a frame to the lamps of the reference, by the ratio of `patch_ratio`.

    Raises `InputError` when the ratio or the dark level lies outside its range.

    Parameters
    ----------
    image
        A raw camera frame.
    ratio
        Of the lamps to those of the reference, in [0.05, 20].
    dark_grey
        Camera level without light, grey levels; it does not drift with the lamps.

    Returns
    -------
    TactileImage
        ``dark_grey + (image - dark_grey) / ratio``. Test the original frame for clipped pixels.

    Examples
    --------
    >>> from tsis.model.image import TactileImage
    >>> float(drift_corrected(TactileImage(grey=np.full((8, 8), 103.0)), 1.03).grey.max())
    100.0
    """
    require_image("image", image)
    value = require_number("ratio", ratio.value if isinstance(ratio, MeasuredValue) else ratio, 0.05, 20.0)
    require_number("dark_grey", dark_grey, 0.0, image.full_scale)
    return replace(image, grey=dark_grey + (image.grey - dark_grey) / value)


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmUp:
    """Fit of the lamps' warm-up.

    Attributes
    ----------
    amplitude
        Relative excess of the light at time 0 over that of warm lamps; negative where they brighten.
    time_constant_s
        Time constant of the warm-up, s.
    level
        Ratio when warm.
    """

    amplitude: MeasuredValue
    time_constant_s: MeasuredValue
    level: MeasuredValue

    def wait_s(self, fraction: float, *, now_s: float = 0.0) -> float:
        """Seconds from ``now_s`` after switching on until the light is within ``fraction`` of that when warm.

        The wait uses the upper ends of the 95 % intervals of amplitude and time constant. Raises `InputError` when
        ``fraction`` lies outside [1e-5, 1] or the time is negative.

        Examples
        --------
        >>> five = MeasuredValue(value=0.05, sd=0.0)
        >>> lamps = WarmUp(amplitude=five, time_constant_s=MeasuredValue(value=300.0, sd=0.0, unit="s"), level=five)
        >>> round(lamps.wait_s(0.01))
        483
        """
        require_number("fraction", fraction, 1e-5, 1.0, hint="a fraction of the warm lamps' light")
        require_number("now_s", now_s, 0.0, 1e7, hint="seconds")
        largest = max(abs(end) for end in self.amplitude.interval())
        if largest <= fraction:
            return 0.0
        return max(0.0, self.time_constant_s.interval()[1] * float(np.log(largest / fraction)) - now_s)


def fit_warm_up(time_s: ArrayLike, ratio: ArrayLike) -> WarmUp:
    """Fit the warm-up of lamps.

    Raises `InputError` when the series is too short, holds NaN, does not ascend or is not positive; `CalibrationError`
    when the lamps still change at the end, so that their final level is unknown.

    Parameters
    ----------
    time_s
        Times since the lamps were switched on, s, shape (n,), strictly ascending, at least 12.
    ratio
        Their light (see `tsis.calibration.lamps.patch_ratio`), shape (n,), positive.

    Returns
    -------
    WarmUp
        The three parameters with their uncertainties.

    Examples
    --------
    >>> minutes = np.arange(0.0, 2400.0, 20.0)
    >>> noise = 1e-4 * np.random.default_rng(1).standard_normal(minutes.size)
    >>> fit = fit_warm_up(minutes, 1 + 0.05 * np.exp(-minutes / 300.0) + noise)
    >>> round(fit.amplitude.value, 3), round(fit.time_constant_s.value / 60, 1)
    (0.05, 5.0)
    """
    time, value = _checked(time_s, ratio)
    by = -(-len(time) // MOST)
    first = len(time) % by  # the oldest remainder is dropped
    time, value = (part[first:].reshape(-1, by).mean(axis=1) for part in (time, value))
    taus = np.geomspace(float(np.diff(time).min()), LONGEST_TIME_CONSTANT * float(time[-1]), TAUS)
    coarse = _posterior(time, value, taus)[0].reshape(len(WALKS), TAUS).sum(axis=0)
    likely = np.flatnonzero(coarse > NEGLIGIBLE)
    taus = np.geomspace(taus[max(likely[0] - 1, 0)], taus[min(likely[-1] + 1, TAUS - 1)], TAUS)
    weight, means, spreads = _posterior(time, value, taus)
    free = len(time) - 4.0
    level = _mixed(weight, means[:, 0], spreads[:, 0], free, "")
    amplitude = _mixed(weight, means[:, 1] / means[:, 0], spreads[:, 1] / means[:, 0], free, "")
    tau = np.tile(taus, len(WALKS))
    low, high = amplitude.interval(SIGNIFICANT)
    unseen = float(weight[tau > time[-1]].sum())
    if unseen > EDGE and not low <= 0.0 <= high:
        raise CalibrationError(
            f"warming up must be followed until it slows down; after {time[-1]:g} s the time constant is still longer "
            f"than that with probability {unseen:.0%}: record longer"
        )
    return WarmUp(amplitude=amplitude, time_constant_s=_mixed(weight, tau, 0.0 * tau, free, "s"), level=level)


def _checked(time_s: ArrayLike, ratio: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    time, value = require_array("time_s", time_s, ndim=1), require_array("ratio", ratio, ndim=1)
    if time.shape != value.shape:
        raise InputError(f"time_s and ratio must be of one length; got {time.size} and {value.size}")
    if time.size < FEWEST:
        raise InputError(f"warming up needs at least {FEWEST} ratios; got {time.size}")
    if time[0] < 0 or (np.diff(time) <= 0).any():
        raise InputError("time_s must ascend from 0 or later: seconds since the lamps were switched on")
    if value.min() <= 0:
        raise InputError(f"ratio must be positive; got {value.min():g}")
    return time, value


def _posterior(
    time: NDArray[np.float64], value: NDArray[np.float64], taus: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Probability, (level, level * A) and their standard deviations, by random walk and time constant."""
    fits = [_weighed(time, value, taus, walk) for walk in WALKS]
    logs, means, spreads = (np.concatenate([fit[i] for fit in fits]) for i in range(3))
    weight = np.exp(logs - logs.max())
    return weight / weight.sum(), means, spreads


def _weighed(
    time: NDArray[np.float64], value: NDArray[np.float64], taus: NDArray[np.float64], walk: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Logarithm of the restricted likelihood, (level, level * A) and their standard deviations, by time constant."""
    since = time - time[0]
    noise = np.eye(len(time)) + walk * np.minimum(since[:, None], since) / since[-1]
    root = np.linalg.cholesky(noise)
    columns = np.column_stack([np.ones_like(time), value, np.exp(-time[:, None] / taus)])
    white = np.linalg.solve(root, columns)
    constant, observed, fading = white[:, 0], white[:, 1], white[:, 2:]
    normal = np.empty((len(taus), 2, 2))
    normal[:, 0, 0], normal[:, 1, 1] = constant @ constant, (fading**2).sum(axis=0)
    normal[:, 0, 1] = normal[:, 1, 0] = constant @ fading
    right = np.stack([np.full(len(taus), constant @ observed), observed @ fading], axis=1)
    inverse = np.linalg.inv(normal)
    mean = np.einsum("tij,tj->ti", inverse, right)
    squares = np.maximum(observed @ observed - (mean * right).sum(axis=1), 1e-14 * (observed @ observed))
    free = len(time) - 2
    logs = -(free * np.log(squares) + np.linalg.slogdet(normal)[1]) / 2 - np.log(np.diag(root)).sum()
    spread = np.sqrt(np.einsum("tii->ti", inverse) * (squares / free)[:, None])
    return logs, mean, spread


def _mixed(
    weight: NDArray[np.float64], mean: NDArray[np.float64], sd: NDArray[np.float64], free: float, unit: str
) -> MeasuredValue:
    middle = float(weight @ mean)
    spread = float(np.sqrt(weight @ (sd**2 + (mean - middle) ** 2)))
    return MeasuredValue(value=middle, sd=spread, degrees_of_freedom=free, unit=unit)
