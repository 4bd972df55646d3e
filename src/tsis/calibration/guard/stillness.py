"""Does the camera still look? A live sensor never delivers the same picture twice, for its noise."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

LEAST_NOISY = 0.01  # of the pixels: stuck ones of a black picture are fewer


@dataclass(frozen=True, slots=True, kw_only=True)
class RepeatedFrames:
    """How often in a row the same picture came.

    Attributes
    ----------
    checksum
        Of the newest picture's pixels; None before the first.
    in_a_row
        Number of frames, the newest one included, whose pixels are alike. Pictures that clip all but everywhere, black
        or white, are alike without being the same: each counts as the first.
    """

    checksum: int | None = None
    in_a_row: int = 0

    def with_picture(self, pixels: NDArray[Any]) -> RepeatedFrames:
        """The count with one picture more.

        Examples
        --------
        >>> still = RepeatedFrames()
        >>> grey, black = np.arange(9.0).reshape(3, 3), np.zeros((3, 3))
        >>> for picture in (grey, grey, grey):
        ...     still = still.with_picture(picture)
        >>> still.in_a_row, still.with_picture(black).with_picture(black).in_a_row
        (3, 1)
        """
        checksum = zlib.crc32(np.ascontiguousarray(pixels).data)
        again = checksum == self.checksum and _noisy(pixels)
        return RepeatedFrames(checksum=checksum, in_a_row=self.in_a_row + 1 if again else 1)


def _noisy(pixels: NDArray[Any]) -> bool:
    """Whether enough pixels lie between the picture's extremes, so that noise would show."""
    return bool(((pixels > pixels.min()) & (pixels < pixels.max())).mean() > LEAST_NOISY)
