"""Kernels of inclusions beside the axis and of tilts, beside what geometry and statics demand of them."""

from __future__ import annotations

import numpy as np
import pytest
from benchmarks.misplaced import SphereField, field_change, moved_change, tilt_change

import tsis
from tsis.mechanics import press
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse
from tsis.model.phantom import Inclusion

FLAT, PLAIN = tsis.load_probe("tsis-2011"), tsis.load_phantom("plain")
LUMP = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
AXIS = 0.5 * np.arange(-24, 25)
X, Y = np.meshgrid(AXIS, AXIS)
GRID = np.hypot(X, Y), np.arctan2(Y, X)


@pytest.fixture(scope="module")
def slab() -> TissueFieldResponse:
    return TissueFieldResponse(
        FLAT,
        young_kpa=PLAIN.young_kpa,
        thickness_mm=PLAIN.thickness_mm,
        poisson=PLAIN.poisson,
        mesh=FieldMesh(points=121),
    )


@pytest.mark.parametrize("offset_mm", [0.0, 1.0, 4.0])
def test_harmonics_of_a_sphere_add_up_to_it(offset_mm: float) -> None:
    sphere = SphereField(radius_mm=4.0, depth_mm=9.0, offset_mm=offset_mm, angle=0.7)
    radius, depth = (part.ravel() for part in np.meshgrid(np.linspace(0.05, 9.0, 180), np.linspace(4.0, 14.0, 201)))
    volume = 2 * np.pi * (radius * sphere.harmonic(0, radius, depth)[0]).sum() * (8.95 / 179) * 0.05
    assert volume == pytest.approx(4 / 3 * np.pi * 4.0**3, rel=2e-2)
    angle = np.linspace(0, 2 * np.pi, 7)
    value = sum(
        sphere.harmonic(order, radius, depth).T @ np.array([np.cos(order * angle), np.sin(order * angle)])
        for order in range(60)
    )
    away = np.sqrt(
        (radius[:, None] * np.cos(angle) - offset_mm * np.cos(0.7)) ** 2
        + (radius[:, None] * np.sin(angle) - offset_mm * np.sin(0.7)) ** 2
        + (depth[:, None] - 9.0) ** 2
    )
    assert np.median(np.abs(value[away < 3.0] - 1)) < 0.01
    assert np.median(np.abs(value[away > 5.0])) < 0.01


def test_an_inclusion_that_stays_on_the_axis_changes_nothing(slab: TissueFieldResponse) -> None:
    exact = tuple(
        press(FLAT, tsis.Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump), force_n=1.0)
        for lump in (LUMP, None)
    )
    response = slab.response(0)
    parts = SphereField.of(LUMP, 0.0, 0.0).harmonic(0, response.radius_mm, response.depth_mm)
    kernel = field_change(slab, 0, response, parts, GRID)[:, 0]
    change = moved_change((exact[0], exact[1]), (kernel, kernel), (0.0, 0.0), GRID)
    inside = GRID[0] < 0.9 * FLAT.radius_mm
    peak = np.abs(exact[0].face_displacement_mm - exact[1].face_displacement_mm).max()
    assert np.abs(change[1][inside]).max() < 0.01 * peak


def test_a_tilt_presses_one_side_and_adds_no_force(slab: TissueFieldResponse) -> None:
    inside = GRID[0] < 11.9  # rounding puts some points of the rim beyond it
    pressure, displacement = tilt_change(slab, 1.0, 0.0, GRID) * inside
    assert abs(pressure.sum()) < 1e-9 * np.abs(pressure).sum()
    assert (pressure * X).sum() > 0
    assert (displacement * X).sum() > 0
    twice = tilt_change(slab, 2.0, 0.0, GRID)[0] * inside
    np.testing.assert_allclose(twice, 2 * pressure)
