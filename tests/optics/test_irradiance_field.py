"""The light on a dented face: interpolation, tilt and displacement, and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.model.errors import InputError
from tsis.optics import Irradiance

SLOPE = st.floats(-0.3, 0.3)


def light(**changes: Any) -> Irradiance:
    x, y = np.linspace(-2.0, 2.0, 5), np.linspace(-1.0, 1.0, 3)
    given: dict[str, Any] = {
        "x_mm": x,
        "y_mm": y,
        "relative": 1 + 0.1 * x + 0.2 * y[:, None],
        "flux_x": 0.5 * x + 0 * y[:, None],
        "flux_y": -0.5 * y[:, None] + 0 * x,
        "gamma_per_mm": 0.4,
        "error": 0.001,
    }
    return Irradiance(**(given | changes))


@given(x=st.floats(-2.0, 2.0), y=st.floats(-1.0, 1.0), along=SLOPE, across=SLOPE, moved=st.floats(0.0, 2.0))
def test_planes_are_followed_exactly(x: float, y: float, along: float, across: float, moved: float) -> None:
    found = light().at([x], [y], displacement_mm=moved, slope_x=along, slope_y=across).item()
    expected = (1 + 0.1 * x + 0.2 * y) * np.exp(0.4 * moved) * (1 + 0.5 * x * along - 0.5 * y * across)
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_face_turned_away_is_dark_and_the_edge_goes_on() -> None:
    assert light().at([2.0], [0.0], slope_x=-1.5).item() == 0.0
    assert light().at([9.0], [0.0]).item() == pytest.approx(1.2)


def test_uniform_light_ignores_the_face() -> None:
    rng = np.random.default_rng(3)
    moved, tilt = rng.normal(size=(2, 4, 6))
    found = Irradiance.uniform().at(np.arange(6.0), np.arange(4.0), displacement_mm=moved, slope_x=tilt, slope_y=tilt)
    np.testing.assert_array_equal(found, np.ones((4, 6)))


def test_single_precision_stays_single() -> None:
    moved = np.full((3, 5), 0.5, dtype=np.float32)
    found = light().at(np.linspace(-2, 2, 5), np.linspace(-1, 1, 3), displacement_mm=moved)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, light().relative * np.exp(0.2), rtol=1e-6)


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"x_mm": [0.0, 0.0, 1.0, 2.0, 3.0]}, "x_mm must hold at least two ascending"),
        ({"relative": np.ones((5, 3))}, "relative must have the shape (3, 5)"),
        ({"relative": np.full((3, 5), -1.0)}, "relative must lie in"),
        ({"flux_y": np.full((3, 5), np.nan)}, "flux_y must be finite"),
        ({"gamma_per_mm": np.inf}, "gamma_per_mm must lie in"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        light(**changes)
    assert phrase in str(refused.value)
