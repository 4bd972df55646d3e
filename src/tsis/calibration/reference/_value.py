"""Dark frame, flat field and untouched probe: the correction of every later frame of the camera."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.lamps import PixelBox, ReferencePatch
from tsis.errors import ImageMismatchError, InputError
from tsis.imaging import SCALE_TOLERANCE, block_means, require_image
from tsis.model.content import ContentValue
from tsis.model.image import require_pixel_scale
from tsis.model.require import require_array, require_integer, require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


LEAST_LIGHT = 0.2  # of the mean: darker pixels are not divided by
SATURATED_FRACTION = 1e-4  # of the good pixels that may clip
LAMP_RANGE = (0.8, 1.25)  # of the light at the reference; warm lamps stay within it
LAMPS_OFF = 0.5  # of the untouched light
SIGNATURE_BLOCKS = (12, 16)  # rows and columns in which the light of the untouched probe is compared
SIGNATURE = 0.1  # root mean square difference of that light, relative
SIGNATURE_NOISE = 4e-3  # the same of the full scale, for probes that are nearly dark without contact
UNSEEN_DRIFT = 0.01  # of the lamps, assumed without a reference patch


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

        Raises
        ------
        ImageMismatchError
            When the remaining difference is above `SIGNATURE` of the light, or the frame has another size or scale.
        InputError
            When the lamps changed.
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
