"""A frame in blocks: means over squares of pixels, and where they lie on the face.

Contact, tilt and stray light are wide, so that blocks show them as well as pixels do, with less noise and in a tenth of
the time. Clipping and the reference patch are looked at pixel by pixel.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import TactileImage

ACROSS = 192  # blocks along the longer side: a contact of a tenth of the frame is still twenty blocks wide
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
        return max(1, max(self.rows, self.columns) // ACROSS)

    def means(self, pixels: NDArray[Any]) -> NDArray[np.float64]:
        """Mean grey level of each block; a rest of less than a block at the right and lower border is spread."""
        size = (max(1, self.columns // self.by), max(1, self.rows // self.by))
        grey = pixels.astype(np.float32, copy=False)  # OpenCV would round the means of whole numbers
        return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA), dtype=np.float64)

    def places(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
        x, y = self.places()
        far = np.hypot(x[None, :], y[:, None]) > RIM * radius
        parts = [far & ((x > 0) == right)[None, :] & ((y > 0) == low)[:, None] for right in (0, 1) for low in (0, 1)]
        return tuple(part for part in parts if np.count_nonzero(part) >= FEWEST)
