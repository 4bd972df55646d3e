"""The camera reference: dark frame, untouched probe, flat field, noise.

Noise follows from photon transfer: repeated frames at several levels of light. A pixel's variance is
``read**2 + 1/12 + shot * light``: read noise, rounding to whole grey levels, and photons. Under noise of some tenths of
a level rounding is not white; its variance then depends on the position of the mean between two whole levels. The fit
includes the first harmonic of this dependence,

    var(rounded) = s**2 + 1/12 - (4 s**2 + 1/pi**2) q cos(2 pi mean) - (q sin(2 pi mean) / pi)**2

with ``q = exp(-2 pi**2 s**2)``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration.lamps import PixelBox, ReferencePatch, require_lit
from tsis.calibration.measured import MeasuredValue
from tsis.errors import CalibrationError, ImageMismatchError, InputError
from tsis.imaging.corrections import SCALE_TOLERANCE, require_image
from tsis.imaging.patch import GAUSSIAN_MAD
from tsis.imaging.pixels import block_means
from tsis.model.content import ContentValue
from tsis.model.image import TactileImage, require_pixel_scale
from tsis.model.require import require_array, require_integer, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


LEAST_LIGHT = 0.2  # of the mean: darker pixels are not divided by
SATURATED_FRACTION = 1e-4  # of the good pixels that may clip
LAMP_RANGE = (0.8, 1.25)  # of the light at the reference; warm lamps stay within it
LAMPS_OFF = 0.5  # of the untouched light
SIGNATURE_BLOCKS = (12, 16)  # rows and columns in which the light of the untouched probe is compared
SIGNATURE = 0.1  # root mean square difference of that light, relative
SIGNATURE_NOISE = 4e-3  # the same of the full scale, for probes that are nearly dark without contact
UNSEEN_DRIFT = 0.01  # of the lamps, assumed without a reference patch
BANDS = 12  # of the frame, of one level
LEAST_PIXELS = 200  # in a band
LEAST_LIGHT_GREY = 10.0  # with less, the whole frame is one band
CLIPPED_FRACTION = 1e-3  # of the pixels; more of them would reduce the noise
CHANCE = 0.99  # probability below which the points' scatter about the line counts as chance
FAINTEST = 0.1  # of a phase after blurring by noise, below which it is not used
LEAST_NOISE_GREY = 0.3  # below it, rounding hides the noise
LEAST_FRAMES = 4
BAD_FACTOR = 8.0  # robust standard deviations at which a pixel counts as hot or dead
MOST_BAD = 0.02  # largest fraction of bad pixels
SMOOTH_PX = 2.0  # finest variation of the light behind a lens
READ_AND_ROUNDING = 0.5  # variance of a pixel without light; photons in a bright patch add many times as much


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CameraReference(ContentValue):
    """The camera's frames without contact, and the differences of its pixels.

    Parameters
    ----------
    dark_grey
        Mean frame without light, shape (rows, columns), grey levels.
    untouched_grey
        Mean light of the untouched probe above the dark frame, the lamps on, same shape.
    relative_light
        Light over the face relative to its mean, same shape; ones when no flat field was taken.
    usable
        False for hot and dead pixels, for pixels too dark to divide by, and for the reference patch.
    full_scale
        Grey level at which the camera clips.
    mm_per_pixel
        Scale (x, y) of the frames; None when unknown.
    dark_frames, untouched_frames, flat_frames
        Number of frames in each map.
    read_noise_grey, shot_noise_grey
        Noise of one pixel without light, and variance per grey level of light.
    stray_grey
        Mean light without contact.
    patch_px
        Reference patch (left, top, right, bottom), ends excluded, that shows the lamps past the probe; None without
        one, then the lamps' drift is not corrected.
    patch_grey
        Mean light of that patch at the reference.
    lamp_sd
        Relative standard deviation of the lamps' correction by the patch; 0 without one.
    """

    dark_grey: NDArray[np.float64]
    untouched_grey: NDArray[np.float64]
    relative_light: NDArray[np.float64]
    usable: NDArray[np.bool]
    full_scale: float
    mm_per_pixel: tuple[float, float] | None
    dark_frames: int
    untouched_frames: int
    flat_frames: int
    read_noise_grey: MeasuredValue
    shot_noise_grey: MeasuredValue
    stray_grey: MeasuredValue
    patch_px: PixelBox | None = None
    patch_grey: MeasuredValue | None = None
    lamp_sd: float = 0.0

    def __post_init__(self) -> None:
        for name in ("dark_grey", "untouched_grey", "relative_light"):
            values = require_array(name, getattr(self, name), ndim=2)
            if values.shape != np.shape(self.dark_grey):
                raise InputError(
                    f"{name} must have the shape of dark_grey {np.shape(self.dark_grey)}; got {values.shape}"
                )
            object.__setattr__(self, name, values)
        usable = np.array(self.usable, dtype=bool)
        if usable.shape != self.dark_grey.shape:
            raise InputError(f"usable must have the shape of dark_grey {self.dark_grey.shape}; got {usable.shape}")
        if self.relative_light[usable].min(initial=1.0) < LEAST_LIGHT:
            raise InputError(f"relative_light must be at least {LEAST_LIGHT:g} where pixels are usable")
        usable.flags.writeable = False
        object.__setattr__(self, "usable", usable)
        require_number("full_scale", self.full_scale, 1.0, 65535.0)
        if self.mm_per_pixel is not None:
            object.__setattr__(self, "mm_per_pixel", require_pixel_scale(self.mm_per_pixel))
        for name in ("dark_frames", "untouched_frames", "flat_frames"):
            require_integer(name, getattr(self, name), 0, 10**9)
        for name in ("read_noise_grey", "shot_noise_grey", "stray_grey"):
            require_type(name, getattr(self, name), MeasuredValue)
        require_number("lamp_sd", self.lamp_sd, 0.0, 1.0, hint="a fraction of 1")
        if self.patch_px is not None:
            patch = ReferencePatch.from_px(self.patch_px)
            patch.require_inside(self.dark_grey.shape)
            object.__setattr__(self, "patch_px", patch.patch_px)
        if (self.patch_px is None) != (self.patch_grey is None):
            raise InputError("patch_px and patch_grey must be given together; got one of them")

    @property
    def patch(self) -> ReferencePatch | None:
        """The reference patch, if any."""
        return None if self.patch_px is None else ReferencePatch.from_px(self.patch_px)

    @property
    def drift_fraction(self) -> float:
        """Relative standard deviation of the lamps in a later, corrected frame; without a patch an assumed 1 %."""
        return UNSEEN_DRIFT if self.patch_px is None else self.lamp_sd

    def lamp_ratio(self, image: TactileImage) -> float:
        """Brightness of the lamps over that at the reference; 1 without a reference patch.

        Raises `InputError` when it exceeds all drift: the lamps are off, or set otherwise.
        """
        self._check(image)
        light = image.grey - self.dark_grey
        if self.patch is None or self.patch_grey is None:
            untouched = float(np.median(self.untouched_grey))
            if untouched > 1 and float(np.median(light)) < LAMPS_OFF * untouched:
                raise InputError(_lamps(float(np.median(light)) / untouched))
            return 1.0
        ratio = float(self.patch.cut(light).mean()) / self.patch_grey.value
        if not LAMP_RANGE[0] <= ratio <= LAMP_RANGE[1]:
            raise InputError(_lamps(ratio))
        return ratio

    def corrected(self, image: TactileImage) -> TactileImage:
        """Grey levels of the contact alone, under the reference's lamps and even light; no contact reads zero.

        The correction subtracts dark frame and untouched light, and divides by the lamps' drift and the light's
        pattern. A pixel that is not usable takes the mean of its usable neighbours, or zero. Raises
        `ImageMismatchError` when the frame has another size, scale or full scale; `InputError` when it is saturated, or
        the lamps changed.
        """
        self._check(image)
        clipped = self.clipped(image)
        if clipped > SATURATED_FRACTION:
            raise InputError(
                f"image must clip in at most {SATURATED_FRACTION:.2%} of its pixels; got {clipped:.2%} at "
                f"{self.full_scale:g} (press less, or shorten the exposure and calibrate again)"
            )
        return replace(image, grey=self.touch_grey(image))

    def touch_grey(self, image: TactileImage) -> NDArray[np.float64]:
        """The corrected grey levels, clipped pixels included, shape (rows, columns)."""
        lamps = self.lamp_ratio(image)  # refuses frames of another camera or mode
        touch = (image.grey - self.dark_grey) / lamps - self.untouched_grey
        touch /= np.maximum(self.relative_light, LEAST_LIGHT)
        if self.usable.all():
            return touch
        weights = scipy.ndimage.uniform_filter(self.usable.astype(float), 3, mode="nearest")
        sums = scipy.ndimage.uniform_filter(np.where(self.usable, touch, 0.0), 3, mode="nearest")
        return np.where(self.usable, touch, np.divide(sums, weights, out=np.zeros_like(sums), where=weights > 0.1))

    def clipped(self, image: TactileImage) -> float:
        """Fraction of good pixels at full scale."""
        self._check(image)
        return float(np.mean(image.grey[self.usable] >= self.full_scale))

    def require_untouched(self, image: TactileImage) -> None:
        """Refuse a frame of the untouched probe whose light is distributed otherwise than at the reference.

        The light that lamps, layers and lens send to the camera without contact is the probe's signature. Both frames
        are averaged over blocks, and the lamps' brightness, which drifts, is fitted.

        Raises `ImageMismatchError` when the remaining difference is above `SIGNATURE` of the light, or the frame has
        another size or scale; `InputError` when the lamps changed.
        """
        self._check(image)
        blocks = np.minimum(SIGNATURE_BLOCKS, self.dark_grey.shape)
        shape = (int(blocks[0]), int(blocks[1]))
        ours, theirs = (block_means(light, shape) for light in (self.untouched_grey, image.grey - self.dark_grey))
        square = float((ours**2).sum())
        fitted = float((ours * theirs).sum()) / square if square > 0 else 1.0
        ratio = float(np.clip(fitted, *LAMP_RANGE)) if self.patch is None else self.lamp_ratio(image)
        difference = float(np.sqrt(np.mean((theirs / ratio - ours) ** 2)))
        allowed = max(SIGNATURE * np.sqrt(square / ours.size), SIGNATURE_NOISE * self.full_scale)
        if difference > allowed:
            raise ImageMismatchError(
                f"{image.name or 'the untouched frame'!r} must show the light of the calibration's untouched probe "
                f"within {allowed:.3g} grey levels; it differs by {difference:.3g} (of another probe, or touched? "
                "give the calibration of this probe, or take a new reference)"
            )

    def _check(self, image: TactileImage) -> None:
        require_image("image", image)
        if image.grey.shape != self.dark_grey.shape or image.full_scale != self.full_scale:
            raise ImageMismatchError(
                f"image must have the reference's shape {self.dark_grey.shape} and full scale {self.full_scale:g}; got "
                f"{image.grey.shape} and {image.full_scale:g} (record it in the mode of the calibration)"
            )
        ours, theirs = self.mm_per_pixel, image.mm_per_pixel
        if ours is not None and theirs is not None and not np.allclose(ours, theirs, rtol=SCALE_TOLERANCE, atol=0.0):
            raise ImageMismatchError(f"image must have the reference's mm_per_pixel {ours}; got {theirs}")


def _lamps(ratio: float) -> str:
    return (
        f"the lamps must be as at the reference within [{LAMP_RANGE[0]:g}, {LAMP_RANGE[1]:g}]; they are at {ratio:.2f} "
        "of it (switch them on and let them warm up, or take a new reference)"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class PhotonTransfer:
    """Noise of a pixel.

    Attributes
    ----------
    read_noise_grey
        Standard deviation without light, grey levels, without rounding.
    shot_noise_grey
        Variance per grey level of light: full scale over the full well.
    """

    read_noise_grey: MeasuredValue
    shot_noise_grey: MeasuredValue


@dataclass(frozen=True, slots=True)
class _Point:
    light: float
    variance: float
    error: float


def _stack(name: str, images: Sequence[TactileImage], *, least: int) -> NDArray[np.float64]:
    """Grey levels of at least so many frames of one size and full scale, shape (frames, rows, columns)."""
    if len(images) < least:
        raise CalibrationError(f"{name} must hold at least {least} frames; got {len(images)} (take more)")
    for image in images:
        require_type(name, image, TactileImage)
        if image.grey.shape != images[0].grey.shape or image.full_scale != images[0].full_scale:
            raise ImageMismatchError(
                f"{name} must hold frames of one size and full scale; got {images[0].grey.shape} at "
                f"{images[0].full_scale:g} and {image.grey.shape} at {image.full_scale:g} (record all in one mode)"
            )
    return np.stack([image.grey for image in images])


def photon_transfer(
    dark: NDArray[np.float64],
    levels: Sequence[NDArray[np.float64]],
    *,
    usable: NDArray[np.bool],
    full_scale: float,
) -> PhotonTransfer:
    """Fit the line of variance against light.

    Raises `CalibrationError` when pixels clip, when all levels are dark, or when rounding hides the noise.

    Parameters
    ----------
    dark
        Frames without light, shape (n, rows, columns), n >= 2.
    levels
        Frames of each level of light, each of such a shape; the lamps may flicker from frame to frame.
    usable
        Pixels that are neither hot nor dead, shape (rows, columns).
    full_scale
        Grey level at which the camera clips.
    """
    points = []
    base = dark.mean(axis=0)
    for frames in (dark, *levels):
        values = frames[:, usable]
        clipped = float(np.mean((values <= 0) | (values >= full_scale)))
        if clipped > CLIPPED_FRACTION:
            raise CalibrationError(
                f"frames for the noise must clip in less than {CLIPPED_FRACTION:.1%} of pixels; got {clipped:.1%} "
                "(raise the black level or shorten the exposure)"
            )
        points += _points(values, base[usable], is_dark=frames is dark)
    return _line(points)


def _points(values: NDArray[np.float64], base: NDArray[np.float64], *, is_dark: bool) -> list[_Point]:
    """Variance against light in bands of one level; ``values`` has the shape (frames, pixels)."""
    frames = len(values)
    mean = values.mean(axis=0)
    light = np.zeros_like(mean) if is_dark else mean - base
    level = float(light.mean())
    # A flickering lamp scales the light of its whole frame; without light a common offset remains.
    shift = values.mean(axis=1) - mean.mean()
    shape = light / level if level > 1 else np.ones_like(light)
    residuals = values - mean - shift[:, None] * shape
    variance = np.einsum("ij,ij->j", residuals, residuals) / (frames - 1)
    bands = 1 if level <= LEAST_LIGHT_GREY else max(1, min(BANDS, len(mean) // LEAST_PIXELS))
    points = []
    for part in np.array_split(np.arange(len(mean)), bands):  # bands of the frame: sorting by light would sort by noise
        observed = float(variance[part].mean())
        true = _unrounded(observed, complex(np.exp(2j * np.pi * mean[part]).mean()), frames)
        error = observed * np.sqrt(2 / (len(part) * (frames - 1)))
        points.append(_Point(float(light[part].mean()), true, error))
    return points


def _unrounded(observed: float, phase: complex, frames: int) -> float:
    """Variance before rounding; ``phase`` is the mean of exp(2 pi i m) over pixel means m of ``frames`` frames."""
    true, bare = max(observed - 1 / 12, LEAST_NOISE_GREY**2 / 2), phase
    for _ in range(30):
        bare = phase / _phase_attenuation(true, bare, frames)
        bare /= max(1.0, abs(bare))
        q = float(np.exp(-2 * np.pi**2 * true))
        harmonic = (4 * true + 1 / np.pi**2) * q * bare.real + (q * bare.imag / np.pi) ** 2
        true = max(observed - 1 / 12 + harmonic, LEAST_NOISE_GREY**2 / 2)
    return true


def _phase_attenuation(variance: float, phase: complex, frames: int) -> complex:
    """Attenuation of exp(2 pi i mean) for the mean of n noisy, rounded frames."""
    # The n-th power of the rounded normal's characteristic function at 2 pi / n, onto which rounding folds the part at
    # 2 pi / n - 2 pi.
    t = 2 * np.pi / frames
    near = float(np.sin(t / 2) / (t / 2) * np.exp(-variance * t**2 / 2))
    folded = float(np.sin(t / 2) / (np.pi - t / 2) * np.exp(-variance * (2 * np.pi - t) ** 2 / 2))
    attenuation = (near + folded * phase.conjugate()) ** frames
    return attenuation if abs(attenuation) > FAINTEST else complex(FAINTEST)


def _line(points: list[_Point]) -> PhotonTransfer:
    light, variance, error = np.array([(point.light, point.variance, point.error) for point in points]).T
    if light.max() < LEAST_LIGHT_GREY:
        raise CalibrationError(
            f"frames for the noise must include some with {LEAST_LIGHT_GREY:g} grey levels of light or more; the "
            f"brightest had {light.max():.1f} (add flat-field frames)"
        )
    design = np.stack([np.ones_like(light), light], axis=1) / error[:, None]
    line, *_ = np.linalg.lstsq(design, variance / error, rcond=None)
    freedom = len(points) - 2
    misfit = float(np.sum((variance / error - design @ line) ** 2)) / max(freedom, 1)
    covariance = np.linalg.inv(design.T @ design)
    if freedom > 0 and misfit > scipy.stats.chi2.ppf(CHANCE, freedom) / freedom:
        covariance = covariance * misfit  # scatter beyond that of the number of pixels is an error, too
    if line[0] < LEAST_NOISE_GREY**2:
        raise CalibrationError(
            f"the read noise must be at least {LEAST_NOISE_GREY:g} grey levels to be seen through rounding; got a "
            f"variance of {line[0]:.3g} (raise the gain, or record more bits)"
        )
    read, slope = float(np.sqrt(line[0])), float(line[1])
    return PhotonTransfer(
        read_noise_grey=MeasuredValue(value=read, sd=float(np.sqrt(covariance[0, 0])) / (2 * read), unit="grey"),
        shot_noise_grey=MeasuredValue(value=slope, sd=float(np.sqrt(covariance[1, 1])), unit="grey"),
    )


def make_reference(
    dark: Sequence[TactileImage],
    untouched: Sequence[TactileImage],
    flats: Sequence[Sequence[TactileImage]] = (),
    *,
    patch_px: PixelBox | None = None,
    scenes: Sequence[Sequence[TactileImage]] = (),
) -> CameraReference:
    """Average frames into a reference, and measure the camera's noise.

    Raises `CalibrationError` when frames are too few, clip, or appear swapped (dark brighter than untouched), or when
    too many pixels are bad; `InputError` when the reference patch leaves the frame, has too few pixels, or is too dark;
    `ImageMismatchError` when the frames have different sizes or full scales.

    Parameters
    ----------
    dark
        Frames with the lamps off or the lens covered, 4 or more.
    untouched
        Frames of the untouched probe, the lamps on, 4 or more.
    flats
        4 or more frames for each level of light, of even contact with the whole face (or of another even light on
        the same path). Without them the light counts as even, and the noise follows from the untouched frames.
    patch_px
        Reference patch that shows the lamps past the probe: (left, top, right, bottom) in pixels, ends excluded.
    scenes
        4 or more frames of each still scene in any light, for the camera's noise alone.
    """
    groups = [_stack("dark", dark, least=LEAST_FRAMES), _stack("untouched", untouched, least=LEAST_FRAMES)]
    groups += [_stack("flats", level, least=LEAST_FRAMES) for level in flats]
    every = [image for level in (dark, untouched, *flats) for image in level]
    _stack("dark, untouched and flat frames", [dark[0], untouched[0], *(level[0] for level in flats)], least=2)
    full_scale, base = dark[0].full_scale, groups[0].mean(axis=0)
    patch = None if patch_px is None else ReferencePatch.from_px(patch_px)
    good = ~_bad(groups[0], groups[2:])
    lamps = _lamps_of(groups[1], base, patch, full_scale)
    light = ((groups[1] - base) / lamps[:, None, None]).mean(axis=0)
    if light.mean() < -1:
        raise CalibrationError(
            f"untouched frames must not be darker than dark ones; they are by {-light.mean():.1f} grey levels "
            "(were the two swapped?)"
        )
    base_single, light_single = _single(base), _single(light)
    field = good.copy()
    if patch is not None:
        # The press guard's limit uses the mean of the dark frame instead of its level in the patch.
        require_lit(float(patch.cut(base_single + light_single).mean()) - float(base_single.mean()), full_scale)
        patch.cut(field)[:] = False
    relative = _relative(groups[2:], base, light, field, patch)
    lit = [*groups[1:], *(_stack("scenes", scene, least=LEAST_FRAMES) for scene in scenes)]
    noise = photon_transfer(groups[0], lit, usable=field, full_scale=full_scale)
    patch_grey, lamp_sd = _patch_light(groups[1], base, patch, noise.shot_noise_grey.value)
    stray = light[field]
    scales = {image.mm_per_pixel for image in every}
    return CameraReference(
        dark_grey=base_single,
        untouched_grey=light_single,
        relative_light=_single(relative),
        usable=field & (relative >= LEAST_LIGHT),
        full_scale=full_scale,
        mm_per_pixel=scales.pop() if len(scales) == 1 else None,
        dark_frames=len(dark),
        untouched_frames=len(untouched),
        flat_frames=sum(len(level) for level in flats),
        read_noise_grey=noise.read_noise_grey,
        shot_noise_grey=noise.shot_noise_grey,
        stray_grey=MeasuredValue(value=float(stray.mean()), sd=float(stray.std() / np.sqrt(stray.size)), unit="grey"),
        patch_px=None if patch is None else patch.patch_px,
        patch_grey=patch_grey,
        lamp_sd=lamp_sd,
    )


def _single(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Round to single precision, finer than any noise here: files are half as large."""
    return values.astype(np.float32).astype(float)


def _lamps_of(
    frames: NDArray[np.float64], base: NDArray[np.float64], patch: ReferencePatch | None, full_scale: float
) -> NDArray[np.float64]:
    """Brightness of the lamps in each frame over their mean."""
    if patch is None:
        return np.ones(len(frames))
    patch.require_inside(base.shape)
    light = patch.cut(frames - base).mean(axis=(1, 2))
    require_lit(float(light.min()), full_scale)
    return np.asarray(light / light.mean())


def _patch_light(
    frames: NDArray[np.float64], base: NDArray[np.float64], patch: ReferencePatch | None, shot: float
) -> tuple[MeasuredValue | None, float]:
    """Mean light of the patch, and the relative standard deviation of one frame's lamp level."""
    if patch is None:
        return None, 0.0
    light = patch.cut(frames - base)
    mean, count = float(light.mean()), light[0].size
    sd = float(np.sqrt((shot * mean + READ_AND_ROUNDING) / count))
    return MeasuredValue(value=mean, sd=sd / float(np.sqrt(len(frames))), unit="grey"), sd / mean


def _bad(dark: NDArray[np.float64], flats: Sequence[NDArray[np.float64]]) -> NDArray[np.bool]:
    """Pixels that differ from their neighbours in the dark or in even light."""
    bad = _outliers(dark.mean(axis=0))
    for level in flats:
        bad |= _outliers(level.mean(axis=0))
    fraction = float(bad.mean())
    if fraction > MOST_BAD:
        raise CalibrationError(
            f"at most {MOST_BAD:.0%} of pixels may be hot or dead; got {fraction:.1%} (is light leaking?)"
        )
    return bad


def _outliers(mean: NDArray[np.float64]) -> NDArray[np.bool]:
    smooth = scipy.ndimage.median_filter(mean, 5, mode="nearest")
    residuals = mean - smooth
    spread = GAUSSIAN_MAD * float(np.median(np.abs(residuals - np.median(residuals))))
    return np.asarray(np.abs(residuals) > np.maximum(BAD_FACTOR * max(spread, 0.25), 0.15 * np.abs(smooth)))


def _relative(
    flats: Sequence[NDArray[np.float64]],
    base: NDArray[np.float64],
    untouched: NDArray[np.float64],
    field: NDArray[np.bool],
    patch: ReferencePatch | None,
) -> NDArray[np.float64]:
    """Light over the face relative to its mean over the good pixels; levels are weighted by their light."""
    total = np.zeros_like(base)
    for level in flats:
        lit = level - base
        if patch is not None:
            part = patch.cut(lit).mean(axis=(1, 2)) / patch.cut(untouched).mean()
            lit = lit / part[:, None, None]
        total += (lit - untouched).sum(axis=0)
    if not flats:
        return np.ones_like(base)
    mean = float(total[field].mean())
    if mean / sum(len(level) for level in flats) < 10:
        raise CalibrationError("flat-field frames must be brighter than untouched ones by 10 grey levels or more")
    # A map without pixel noise, which all later frames would inherit; only good pixels count.
    relative, weight = np.maximum(total / mean, 0.0), field.astype(float)
    weights, sums = (
        scipy.ndimage.gaussian_filter(part, SMOOTH_PX, mode="mirror") for part in (weight, weight * relative)
    )
    return np.where(field, sums / np.maximum(weights, 1e-9), relative)
