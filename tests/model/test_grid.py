from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.model.press import interpolation_matrix, require_ascending

if TYPE_CHECKING:
    from numpy.typing import NDArray

coordinates = st.lists(st.integers(-1000, 1000), min_size=2, max_size=20, unique=True).map(
    lambda places: np.sort(places) / 64.0
)
places = st.lists(st.floats(-20.0, 20.0), min_size=1, max_size=20).map(np.array)


@given(knots=coordinates, at=places, seed=st.integers(0, 2**32))
def test_weights_are_numpys_linear_interpolation(
    knots: NDArray[np.float64], at: NDArray[np.float64], seed: int
) -> None:
    values = np.random.default_rng(seed).standard_normal(len(knots))
    np.testing.assert_allclose(interpolation_matrix(knots, at) @ values, np.interp(at, knots, values), atol=1e-12)
    dark = np.interp(at, knots, values, left=0.0, right=0.0)
    np.testing.assert_allclose(interpolation_matrix(knots, at, outside="zero") @ values, dark, atol=1e-12)
    np.testing.assert_array_equal(interpolation_matrix(knots, knots).toarray(), np.eye(len(knots)))


def test_a_fine_grid_holds_two_weights_a_place() -> None:
    knots = np.linspace(-1.0, 1.0, 1001)
    assert interpolation_matrix(knots, np.linspace(-2.0, 2.0, 500)).nnz <= 1000


@pytest.mark.parametrize("values", [[1.0], [1.0, 1.0], [2.0, 1.0]])
def test_a_coordinate_that_does_not_ascend_is_refused(values: list[float]) -> None:
    with pytest.raises(InputError, match="x_mm must hold at least two ascending numbers"):
        require_ascending("x_mm", values)
