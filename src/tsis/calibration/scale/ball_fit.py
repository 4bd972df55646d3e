"""The fit of a ball's shape to presses whose travels are known."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import least_squares

from tsis.calibration.scale.ball_press import left_by_polynomial

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.calibration.scale.ball_press import BallPress


def first_shape(
    presses: list[BallPress], travel: NDArray[np.float64], radius: float, ratio: float
) -> NDArray[np.float64]:
    """Starting values: log sizes x and y, and the shift (x, y) of each centre.

    At the level of the shallowest press's middle the deepest one is ``r`` wide, where the ball is higher by the travel.
    """
    shallow, deep = presses[int(np.argmin(travel))], presses[int(np.argmax(travel))]
    squares = shallow.x**2 + (ratio * shallow.y) ** 2
    level = float(np.median(shallow.grey[squares <= np.quantile(squares, 0.02)]))
    wide = deep.x**2 + (ratio * deep.y) ** 2
    near = np.argsort(np.abs(deep.grey - level))[: max(10, len(wide) // 50)]
    rise = float(np.ptp(travel))
    size = np.sqrt((2 * radius * rise - rise**2) / max(float(np.median(wide[near])), 1.0))
    return np.concatenate([np.log([size, size * ratio]), np.zeros(2 * len(presses))])


def fit_shape(
    presses: list[BallPress], travel: NDArray[np.float64], radius: float, *, first: NDArray[np.float64]
) -> Any:
    """Least squares of log sizes and shifts: SciPy's result, its ``x`` laid out as in `first_shape`."""
    grey = np.concatenate([press.grey for press in presses])

    def left(shape: NDArray[np.float64]) -> NDArray[np.float64]:
        return left_by_polynomial(_depths(presses, travel, radius, shape), grey)

    return least_squares(left, first, x_scale=np.concatenate([[0.01, 0.01], np.ones(len(first) - 2)]))


def _depths(
    presses: list[BallPress], travel: NDArray[np.float64], radius: float, shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Depth of each pixel of all presses, up to a constant."""
    size_x, size_y = np.exp(shape[:2])
    shifts = shape[2:].reshape(-1, 2)
    parts = []
    for press, reading, shift in zip(presses, travel, shifts, strict=True):
        squares = (size_x * (press.x - shift[0])) ** 2 + (size_y * (press.y - shift[1])) ** 2
        # Beyond the ball's equator, where only a search may stray, it falls on steadily.
        parts.append(
            reading - radius + np.sqrt(np.maximum(radius**2 - squares, 0.0)) - np.maximum(squares / radius**2 - 1, 0.0)
        )
    return np.concatenate(parts)


def shape_slopes(
    presses: list[BallPress], travel: NDArray[np.float64], radius: float, shape: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Change of the log sizes for 1 mm of each reading and of the radius, shape (presses + 1, 2)."""
    step = 0.01 * float(np.ptp(travel))
    rows = []
    for k in range(len(travel)):
        moved = travel.copy()
        moved[k] += step
        rows.append((fit_shape(presses, moved, radius, first=shape).x[:2] - shape[:2]) / step)
    rows.append((fit_shape(presses, travel, radius + step, first=shape).x[:2] - shape[:2]) / step)
    return np.array(rows)
