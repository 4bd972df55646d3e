"""The normal equations of every method, beside a solver of least squares that never forms them."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.matching.methods import ridge_solution


@pytest.mark.parametrize("ridge", [0.3, np.array([0.3, 2.0, 1e-3, 0.5, 1.0])])
def test_a_ridge_is_least_squares_with_a_row_more_a_coordinate(ridge: float | np.ndarray) -> None:
    rng = np.random.default_rng(5)
    design, values = rng.normal(size=(40, 5)), rng.normal(size=(40, 2))
    rows = np.vstack([design, np.diag(np.sqrt(np.broadcast_to(ridge, 5)))])
    expected, *_ = np.linalg.lstsq(rows, np.vstack([values, np.zeros((5, 2))]))
    found = ridge_solution(design.T @ design, design.T @ values, ridge)
    np.testing.assert_allclose(found, expected, rtol=1e-11)
