"""Scaled conjugate gradients: Møller's minimiser, which needs gradients alone and searches along no line.

M. F. Møller, A scaled conjugate gradient algorithm for fast supervised learning, Neural Networks 6 (1993) 525-533. The
numbers in the comments are the steps of his algorithm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

FIRST_STEP, FIRST_DAMPING = 5e-5, 5e-7  # sigma and lambda_1; Møller asks for at most 1e-4 and 1e-6
GREATEST_DAMPING = 1e20  # beyond it no step changes a double any more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Descent:
    """Where a minimisation ended.

    Attributes
    ----------
    x, value
        The point, shape (n,), and the value there.
    iterations
        Steps tried, each of two gradients or one.
    reason
        ``"gradient"`` when it vanished, ``"stopped"`` by the caller, ``"damping"`` when rounding left no way down,
        ``"iterations"`` when they ran out.
    """

    x: NDArray[np.float64]
    value: float
    iterations: int
    reason: str


def scaled_conjugate_gradient(
    value_and_gradient: Callable[[NDArray[np.float64]], tuple[float, NDArray[np.float64]]],
    start: NDArray[np.float64],
    *,
    iterations: int = 1000,
    least_gradient: float = 1e-6,
    stop: Callable[[NDArray[np.float64]], bool] | None = None,
) -> Descent:
    """Minimise a smooth function from ``start`` downwards.

    Parameters
    ----------
    value_and_gradient
        The function and its gradient at a point of shape (n,).
    start
        Where to begin.
    iterations
        Steps at most, successful or not.
    least_gradient
        Norm of the gradient at which it is done.
    stop
        Called with each new point; True ends the descent there.

    Examples
    --------
    >>> found = scaled_conjugate_gradient(lambda x: (float(x @ x), 2 * x), np.array([3.0, -4.0]))
    >>> found.reason, bool(np.abs(found.x).max() < 1e-6)
    ('gradient', True)
    """
    x = np.array(start, dtype=np.float64)
    value, gradient = value_and_gradient(x)
    residual = -gradient
    direction = residual
    damping, raised = FIRST_DAMPING, 0.0
    success, curvature = True, 0.0
    for step in range(1, iterations + 1):
        norm2 = float(direction @ direction)
        if np.sqrt(residual @ residual) <= least_gradient or norm2 == 0.0:
            return Descent(x=x, value=value, iterations=step - 1, reason="gradient")
        if damping > GREATEST_DAMPING:
            return Descent(x=x, value=value, iterations=step - 1, reason="damping")
        if success:  # 2: curvature along the direction, by a difference of gradients
            short = FIRST_STEP / np.sqrt(norm2)
            curvature = float(direction @ (value_and_gradient(x + short * direction)[1] + residual)) / short
        curvature += (damping - raised) * norm2  # 3
        if curvature <= 0.0:  # 4: make it positive
            raised = 2.0 * (damping - curvature / norm2)
            curvature = damping * norm2 - curvature
            damping = raised
        slope = float(direction @ residual)  # 5
        trial = x + slope / curvature * direction
        trial_value, trial_gradient = value_and_gradient(trial)
        agreement = 2.0 * curvature * (value - trial_value) / slope**2  # 6: of the parabola with the function
        success = bool(agreement >= 0.0)
        if success:  # 7
            x, value, raised = trial, trial_value, 0.0
            if stop is not None and stop(x):
                return Descent(x=x, value=value, iterations=step, reason="stopped")
            before, residual = residual, -trial_gradient
            turn = 0.0 if step % x.size == 0 else float(residual @ (residual - before)) / slope
            direction = residual + turn * direction
            if agreement >= 0.75:
                damping /= 4.0
        else:
            raised = damping
        if not agreement >= 0.25:  # 8; a value that is no number counts as a failure
            damping += curvature * (1.0 - agreement) / norm2 if np.isfinite(agreement) else 3.0 * damping
    return Descent(x=x, value=value, iterations=iterations, reason="iterations")
