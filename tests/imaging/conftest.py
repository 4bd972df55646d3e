from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
import pytest

from tsis.model.image import TactileImage

if TYPE_CHECKING:
    from numpy.typing import NDArray

SUPERSAMPLING = 8


class DrawEllipse(Protocol):
    """Draws a filled ellipse of the face, in mm, with pixels that are partly covered at its edge."""

    def __call__(
        self,
        *,
        centre_mm: tuple[float, float] = (0.0, 0.0),
        semi_axes_mm: tuple[float, float] = (2.0, 2.0),
        angle_deg: float = 0.0,
        level: float = 100.0,
        mm_per_pixel: tuple[float, float] = (0.05, 0.05),
        shape: tuple[int, int] = (120, 160),
    ) -> TactileImage: ...


@pytest.fixture
def draw_ellipse() -> DrawEllipse:
    def drawn(
        *,
        centre_mm: tuple[float, float] = (0.0, 0.0),
        semi_axes_mm: tuple[float, float] = (2.0, 2.0),
        angle_deg: float = 0.0,
        level: float = 100.0,
        mm_per_pixel: tuple[float, float] = (0.05, 0.05),
        shape: tuple[int, int] = (120, 160),
    ) -> TactileImage:
        rows, columns = shape
        fine = (np.arange(SUPERSAMPLING) + 0.5) / SUPERSAMPLING - 0.5
        x = ((np.arange(columns)[:, None] + fine).ravel() - (columns - 1) / 2) * mm_per_pixel[0] - centre_mm[0]
        y = ((np.arange(rows)[:, None] + fine).ravel() - (rows - 1) / 2) * mm_per_pixel[1] - centre_mm[1]
        turn = np.radians(angle_deg)
        along = x[None] * np.cos(turn) + y[:, None] * np.sin(turn)
        across = -x[None] * np.sin(turn) + y[:, None] * np.cos(turn)
        inside = (along / semi_axes_mm[0]) ** 2 + (across / semi_axes_mm[1]) ** 2 <= 1.0
        blocks = inside.reshape(rows, SUPERSAMPLING, columns, SUPERSAMPLING)
        covered: NDArray[np.float64] = blocks.mean(axis=(1, 3))
        return TactileImage(grey=level * covered, mm_per_pixel=mm_per_pixel)

    return drawn
