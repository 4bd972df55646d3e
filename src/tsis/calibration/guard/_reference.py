"""Guard references, and frames in blocks: means over squares of pixels, and their positions on the face.

Contact, tilt and stray light vary slowly, so blocks show them as well as pixels, with less noise and in a tenth of the
time. Clipping and the reference patch are read pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.lamps import LEAST_LIT, ReferencePatch
from tsis.errors import ImageMismatchError, InputError
from tsis.imaging import block_means, require_image, require_same_frame
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.image import TactileImage


BLOCKS = 192  # blocks along the longer side: a contact of a tenth of the frame is still twenty blocks wide
RIM = 1.03  # of the face's radius: the lens shows no light of the contact beyond it
FEWEST = 20  # blocks of a quadrant that give its level


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

    Raises
    ------
    InputError
        When a part lacks its companion or has the wrong type.
    ImageMismatchError
        When the frames differ in size, scale or full scale.
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
