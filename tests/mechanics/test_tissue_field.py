"""Response of a press to a field of the tissue's modulus, against uniform changes, quadrature and a solid model."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import quad

import tsis
from tsis.mechanics import press
from tsis.mechanics.small_strain.linear_press import PressKernel
from tsis.mechanics.solid import press_solid
from tsis.mechanics.tissue_field import FieldMesh, TissueFieldResponse, field_factors, field_features
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from tsis.mechanics.tissue_field import FieldResponse

FLAT, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
INNER = 49  # of 61 radii: the inner 0.8 of the face


def response(probe: tsis.Probe, harmonic: int, inclusion: tuple[float, float, float] | None = None) -> FieldResponse:
    slab = TissueFieldResponse(probe, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, inclusion=inclusion)
    return slab.response(harmonic)


@pytest.mark.parametrize("probe", [FLAT, DOMED])
def test_a_uniform_field_is_a_change_of_the_modulus(probe: tsis.Probe) -> None:
    """The press is solved by condensation, on another mesh."""
    kernel = PressKernel(probe, thickness_mm=30.0, poisson=0.49, points=61)
    softer, stiffer = (kernel.covering(5.0 * np.exp(step)) for step in (-0.01, 0.01))
    found = response(probe, 0)
    parts = [(softer.unit, stiffer.unit, 0)]
    if softer.shape is not None and stiffer.shape is not None:
        parts.append((softer.shape, stiffer.shape, 1))
    for low, high, part in parts:
        for name, values in (
            ("pressure_kpa", found.pressure_kpa),
            ("face_displacement_mm", found.face_displacement_mm),
        ):
            expected = (getattr(high, name) - getattr(low, name))[:INNER] / 0.02
            difference = values[part].sum(axis=1)[:INNER] - expected
            assert np.sqrt((difference**2).mean()) < 0.02 * np.abs(expected).max()


def test_the_force_stays() -> None:
    radius, step = np.linspace(0.0, 12.0, 61), 0.2
    area = 2 * np.pi * radius * step  # integrals of the hat functions around the radii
    area[[0, -1]] = np.pi * step * np.array([step / 3, 12.0 - step / 3])
    found = response(DOMED, 0, (8.0, 5.0, 60.0)).pressure_kpa[0]
    assert np.abs(area @ found).max() < 1e-9 * (area @ np.abs(found)).max()


@pytest.mark.parametrize("harmonic", [0, 1, 3])
@pytest.mark.parametrize("length", [3.5, 8.0])
def test_covariances_are_those_of_an_isotropic_field(harmonic: int, length: float) -> None:
    """The reference integrates the correlation around the axis."""
    radius, depth = np.array([0.5, 4.0, 9.0, 6.0]), np.array([1.0, 3.0, 3.0, 12.0])
    (factor,) = field_factors(np.eye(4), [field_features(harmonic, length, radius, depth)], rank=4)
    found = factor @ factor.T
    for one in range(4):
        for other in range(4):
            square = radius[one] ** 2 + radius[other] ** 2 + (depth[one] - depth[other]) ** 2

            def along(angle: float, square: float = square, product: float = radius[one] * radius[other]) -> float:
                distance = square - 2 * product * np.cos(angle)
                return float(np.exp(-distance / (2 * length**2)) * np.cos(harmonic * angle))

            expected = quad(along, 0.0, 2 * np.pi)[0] / (np.pi if harmonic else 2 * np.pi)
            assert found[one, other] == pytest.approx(expected, abs=2e-3)


@pytest.mark.parametrize("length", [2.0, 5.0])
def test_factors_lose_nothing_that_frames_show(length: float) -> None:
    """Beside the covariance by all features; half as many directions lose 5 to 8 % of pressures and slopes."""
    slab = TissueFieldResponse(DOMED, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, mesh=FieldMesh(points=41))
    found, steepness = slab.response(0), np.gradient(np.eye(41), slab.radius_mm, axis=0)
    parts = zip(found.pressure_kpa, found.face_displacement_mm, strict=True)
    outputs = np.concatenate([part for pair in parts for part in pair])
    across, along = features = field_features(0, length, found.radius_mm, found.depth_mm)
    (factor,) = field_factors(outputs, [features], rank=16)
    root = np.concatenate([(outputs * wave) @ along.T for wave in across], axis=1)
    for part, seen in enumerate((np.eye(41), steepness) * 2):
        rows = slice(41 * part, 41 * (part + 1))
        expected = np.linalg.norm(seen @ root[rows], axis=1)[1:-1]
        assert np.linalg.norm(seen @ factor[rows], axis=1)[1:-1] == pytest.approx(expected, rel=2e-3)


def test_nothing_changes_where_the_field_is_zero() -> None:
    found = response(FLAT, 2)
    assert found.pressure_kpa.shape[1:] == (61, len(found.radius_mm))
    far = found.radius_mm > 40.0
    near = found.radius_mm < 12.0
    assert np.abs(found.pressure_kpa[0][:INNER, far]).sum() < 0.01 * np.abs(found.pressure_kpa[0][:INNER, near]).sum()


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "depth", "offset"), [(6.0, 3.0, 3.0), (8.0, 5.0, 5.0)])
def test_a_weak_lump_beside_the_axis_is_that_of_the_solid_model(diameter: float, depth: float, offset: float) -> None:
    """Eight harmonics of the lump's indicator, against NGSolve in three dimensions."""
    pytest.importorskip("ngsolve", reason="the solid model needs the extra fem3d")
    contrast = 0.1
    lump = Inclusion(
        diameter_mm=diameter, depth_mm=depth, young_kpa=5.0 * float(np.exp(contrast)), offset_mm=(offset, 0.0)
    )
    phantom = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=lump)
    solid = press_solid(FLAT, phantom, force_n=1.0)
    plain = press(FLAT, replace(phantom, inclusion=None), force_n=1.0).on_grid(solid.x_mm, solid.y_mm)
    slab = TissueFieldResponse(FLAT, young_kpa=5.0, thickness_mm=30.0, poisson=0.49)
    x, y = np.meshgrid(solid.x_mm, solid.y_mm)
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    change = np.zeros_like(x)
    for order in range(9):
        found = slab.response(order)
        height = (found.depth_mm - depth - diameter / 2) ** 2
        cosine = (found.radius_mm**2 + offset**2 + height - diameter**2 / 4) / (2 * found.radius_mm * offset)
        half = np.arccos(np.clip(cosine, -1.0, 1.0))  # of the arc inside the lump
        part = half / np.pi if order == 0 else 2 * np.sin(order * half) / (order * np.pi)
        profile = found.pressure_kpa[0] @ (contrast * part)
        change += np.interp(radius, slab.radius_mm, profile) * np.cos(order * angle)
    inside = radius < 9.6
    expected = (solid.pressure_kpa - plain.pressure_kpa)[inside]
    difference = change[inside] - expected
    assert np.sqrt((difference**2).mean()) < 0.08 * np.abs(expected).max()


@pytest.mark.parametrize("probe", [FLAT, DOMED])
def test_a_layer_through_the_whole_slab_is_another_slab(probe: tsis.Probe) -> None:
    """The press of stiffer tissue is solved by condensation, on another mesh."""
    kernel = PressKernel(probe, thickness_mm=30.0, poisson=0.49, points=61).covering(15.0)
    slab = TissueFieldResponse(probe, young_kpa=5.0, thickness_mm=30.0, poisson=0.49, layer=(30.0, 3.0))
    pressure, displacement = slab.press()
    for part, expected in enumerate([kernel.unit, kernel.shape]):
        if expected is None:
            assert np.all(pressure[part] == 0)
            continue
        for found, reference in (
            (pressure[part], expected.pressure_kpa),
            (displacement[part], expected.face_displacement_mm),
        ):
            difference = (found - reference)[:INNER]
            assert np.sqrt((difference**2).mean()) < 0.01 * np.abs(reference[:INNER]).max()
