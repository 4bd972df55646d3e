"""Frames of gel sensors as levels, and their change against the untouched sensor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
import skimage

from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.colour import largest_channel, require_pattern
from tsis.model.gel_sensor import GelSensor
from tsis.model.image import TactileImage
from tsis.model.require import require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


BLACK, GLARE = 3.0, 250.0  # levels of 255
MOST_CLIPPED = 0.5  # of the pixels
FOREIGN = 30.0  # median change of a reference of another sensor, levels
FEWEST_WITHOUT_REFERENCE = 8
MARKER_DARK = 0.75  # level of a marker over that of its surroundings


def gel_levels(frame: Any, sensor: GelSensor, *, what: str = "frame") -> NDArray[np.float64]:
    """A frame as levels on the scale 0 to 255, shape (rows, columns, channels): 3 under coloured lamps, else 1.

    Takes 8 and 16 bits (by the array's type), numbers up to 255, colour with or without alpha, or a `TactileImage`.

    Raises `InputError` when the frame is no picture, is black, or has no colour under coloured lamps;
    `ImageMismatchError` when the sensor has no frames of this size.
    """
    full, levels = 255.0, np.asarray(frame.grey if isinstance(frame, TactileImage) else frame)
    if isinstance(frame, TactileImage):
        full = frame.full_scale
    elif levels.dtype == np.uint16:
        full = float(2 ** (sensor.bits or _bits(levels, what)) - 1)
    levels = face_view(levels, sensor)
    if levels.ndim == 2:
        levels = levels[..., None]
    if levels.ndim != 3 or levels.shape[2] not in (1, 3, 4) or levels.dtype.kind not in "uif" or levels.size == 0:
        raise InputError(f"{what} must have the shape (rows, columns) or (rows, columns, 3); got {levels.shape}")
    sensor.require_frame(levels.shape[1], levels.shape[0])
    scaled = levels[..., :3].astype(np.float64) * (255.0 / full)
    low, high = float(scaled.min()), float(scaled.max())
    if not (low >= 0.0 and high <= 255.5):  # nor NaN
        raise InputError(f"{what} must have levels from 0 to 255, or 16 bits; got {low:g} to {high:g}")
    if high <= BLACK:
        raise InputError(f"{what} must be lit; got a black frame: switch the sensor's lamps on")
    darkest = -largest_channel(-scaled)
    if (clipped := float((darkest >= GLARE).mean())) > MOST_CLIPPED:
        raise InputError(f"{what} must not be saturated; got {clipped:.0%} white pixels: lower the exposure")
    if sensor.light == "white":
        return np.asarray(scaled.mean(axis=2, keepdims=True))
    if scaled.shape[2] == 1 or (largest_channel(scaled) - darkest).max() < 1.0:
        raise InputError(
            f"{what} must be in colour, because {sensor.name} has coloured lamps; got grey: save the camera's colours"
        )
    return scaled


def _bits(levels: NDArray[np.uint16], what: str) -> int:
    """Bits of a level in a file of 16: found where one number alone makes a lit frame."""
    highest = int(levels.max(initial=0))
    if highest >= 2**14 or highest <= BLACK:
        return 16
    if 2**10 <= highest < 2**12:  # of 16 bits it would be almost black, of 14 in the lowest quarter
        return 12
    raise InputError(
        f"{what} must tell its bits; its highest level {highest} fits 10, 12, 14 and 16 bits: give bits in the "
        "sensor's file (tsis sensor new --bits 12)"
    )


def face_view(frame: NDArray[Any], sensor: GelSensor) -> NDArray[Any]:
    """The frame warped to the face where it is one of the camera; others as they are."""
    if sensor.corners_px is None or frame.ndim not in (2, 3) or frame.shape[1::-1] != sensor.raw_px:
        return frame
    columns, rows = sensor.image_px
    corners = np.array([(0, 0), (columns - 1, 0), (columns - 1, rows - 1), (0, rows - 1)], float)
    places = np.array(sensor.corners_px, float)
    upright = skimage.transform.ProjectiveTransform.from_estimate(corners, places)  # type: ignore[no-untyped-call]
    channels = np.atleast_3d(frame).astype(np.float64)
    size = {"output_shape": (rows, columns), "preserve_range": True}
    warped = skimage.transform.warp(channels, upright, order=1, mode="edge", **size)  # type: ignore[no-untyped-call]
    stacked = warped.reshape(rows, columns, *frame.shape[2:])
    return np.asarray(np.rint(stacked).astype(frame.dtype) if frame.dtype.kind == "u" else stacked)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelChange:
    """The change of one frame.

    Attributes
    ----------
    change
        Levels less those of the reference and the drift of the lamps, shape (rows, columns, channels).
    usable, marker
        Pixels that are neither clipped nor glare nor marker; and those of markers.
    noise
        Standard deviation of a pixel in one channel, levels.
    """

    change: NDArray[np.float64]
    usable: NDArray[np.bool_]
    marker: NDArray[np.bool_]
    noise: float

    @property
    def glare_fraction(self) -> float:
        """Fraction of pixels that are clipped or glare."""
        return float(1.0 - (self.usable | self.marker).mean())


LIGHT_BLOCKS = (48, 64)  # rows and columns of the means by which the light is compared
GAMMA_PRIOR_SD = 0.15
LEAST_LIGHT_CHANGE = 0.05  # relative: a deep press darkens the border of a white-light frame by some per cent
LARGEST_GAIN, LARGEST_GAMMA = 1.5, 1.4  # or their inverse: beyond them a change of light is not corrected for
NEAR_PRESS = 0.5  # of the radius of what is pressed: how far around it blocks do not count
FEWEST_BLOCKS = 0.1  # of all that must show the light alone


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelLightChange:
    """How the light of a frame differs from an earlier one: ``frame = gain * earlier ** gamma`` on levels up to 1.

    Attributes
    ----------
    gain
        Of each channel: lamps, exposure, white balance.
    gamma, gamma_sd
        Exponent of the camera's curve, one for all channels, and its standard deviation.
    known
        Whether enough of the frame was untouched and lit to tell.
    """

    gain: NDArray[np.float64]
    gamma: float = 1.0
    gamma_sd: float = 0.0
    known: bool = True

    @property
    def is_small(self) -> bool:
        """Whether nothing has to be corrected."""
        return self.gamma == 1.0 and bool(np.all(np.abs(np.log(self.gain)) < LEAST_LIGHT_CHANGE))

    @property
    def is_large(self) -> bool:
        """Whether the change is beyond what a correction can do."""
        gain, gamma = np.abs(np.log(self.gain)).max(), abs(np.log(self.gamma))
        return not self.known or bool(gain > np.log(LARGEST_GAIN) or gamma > np.log(LARGEST_GAMMA))

    @property
    def relative_sd(self) -> float:
        """What is uncertain of a change of levels, relative: corrected, or too small to be."""
        if self.is_small:
            return float(np.abs(np.log(self.gain)).max()) / 2.0
        return float(np.hypot(0.05 * np.abs(np.log(self.gain)).max(), self.gamma_sd))

    def undone(self, levels: NDArray[Any]) -> NDArray[Any]:
        """The levels as they were in the earlier light."""
        if self.is_small:
            return levels
        scaled = np.maximum(levels, 0.0) / 255.0 / self.gain.astype(levels.dtype)
        return np.asarray(255.0 * scaled ** (1.0 / self.gamma), dtype=levels.dtype)


def light_change(levels: NDArray[Any], earlier: NDArray[Any], *, whole: bool = False) -> GelLightChange:
    """The change of light between two frames of one size, by what no press changed.

    The border of the frame, where nothing presses most of the time, begins; blocks that agree with it follow. With
    ``whole`` all of the frame is untouched.
    """
    now, before = (coarse_levels(part) for part in (levels, earlier))
    in_range = (now > 2 * BLACK) & (now < GLARE - 5) & (before > 2 * BLACK) & (before < GLARE - 5)
    lit: NDArray[np.bool_] = np.asarray(in_range.all(axis=2))
    nothing = GelLightChange(gain=np.ones(now.shape[2]), known=False)
    strip = np.ones(lit.shape, dtype=bool)
    margin = max(2, lit.shape[0] // 12)
    strip[margin:-margin, margin:-margin] = whole
    used = strip & lit
    if used.mean() < FEWEST_BLOCKS / 2:
        return nothing
    x, y = np.log(np.maximum(before, 1.0) / 255.0), np.log(np.maximum(now, 1.0) / np.maximum(before, 1.0))
    slope, level = 0.0, np.median(y[used], axis=0)
    for _ in range(6):
        left = y - level - slope * x
        spread = max(1.4826 * float(np.median(np.abs(left[used]))), 0.004)
        used = lit & (np.abs(left) < 2.5 * spread).all(axis=2)
        if not whole:
            used = _joined_to(_apart_from_presses(used, lit), strip)
        if used.mean() < FEWEST_BLOCKS:
            return nothing
        centred_x, centred_y = (part[used] - part[used].mean(axis=0) for part in (x, y))
        noise = max(float(np.var(centred_y - slope * centred_x)), 1e-6) * 9.0  # neighbours err together
        information = float(np.square(centred_x).sum()) / noise + GAMMA_PRIOR_SD**-2
        slope = float((centred_x * centred_y).sum()) / noise / information
        level = y[used].mean(axis=0) - slope * x[used].mean(axis=0)
    slope_sd = information**-0.5
    if abs(slope) < max(2.0 * slope_sd, LEAST_LIGHT_CHANGE):
        slope, level = 0.0, y[used].mean(axis=0)
    return GelLightChange(gain=np.exp(level), gamma=1.0 + slope, gamma_sd=slope_sd)


def _apart_from_presses(used: NDArray[np.bool_], lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The blocks without those around a press, whose slope falls outwards: they would agree with a false gamma."""
    pressed = scipy.ndimage.binary_opening(lit & ~used, iterations=2)
    near = max(1, round(NEAR_PRESS * float(np.sqrt(pressed.sum() / np.pi))))
    apart = used & ~scipy.ndimage.binary_dilation(pressed, iterations=near)
    return apart if apart.mean() >= FEWEST_BLOCKS else used


def coarse_levels(levels: NDArray[Any]) -> NDArray[np.float64]:
    """Means of `LIGHT_BLOCKS` blocks of a frame, or its pixels where it has fewer; shape (rows, columns, channels)."""
    rows, columns = (min(size, most) for size, most in zip(levels.shape, LIGHT_BLOCKS, strict=False))
    result = levels.astype(np.float64)
    for axis, count in enumerate((rows, columns)):
        starts = result.shape[axis] * np.arange(count) // count
        lengths = np.diff(np.append(starts, result.shape[axis]))
        result = np.add.reduceat(result, starts, axis=axis) / np.expand_dims(lengths, tuple({0, 1, 2} - {axis}))
    return result


def _joined_to(used: NDArray[np.bool_], strip: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The blocks that are joined to the border by others: the middle of a contact may agree by chance."""
    labels, count = scipy.ndimage.label(used)
    joined = np.unique(labels[strip & used])
    return np.asarray(np.isin(labels, joined[joined > 0])) if count else used


def gel_reference(frames: Sequence[Any], sensor: GelSensor, reference: Any | None) -> NDArray[np.float64]:
    """Levels of the untouched sensor: the reference, or the median of many frames pressed at different places."""
    require_type("sensor", sensor, GelSensor)
    if reference is not None:
        return gel_levels(reference, sensor, what="reference")
    if len(frames) < FEWEST_WITHOUT_REFERENCE:
        raise InputError(
            f"a reference must be given for fewer than {FEWEST_WITHOUT_REFERENCE} frames; got {len(frames)}: save a "
            "frame of the untouched sensor and give it as reference"
        )
    return np.asarray(np.median([gel_levels(frame, sensor) for frame in frames], axis=0))


def gel_change(
    levels: NDArray[np.float64], reference: NDArray[np.float64], sensor: GelSensor, *, what: str = "frame"
) -> GelChange:
    """The change of the `gel_levels` of a frame against those of the untouched sensor.

    Raises `ImageMismatchError` when sizes differ, or the reference is of another sensor or another light.
    """
    if levels.shape != reference.shape:
        raise ImageMismatchError(
            f"reference must have the size of {what}, {levels.shape[1]} x {levels.shape[0]} pixels; got "
            f"{reference.shape[1]} x {reference.shape[0]}"
        )
    change = levels - reference
    drift = np.median(change, axis=(0, 1))
    typical = float(np.median(largest_channel(np.abs(change - drift))))
    if max(typical, float(np.abs(drift).max()) / 2.0) > FOREIGN:
        raise ImageMismatchError(
            f"reference must be an untouched frame of the sensor that took {what}, under the same light; got one that "
            f"differs by {max(typical, float(np.abs(drift).max())):.0f} levels nearly everywhere"
        )
    require_pattern(levels, reference, what)
    light = light_change(levels, reference)
    if light.known and not light.is_small:
        change = light.undone(levels) - reference
        drift = np.median(change, axis=(0, 1))
    change -= drift
    brightest, lit = (largest_channel(pick(levels, reference)) for pick in (np.maximum, np.minimum))
    clipped = (brightest >= GLARE) | (lit <= BLACK)
    marker = np.zeros(clipped.shape, dtype=bool)
    if sensor.marker_pitch_mm is not None:
        marker = scipy.ndimage.binary_dilation(marker_pixels(levels, sensor) | marker_pixels(reference, sensor))
    fine = change - scipy.ndimage.gaussian_filter(change, (1.0, 1.0, 0.0))
    noise = 1.4826 * float(np.median(np.abs(fine))) / 0.92  # the blur takes a part of the noise along
    return GelChange(
        change=change,
        usable=~(scipy.ndimage.binary_dilation(clipped, iterations=2) | marker),
        marker=marker,
        noise=max(noise, 0.29),
    )


def marker_pixels(levels: NDArray[np.float64], sensor: GelSensor) -> NDArray[np.bool_]:
    """Pixels that are much darker than their surroundings of two pitches."""
    grey = levels.mean(axis=2)
    scale = sensor.scale_of(grey.shape[1], grey.shape[0])
    pitch = 10.0 if scale is None or sensor.marker_pitch_mm is None else sensor.marker_pitch_mm / scale[0]
    return np.asarray(grey < MARKER_DARK * scipy.ndimage.gaussian_filter(grey, pitch))
