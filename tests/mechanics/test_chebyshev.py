"""Interpolation at Chebyshev points against polynomials that numpy evaluates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.mechanics.surrogate.polynomial import chebyshev_points, chebyshev_weights

INTERVAL = (4.0, 12.0)


@pytest.mark.parametrize("count", [1, 2, 3, 7, 11])
def test_points_are_the_roots_of_the_chebyshev_polynomial(count: int) -> None:
    found = chebyshev_points(INTERVAL, count)
    basis = np.polynomial.Chebyshev.basis(count, domain=INTERVAL)
    np.testing.assert_allclose(found, np.sort(np.real(basis.roots())), rtol=1e-9)
    assert INTERVAL[0] < found.min() <= found.max() < INTERVAL[1]


@given(
    coefficients=st.lists(st.floats(-10.0, 10.0), min_size=1, max_size=12),
    x=st.lists(st.floats(*INTERVAL), min_size=1, max_size=20),
)
def test_polynomials_are_reproduced(coefficients: list[float], x: list[float]) -> None:
    given = np.polynomial.Chebyshev(coefficients, domain=INTERVAL)
    matrix = chebyshev_weights(INTERVAL, len(coefficients), np.array(x))
    values = matrix @ given(chebyshev_points(INTERVAL, len(coefficients)))
    np.testing.assert_allclose(values, given(np.array(x)), atol=1e-11 * (1 + np.abs(coefficients).sum()))


def test_agrees_with_numpys_own_interpolation_of_a_smooth_function() -> None:
    x = np.linspace(*INTERVAL, 50)
    peer = np.polynomial.Chebyshev.interpolate(lambda t: np.exp(-t / 3) * np.sin(t), 8, domain=INTERVAL)
    nodes = chebyshev_points(INTERVAL, 9)
    np.testing.assert_allclose(
        chebyshev_weights(INTERVAL, 9, x) @ (np.exp(-nodes / 3) * np.sin(nodes)), peer(x), atol=1e-13
    )


def test_weights_sum_to_one() -> None:
    assert chebyshev_weights(INTERVAL, 6, np.array([3.0, 5.0, 12.0])).sum(axis=1) == pytest.approx(1.0)
