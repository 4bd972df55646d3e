"""A frame in blocks: means over squares of pixels, and where they lie on the face.

Contact, tilt and stray light are wide, so that blocks show them as well as pixels do, with less noise and in a tenth of
the time. Clipping and the reference patch are looked at pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from tsis.calibration.lamps import LEAST_LIT, ReferencePatch
from tsis.errors import ImageMismatchError, InputError
from tsis.imaging import require_image, require_same_frame
from tsis.model import require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage


BLOCKS = 192  # blocks along the longer side: a contact of a tenth of the frame is still twenty blocks wide
RIM = 1.03  # of the face's radius: beyond it the lens brings no light of the contact
FEWEST = 20  # blocks of a quadrant with which its level is known


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameShape:
    """Size of a frame, and what its pixels mean.

    Attributes
    ----------
    rows, columns
        Pixels.
    full_scale
        Grey level at which the camera clips.
    axis_px
        Where the probe's axis meets the frame, (x, y) in pixels.
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
        rows, columns = image.grey.shape
        return cls(
            rows=rows,
            columns=columns,
            full_scale=image.full_scale,
            axis_px=image.axis(),
            mm_per_pixel=image.mm_per_pixel,
        )

    @property
    def by(self) -> int:
        """Pixels along a block's side."""
        return max(1, max(self.rows, self.columns) // BLOCKS)

    def means(self, pixels: NDArray[Any]) -> NDArray[np.float64]:
        """Mean grey level of each block; a rest of less than a block at the right and lower border is spread."""
        size = (max(1, self.columns // self.by), max(1, self.rows // self.by))
        grey = pixels.astype(np.float32, copy=False)  # OpenCV would round the means of whole numbers
        return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.float64)

    def positions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coordinates (x, y) of the blocks' columns and rows from the axis, in mm or pixels."""
        counts = (max(1, self.columns // self.by), max(1, self.rows // self.by))
        sizes = self.mm_per_pixel or (1.0, 1.0)
        x, y = (
            (((np.arange(count) + 0.5) * pixels / count - 0.5) - axis) * size
            for count, pixels, axis, size in zip(counts, (self.columns, self.rows), self.axis_px, sizes, strict=True)
        )
        return x, y

    def beyond_rim(self, radius: float) -> tuple[NDArray[np.bool], ...]:
        """Blocks of each quadrant beyond a face of that radius; quadrants that hold few are left out."""
        x, y = self.positions()
        far = np.hypot(x[None, :], y[:, None]) > RIM * radius
        parts = [far & ((x > 0) == right)[None, :] & ((y > 0) == low)[:, None] for right in (0, 1) for low in (0, 1)]
        return tuple(part for part in parts if np.count_nonzero(part) >= FEWEST)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuardReference:
    """What a press is compared with. Each part is optional, and lets the guard tell more.

    Parameters
    ----------
    untouched
        A frame of the probe that touches nothing: tells light from outside, and what a press adds.
    level
        A press held square on plain tissue: the tilt is told against it, as lamps of unequal power light a level press
        unevenly too. Taken as even when None.
    patch
        A part of the frame that the lamps light and no press reaches: tells the lamps' drift; needs ``untouched``.
    face_radius_mm
        Radius of the probe's face, mm, in [0.1, 1000]: beyond it nothing is touched. Without it, or where the scale is
        unknown, the darkest part of the frame is taken as untouched when it is a tenth of the frame or more.
    dark_grey
        What the camera reads without light, grey levels; None when nobody measured it.
    invert
        True for probes whose light falls where they are pressed; needs ``untouched``.

    Raises
    ------
    InputError
        When a part lacks what it needs or is of the wrong kind.
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
        for name, requested in (("patch", self.patch is not None), ("invert", self.invert)):
            if requested and self.untouched is None:
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
    """A reference in the blocks of one shape of frame, so that each frame costs little.

    Attributes
    ----------
    shape
        Of the frames.
    untouched
        Blocks of the untouched probe; None when there is none.
    sign
        1, or -1 for probes whose light falls where they are pressed.
    positions
        Coordinates (x, y) of the blocks' columns and rows.
    beyond_rim
        Blocks of each quadrant beyond the face's rim; empty where it is not known or not seen.
    patch, patch_before
        The reference patch and its level when untouched.
    dark_grey
        Level without light; None when unknown.
    level_tilt
        Gradient of a level press.
    """

    shape: FrameShape
    untouched: NDArray[np.float64] | None
    sign: float
    positions: tuple[NDArray[np.float64], NDArray[np.float64]]
    beyond_rim: tuple[NDArray[np.bool], ...]
    patch: ReferencePatch | None
    patch_before: float | None
    dark_grey: float | None
    level_tilt: tuple[float, float] = (0.0, 0.0)

    @property
    def least_lit(self) -> float:
        """Grey levels above dark from which a place counts as lit by the lamps."""
        return LEAST_LIT * self.shape.full_scale

    def patch_level(self, pixels: NDArray[Any]) -> float | None:
        """Mean of the reference patch; None without one."""
        if self.patch is None:
            return None
        return float(self.patch.cut(pixels).mean())

    def check_fits(self, pixels: NDArray[Any], full_scale: float) -> None:
        """Refuse a frame of another shape or depth."""
        requested = (self.shape.rows, self.shape.columns)
        if pixels.shape != requested or full_scale != self.shape.full_scale:
            raise ImageMismatchError(
                f"frames must keep the size {requested} and full scale {self.shape.full_scale:g} of the watch; got "
                f"{pixels.shape} and {full_scale:g}: begin a new watch for another mode"
            )
