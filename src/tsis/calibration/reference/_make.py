"""Compute a `CameraReference` from dark, untouched and flat frames: means, bad pixels, light pattern and noise."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import gaussian_filter, median_filter

from tsis.calibration._measured import MeasuredValue
from tsis.calibration.lamps import ReferencePatch, require_lit
from tsis.calibration.reference._noise import photon_transfer, stack
from tsis.calibration.reference._value import LEAST_LIGHT, CameraReference
from tsis.errors import CalibrationError
from tsis.imaging import GAUSSIAN_MAD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.calibration.lamps import PixelBox
    from tsis.model import TactileImage


LEAST_FRAMES = 4
BAD_FACTOR = 8.0  # robust standard deviations at which a pixel counts as hot or dead
MOST_BAD = 0.02  # largest fraction of bad pixels
SMOOTH_PX = 2.0  # finest variation of the light behind a lens
READ_AND_ROUNDING = 0.5  # variance of a pixel without light; photons in a bright patch add many times as much


def make_reference(
    dark: Sequence[TactileImage],
    untouched: Sequence[TactileImage],
    flats: Sequence[Sequence[TactileImage]] = (),
    *,
    patch_px: PixelBox | None = None,
    scenes: Sequence[Sequence[TactileImage]] = (),
) -> CameraReference:
    """Average frames into a reference, and measure the camera's noise.

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

    Raises
    ------
    CalibrationError
        When frames are too few, clip, or appear swapped (dark brighter than untouched), or when too many pixels are
        bad.
    InputError
        When the reference patch leaves the frame, has too few pixels, or is too dark.
    ImageMismatchError
        When the frames have different sizes or full scales.
    """
    groups = [stack("dark", dark, least=LEAST_FRAMES), stack("untouched", untouched, least=LEAST_FRAMES)]
    groups += [stack("flats", level, least=LEAST_FRAMES) for level in flats]
    every = [image for level in (dark, untouched, *flats) for image in level]
    stack("dark, untouched and flat frames", [dark[0], untouched[0], *(level[0] for level in flats)], least=2)
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
    lit = [*groups[1:], *(stack("scenes", scene, least=LEAST_FRAMES) for scene in scenes)]
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
    smooth = median_filter(mean, 5, mode="nearest")
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
    weights, sums = (gaussian_filter(part, SMOOTH_PX, mode="mirror") for part in (weight, weight * relative))
    return np.where(field, sums / np.maximum(weights, 1e-9), relative)
