"""Force that is conserved, scale that does not matter, and what markers, weights and boxes may be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from tests.mechanics.gel.test_shear import SENSOR

from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.mechanics import solid
from tsis.mechanics.bench_tests import bonded_factor
from tsis.mechanics.finite_strain.soft_sphere import mesh_ball
from tsis.mechanics.gel.force import gel_force_scale
from tsis.mechanics.gel.shear import gel_shear
from tsis.mechanics.surrogate.finite_correction import correction_box
from tsis.mechanics.surrogate.polynomial import Box
from tsis.mechanics.surrogate.states import FACE_POINTS, row_of_field
from tsis.model.press import PressField


def presses(*forces_n: float) -> list[Any]:
    possible = np.array([0.5, 2.0])
    return [SimpleNamespace(force_n=force, samples_n=force * possible, problems=()) for force in forces_n]


def test_weights_scale_a_gels_forces_with_the_scatter_of_one_new_press() -> None:
    two = gel_force_scale(presses(1.0, 1.0), [np.exp(0.3), np.exp(0.1)])
    assert two.factor == pytest.approx(np.exp(0.2))
    assert two.relative_sd == pytest.approx(np.sqrt(0.02 * 1.5))  # variance 0.02 of two, and that of their mean
    assert gel_force_scale(presses(2.0), [1.0]).relative_sd == pytest.approx(0.1 * np.sqrt(2.0))
    for forces, known in ((presses(), []), (presses(1.0), [1.0, 2.0]), (presses(1.0, 2.0), [1.0])):
        with pytest.raises(InputError, match="known_n must give one force for each press"):
            gel_force_scale(forces, known)


def test_markers_far_from_the_contact_count_for_nothing() -> None:
    rng = np.random.default_rng(3)
    points = rng.uniform(-2.5, 2.5, (40, 2))
    moved = 0.02 * np.exp(-(points**2).sum(axis=1, keepdims=True) / 4) * [1.0, -0.5]
    far = np.array([[60.0, 0.0], [0.0, 70.0], [-80.0, 5.0]])
    alone, with_far = (
        gel_shear(at, shift, sensor=SENSOR, centre_mm=(0.0, 0.0), radius_mm=1.5, draws=20)
        for at, shift in ((points, moved), (np.vstack([points, far]), np.vstack([moved, np.full((3, 2), 0.3)])))
    )
    assert with_far.force_n == pytest.approx(alone.force_n, rel=1e-9)


def test_a_row_at_fewer_radii_carries_the_force_of_its_field() -> None:
    radius = np.linspace(0.0, 12.0, 241)
    pressure = 30.0 * np.sqrt(np.maximum(1 - (radius / 9) ** 2, 0.0)) + radius
    field = PressField(
        radius_mm=radius, face_displacement_mm=radius, pressure_kpa=pressure, approach_mm=1.0, force_n=1.0
    )
    row = row_of_field(field)[:FACE_POINTS]
    fine = np.linspace(0.0, 12.0, 20_001)
    coarse = np.interp(fine, np.linspace(0.0, 12.0, FACE_POINTS), row)
    expected = np.trapezoid(fine * np.interp(fine, radius, pressure), fine)
    assert np.trapezoid(fine * coarse, fine) == pytest.approx(expected, rel=1e-3)


def test_the_first_value_of_a_row_is_the_mean_over_its_hat_by_area() -> None:
    """Of a pressure ``r``: the integral of ``r (1 - r / h) r`` over that of ``(1 - r / h) r``, half of the step h."""
    radius = np.linspace(0.0, 12.0, 2401)
    field = PressField(radius_mm=radius, face_displacement_mm=radius, pressure_kpa=radius, approach_mm=1.0, force_n=1.0)
    assert row_of_field(field)[0] == pytest.approx(12.0 / (FACE_POINTS - 1) / 2, rel=0.02)


def test_the_box_of_a_correction_covers_the_box_that_is_asked_for() -> None:
    box = Box(depth_mm=(0.5, 12.0), young_kpa=(10.0, 60.0), tissue_young_kpa=(3.0, 5.0))  # shallower than shipped
    made = correction_box(load_probe("tsis-domed"), box)
    assert made.holds(box)
    assert made.contrast[1] == pytest.approx(1.05 * 60.0 / 3.0)


def test_the_stiffening_of_bonded_ends_does_not_depend_on_the_unit_of_length() -> None:
    expected = bonded_factor(20.0, 10.0, 0.4)
    assert [bonded_factor(200.0, 100.0, 0.4), bonded_factor(0.6, 0.3, 0.4)] == pytest.approx([expected] * 2, rel=1e-9)


def test_a_ball_has_the_rings_that_are_asked_for() -> None:
    ball, surface = mesh_ball(radius_mm=5.0, young_kpa=50.0, poisson=0.45, order=2, cells=3, rings=4)
    assert ball.patches[0].shape == (len(surface), 2 * 4 + 1)


def test_results_with_arrays_are_compared_by_identity() -> None:
    classes = [one for one in vars(solid).values() if getattr(one, "__module__", "") == solid.__name__]
    fields = {one: [str(field.type) for field in getattr(one, "__dataclass_fields__", {}).values()] for one in classes}
    with_arrays = [one for one, types in fields.items() if any("Floats" in kind for kind in types)]
    assert {one.__name__ for one in with_arrays} >= {"FaceChange"}
    assert {one.__eq__ for one in with_arrays} == {object.__eq__}
