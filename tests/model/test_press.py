"""Presses along the radius and over a grid: what they hold, what they refuse, and interpolation between them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import InputError
from tsis.imaging.rendering import render
from tsis.imaging.sensor import Sensor
from tsis.model.calibration import Calibration
from tsis.model.press import PressField, PressMap, interpolation_matrix, require_ascending

if TYPE_CHECKING:
    from numpy.typing import NDArray


RADIUS = np.linspace(0.0, 6.0, 61)
FIELD = PressField(
    radius_mm=RADIUS,
    face_displacement_mm=0.1 + 0.01 * RADIUS,
    pressure_kpa=2.0 - 0.05 * RADIUS**2,
    approach_mm=1.0,
    force_n=0.1,
)
AXIS = 0.1 * np.arange(-63, 64)


def test_a_field_on_a_grid_keeps_its_values() -> None:
    found = FIELD.on_grid(AXIS, AXIS[40:])
    assert found.pressure_kpa.shape == (87, 127)
    assert (found.approach_mm, found.force_n) == (1.0, 0.1)
    radius = np.hypot(found.x_mm[None, :], found.y_mm[:, None])
    inner = radius < 5.8
    np.testing.assert_allclose(found.face_displacement_mm[inner], 0.1 + 0.01 * radius[inner], rtol=1e-9)
    np.testing.assert_allclose(found.pressure_kpa[inner], 2.0 - 0.05 * radius[inner] ** 2, atol=5e-3)
    assert not found.face_displacement_mm[radius > 6.001].any()
    assert not found.pressure_kpa[radius > 6.1].any()


def test_pressures_on_a_grid_sum_up_to_the_force() -> None:
    exact = np.pi * (2.0 * 36.0 - 0.05 * 6.0**4 / 2)
    assert FIELD.on_grid(AXIS, AXIS).pressure_kpa.sum() * 0.01 == pytest.approx(exact, rel=1e-3)


def test_a_map_renders_as_the_field_it_comes_from() -> None:
    sensor, answer = Sensor(), Calibration(gain_grey_per_kpa=60.0, saturation_kpa=20.0)
    here, there = render(FIELD, sensor, answer), render(FIELD.on_grid(AXIS, AXIS), sensor, answer)
    inner = sensor.radius_mm() < 5.7
    np.testing.assert_allclose(there[inner], here[inner], atol=0.3)
    assert not there[sensor.radius_mm() > 6.6].any()


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"x_mm": [0.0, 1.0]}, r"face_displacement_mm must have the shape \(2, 2\) of y_mm and x_mm; got \(2, 3\)"),
        ({"y_mm": [1.0, 0.0]}, r"y_mm must hold at least two ascending numbers; got \[1.0, 0.0\]"),
        ({"y_mm": [1.0]}, "y_mm must hold at least two ascending numbers"),
        ({"pressure_kpa": np.full((2, 3), np.nan)}, "pressure_kpa must be finite"),
    ],
)
def test_what_a_map_refuses(given: dict[str, Any], phrase: str) -> None:
    values: dict[str, Any] = {
        "x_mm": [0.0, 1.0, 2.0],
        "y_mm": [0.0, 1.0],
        "face_displacement_mm": np.zeros((2, 3)),
        "pressure_kpa": np.zeros((2, 3)),
    }
    with pytest.raises(InputError, match=phrase):
        PressMap(**{**values, **given}, approach_mm=0.0, force_n=0.0)


def test_a_map_is_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        FIELD.on_grid(AXIS, AXIS).pressure_kpa[0, 0] = 1.0


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


def test_a_press_field_keeps_read_only_profiles() -> None:
    profile = np.linspace(0.0, 1.0, 5)
    field = PressField(
        radius_mm=profile, face_displacement_mm=profile, pressure_kpa=profile, approach_mm=1.0, force_n=0.5
    )
    profile[:] = 9.0
    np.testing.assert_array_equal(field.radius_mm, np.linspace(0.0, 1.0, 5))
    with pytest.raises(ValueError, match="read-only"):
        field.pressure_kpa[0] = 1.0
    with pytest.raises(InputError, match="pressure_kpa must be finite"):
        replace(field, pressure_kpa=np.array([np.nan]))
