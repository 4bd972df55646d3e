"""What the guard reads of a frame against its reference.

Contact, tilt and stray light vary slowly, so blocks show them as well as pixels, with less noise and in a tenth of the
time. Clipping and the reference patch are read pixel by pixel.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.calibration.lamps import LEAST_LIT, ReferencePatch, require_lit
from tsis.errors import ImageMismatchError, InputError
from tsis.imaging.corrections import require_image, require_same_frame
from tsis.imaging.patch import NOISE_FACTOR, QUANTISATION, SMOOTH_PX, pixel_noise, smoothed
from tsis.imaging.pixels import block_means
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


BLOCKS = 192  # blocks along the longer side: a contact of a tenth of the frame is still twenty blocks wide
RIM = 1.03  # of the face's radius: the lens shows no light of the contact beyond it
FEWEST = 20  # blocks of a quadrant that give its level
COARSE = 4  # blocks along the side of a cell in the search for the darkest part
LOWEST = 0.05  # fraction of the frame whose median starts the search
LEAST_FRACTION = 0.1  # of the frame: a smaller dark part may be the foot of a contact that fills the frame
FOOT = 0.05  # of the peak: lower limit of the contact's light
BORDER_STEPS = 6  # of a bisection: to a sixtieth of the peak
MOST = 0.5  # of the frame's pixels: when more of them clip, the frame is saturated
LEAST_AREA = 9  # blocks: a smaller contact has no moments


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameShape:
    """Size and scale of a frame.

    Attributes
    ----------
    rows, columns
        Pixels.
    full_scale
        Grey level at which the camera clips.
    axis_px
        Position of the probe's axis in the frame, (x, y) in pixels.
    mm_per_pixel
        Size (x, y) of a pixel, mm; None when unknown, then lengths are in pixels.
    """

    rows: int
    columns: int
    full_scale: float
    axis_px: tuple[float, float]
    mm_per_pixel: tuple[float, float] | None

    @classmethod
    def of(cls, image: TactileImage) -> FrameShape:
        """Shape of a frame."""
        (rows, columns), scale = image.grey.shape, image.mm_per_pixel
        return cls(rows=rows, columns=columns, full_scale=image.full_scale, axis_px=image.axis(), mm_per_pixel=scale)

    @property
    def by(self) -> int:
        """Pixels along a block's side."""
        return max(1, max(self.rows, self.columns) // BLOCKS)

    @property
    def blocks(self) -> tuple[int, int]:
        """Number of blocks (x, y)."""
        return max(1, self.columns // self.by), max(1, self.rows // self.by)

    def means(self, pixels: NDArray[Any]) -> NDArray[np.float64]:
        """Mean grey level of each block; a remainder at the right and lower border is spread over the blocks."""
        return block_means(pixels, self.blocks[::-1])

    def positions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates (x, y) of the blocks' columns and rows from the axis, in mm or pixels."""
        pixels, sizes = (self.columns, self.rows), self.mm_per_pixel or (1.0, 1.0)
        x, y = (
            (((np.arange(count) + 0.5) * side / count - 0.5) - axis) * size
            for count, side, axis, size in zip(self.blocks, pixels, self.axis_px, sizes, strict=True)
        )
        return x, y

    def beyond_rim(self, radius: float) -> tuple[NDArray[np.bool], ...]:
        """Blocks of each quadrant beyond a face of that radius, without quadrants of few blocks."""
        x, y = self.positions()
        far = np.hypot(x[None, :], y[:, None]) > RIM * radius
        parts = [far & ((x > 0) == right)[None, :] & ((y > 0) == low)[:, None] for right in (0, 1) for low in (0, 1)]
        return tuple(part for part in parts if np.count_nonzero(part) >= FEWEST)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardReference:
    """Frames and values that a press is compared with. Each part is optional and enables more flags.

    Raises `InputError` when a part lacks its companion or has the wrong type; `ImageMismatchError` when the frames
    differ in size, scale or full scale.

    Parameters
    ----------
    untouched
        A frame of the untouched probe: shows light from outside, and the change by a press.
    level
        A level press on tissue without inclusion: the zero of the tilt, as lamps of unequal power light a level press
        unevenly too. Assumed even when None.
    patch
        A part of the frame that the lamps light outside every contact: shows the lamps' drift; needs ``untouched``.
    face_radius_mm
        Radius of the probe's face, mm, in [0.1, 1000]: the frame is untouched beyond it. Without it or the scale, the
        darkest part of the frame counts as untouched if it covers a tenth of the frame or more.
    dark_grey
        Camera level without light, grey levels; None when it was not measured.
    invert
        True for probes whose light falls where they are pressed; needs ``untouched``.
    """

    untouched: TactileImage | None = None
    level: TactileImage | None = None
    patch: ReferencePatch | None = None
    face_radius_mm: float | None = None
    dark_grey: float | None = None
    invert: bool = False

    def __post_init__(self) -> None:
        if self.untouched is not None:
            require_image("untouched", self.untouched)
        if self.level is not None:
            require_same_frame(self.level, self.untouched or self.level, "untouched")
        for name, present in (("patch", self.patch is not None), ("invert", self.invert)):
            if present and self.untouched is None:
                raise InputError(f"{name} needs a frame of the untouched probe to compare with; give untouched")
        if self.patch is not None:
            require_type("patch", self.patch, ReferencePatch)
            assert self.untouched is not None
            self.patch.of(self.untouched)  # inside the frame
        if self.face_radius_mm is not None:
            require_number("face_radius_mm", self.face_radius_mm, 0.1, 1000.0, hint="millimetres")
        if self.dark_grey is not None:
            require_number("dark_grey", self.dark_grey, 0.0, 65535.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """A reference averaged over the blocks of one frame shape; None where an input is missing."""

    shape: FrameShape
    untouched: NDArray[np.float64] | None  # blocks of the untouched probe
    sign: float  # -1 for probes whose light falls where they are pressed, else 1
    positions: tuple[NDArray[np.float64], NDArray[np.float64]]  # coordinates (x, y) of the blocks' columns and rows
    beyond_rim: tuple[NDArray[np.bool], ...]  # blocks of each quadrant beyond the face's rim, where known and visible
    patch: ReferencePatch | None
    patch_before: float | None  # level of the untouched patch
    dark_grey: float | None
    level_tilt: tuple[float, float] = (0.0, 0.0)  # gradient of a level press

    @property
    def least_lit(self) -> float:
        """Grey levels above dark from which a part counts as lit by the lamps."""
        return LEAST_LIT * self.shape.full_scale

    def patch_level(self, pixels: NDArray[Any]) -> float | None:
        """Mean of the reference patch; None without one."""
        return None if self.patch is None else float(self.patch.cut(pixels).mean())

    def check_fits(self, pixels: NDArray[Any], full_scale: float) -> None:
        """Refuse a frame of another shape or depth."""
        size = (self.shape.rows, self.shape.columns)
        if pixels.shape != size or full_scale != self.shape.full_scale:
            raise ImageMismatchError(
                f"frames must have the size {size} and full scale {self.shape.full_scale:g} of the watch; got "
                f"{pixels.shape} and {full_scale:g}: begin a new watch for another mode"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class OutsideLevel:
    """Levels outside the contact; None without an untouched frame or part.

    Where light from outside is uneven, ``before`` and ``since`` are those of the brightest quadrant.
    """

    level: float  # of the change of grey level; 0 or the lowest where no part is known to be untouched
    before: float | None = None  # of the untouched frame there, raw grey levels
    since: float | None = None  # its change since
    mean_grey: float | None = None  # of the frame itself there


def _level_outside(grey: NDArray[np.float64], change: NDArray[np.float64], prepared: Prepared) -> OutsideLevel:
    """Level beyond the face's rim where that is known, else in the darkest part of the change."""
    if prepared.beyond_rim:
        parts, level = prepared.beyond_rim, None
    else:
        level, dark = darkest(change)
        if dark is None:
            return OutsideLevel(level=level if prepared.untouched is None else 0.0)
        parts = (dark,)
    mean = float(np.mean([grey[part].mean() for part in parts]))
    levels = [float(np.median(change[part])) for part in parts]
    if prepared.untouched is None:
        return OutsideLevel(level=float(np.median(levels)), mean_grey=mean)
    added = [prepared.sign * level for level in levels]
    brightest = int(np.argmax(added))
    before = float(np.median(prepared.untouched[parts[brightest]]))
    return OutsideLevel(level=float(np.median(levels)), before=before, since=added[brightest], mean_grey=mean)


def darkest(change: NDArray[np.float64]) -> tuple[float, NDArray[np.bool] | None]:
    """Lowest level of a change, and the blocks at that level; None when they are too few to be untouched."""
    rows, columns = change.shape
    size = (max(1, columns // COARSE), max(1, rows // COARSE))
    coarse = block_means(change, size[::-1])
    lowest = float(np.quantile(coarse, LOWEST / 2))
    level = np.asarray(coarse <= lowest + 2 * NOISE_FACTOR * pixel_noise(change) / COARSE)
    if level.mean() < LEAST_FRACTION:
        return lowest, None
    nearest = (np.arange(pixels) * blocks // pixels for pixels, blocks in zip(change.shape, level.shape, strict=True))
    return lowest, level[np.ix_(*nearest)]


@dataclass(frozen=True, slots=True, kw_only=True)
class GuardReading:
    """Values of one frame; None when an input is missing."""

    force_n: float | None  # of the gauge
    full_scale: float  # grey level at which the camera clips
    contrast: float  # peak of the change above the untouched level, a fraction of full scale
    noise: float  # least contrast that stands out of the frame's noise, a fraction of full scale
    light: float  # mean change of grey level over the frame
    tilt: tuple[float, float] | None  # relative gradient (x, y) of brightness from the contact's centre to its edge
    off_centre: float | None  # distance of the contact's centre from the axis over the contact's radius
    saturated: float | None  # clipped fraction of the contact's pixels; of all where most clip, which hides the contact
    cropped: float | None  # level at which the contact's patch meets the frame's border, over the peak
    ambient_grey: float | None  # light from outside
    led_drift: float | None  # relative change of the lamps since the reference, signed
    outside_grey: float | None  # mean raw level outside the contact


def read_guard_frame(pixels: NDArray[Any], prepared: Prepared, *, force_n: float | None = None) -> GuardReading:
    """Read the raw grey levels of a frame of the shape that the reference was prepared for."""
    shape = prepared.shape
    grey = shape.means(pixels)
    untouched = prepared.untouched
    change = grey if untouched is None else prepared.sign * (grey - untouched)
    outside = _level_outside(grey, change, prepared)
    background = outside.level
    smooth = smoothed(change) - background
    row, column = np.unravel_index(int(np.argmax(smooth)), smooth.shape)
    peak = float(smooth[row, column])
    rounding = QUANTISATION / shape.by
    noise = NOISE_FACTOR * max(pixel_noise(change), rounding) / (2.0 * SMOOTH_PX * float(np.sqrt(np.pi)))
    drift, ambient = lamps_and_ambient(pixels, outside, prepared)
    tilt = off_centre = saturated = cropped = None
    clipped = pixels >= shape.full_scale
    everywhere = float(clipped.mean())
    if peak > noise:
        mask = _around((int(row), int(column)), smooth > max(noise, FOOT * peak))
        if np.count_nonzero(mask) >= LEAST_AREA:
            tilt, off_centre = _moments(smooth, mask, prepared)
            saturated = float(shape.means(clipped)[mask].mean()) if everywhere > 0 else 0.0
            cropped = _brightest_at_border(smooth, (int(row), int(column))) / peak
    if everywhere > MOST:
        saturated = everywhere
    return GuardReading(
        force_n=force_n,
        full_scale=shape.full_scale,
        contrast=peak / shape.full_scale,
        noise=noise / shape.full_scale,
        light=float(change.mean()) - background,
        tilt=tilt,
        off_centre=off_centre,
        saturated=saturated,
        cropped=cropped,
        ambient_grey=ambient,
        led_drift=drift,
        outside_grey=outside.mean_grey,
    )


def lamps_and_ambient(
    pixels: NDArray[Any], outside: OutsideLevel, prepared: Prepared
) -> tuple[float | None, float | None]:
    """Relative change of the lamps, and light from outside in grey levels; None when unknown.

    Lamps that brighten by r multiply the light that they give; light from outside adds the same a everywhere. A lit
    patch P and a darker part O, both untouched, separate the two: ``r = (P - O) / (P0 - O0)`` and
    ``a = O - dark - r (O0 - dark)``.
    """
    before, since, dark = outside.before, outside.since, prepared.dark_grey or 0.0
    patch, patch_before = prepared.patch_level(pixels), prepared.patch_before
    if before is None or since is None:
        if patch is None or patch_before is None:
            return None, None
        return (patch - dark) / (patch_before - dark) - 1.0, None
    if patch is not None and patch_before is not None:
        if patch_before - before < prepared.least_lit:  # no darker part to compare with
            return (patch - dark) / (patch_before - dark) - 1.0, None
        ratio = (patch - before - since) / (patch_before - before)
        return ratio - 1.0, before + since - dark - ratio * (before - dark)
    if prepared.dark_grey is not None and before - dark >= prepared.least_lit:
        return since / (before - dark), None  # lit by the lamps: one level cannot separate them from other light
    return None, since


def _around(position: tuple[int, int], above: NDArray[np.bool]) -> NDArray[np.bool]:
    """The connected part around a block."""
    labels = scipy.ndimage.label(above, np.ones((3, 3)))[0]
    return np.asarray(labels == labels[position])


def _brightest_at_border(smooth: NDArray[np.float64], position: tuple[int, int]) -> float:
    """Highest level at which the part around the peak touches the frame's border."""
    # The brightest light on the border would be wrong: the rim of a face wider than the frame shines there.
    low, high = 0.0, float(smooth[position])
    for _ in range(BORDER_STEPS):
        middle = (low + high) / 2
        part = _around(position, smooth > middle)
        touches = any(bool(edge.any()) for edge in (part[0], part[-1], part[:, 0], part[:, -1]))
        low, high = (middle, high) if touches else (low, middle)
    return high


def _moments(
    smooth: NDArray[np.float64], mask: NDArray[np.bool], prepared: Prepared
) -> tuple[tuple[float, float], float]:
    """Gradient of the brightness against that of a level press, and distance from the axis over the radius."""
    # Light b(r) (1 + g x / R) around the mask's centre has <x> = g <x²> / R, whatever its profile b.
    x, y = prepared.positions
    area, light = mask.astype(np.float64), np.where(mask, smooth, 0.0)
    pixels, total = area.sum(), light.sum()
    cell = abs((x[-1] - x[0]) / max(len(x) - 1, 1) * (y[-1] - y[0]) / max(len(y) - 1, 1))
    radius = float(np.sqrt(pixels * cell / np.pi))
    centre, gradient = [], []
    for axis, along in ((0, x), (1, y)):
        middle = float(area.sum(axis=axis) @ along / pixels)
        difference = along - middle
        weights = light.sum(axis=axis)
        second = max(float(weights @ difference**2), np.finfo(float).tiny * total)
        centre.append(middle)
        gradient.append(radius * float(weights @ difference) / second)
    level = prepared.level_tilt
    return (gradient[0] - level[0], gradient[1] - level[1]), math.hypot(*centre) / radius


def prepare_reference(reference: GuardReference, shape: FrameShape) -> Prepared:
    """Average a reference over the blocks of the frames.

    Raises `ImageMismatchError` when the reference's frames are of another size or depth; `InputError` when the
    reference patch is not lit.
    """
    untouched = reference.untouched
    size = (shape.rows, shape.columns)
    for frame in (untouched, reference.level):
        if frame is not None and (frame.grey.shape, frame.full_scale) != (size, shape.full_scale):
            raise ImageMismatchError(
                f"the reference must have the frames' size {size} and full scale "
                f"{shape.full_scale:g}; got {frame.grey.shape} and {frame.full_scale:g} (record both in one mode)"
            )
    rim = reference.face_radius_mm if shape.mm_per_pixel is not None else None
    prepared = Prepared(
        shape=shape,
        untouched=None if untouched is None else shape.means(untouched.grey),
        sign=-1.0 if reference.invert else 1.0,
        positions=shape.positions(),
        beyond_rim=() if rim is None else shape.beyond_rim(rim),
        patch=reference.patch,
        patch_before=None,
        dark_grey=reference.dark_grey,
    )
    if reference.patch is not None and untouched is not None:
        level = float(reference.patch.cut(untouched.grey).mean())
        require_lit(level - (reference.dark_grey or 0.0), shape.full_scale)
        prepared = replace(prepared, patch_before=level)
    if reference.level is None:
        return prepared
    tilt = read_guard_frame(reference.level.grey, prepared).tilt
    if tilt is None:
        raise InputError("the level press shows no contact; press the probe square on tissue without inclusion for it")
    return replace(prepared, level_tilt=tilt)
