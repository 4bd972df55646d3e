"""The finite elements against presses that have an exact answer, and against an independent code.

The code is NGSolve 6.2: fifth-order triangles, 18,360 unknowns, graded towards the edge of the contact, the
frictionless tie by a penalty of 1e5 kPa/mm; tissue cut off at 120 mm. Ring means of the pressure in kPa at 1 N.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.mechanics.closed_forms import (
    bonded_layer_ratio,
    hertz,
    oedometric_modulus_kpa,
    punch_pressure_kpa,
    punch_stiffness,
    sphere_in_uniaxial_stress,
)

from tsis.catalog.probes import load_probe
from tsis.mechanics import press
from tsis.mechanics.closed_forms import effective_modulus_kpa
from tsis.mechanics.mesh import Spheroid, mesh_around, mesh_inside, mesh_rectangle, refine
from tsis.mechanics.small_strain.slab import FIXED, Resolution, Slab, condense_layers, face_of, probe_compliance
from tsis.mechanics.small_strain.unilateral import unilateral_contact
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from numpy.typing import NDArray


LAYERS = ((2.0, 140.0), (3.0, 80.0), (5.0, 34.0))
RADIUS = 12.0


def test_a_stack_that_may_slide_has_the_effective_modulus() -> None:
    """With Poisson's ratio 0 nothing moves sideways, so that bonding does not matter: (3.78)."""
    layers = tuple(Layer(thickness_mm=t, young_kpa=e, poisson=0.0) for t, e in LAYERS)
    face = face_of(RADIUS, Resolution())
    compliance = probe_compliance(Probe(radius_mm=RADIUS, layers=layers), face, Resolution())
    stiffness = np.linalg.inv(compliance).sum()
    modulus = stiffness * 10.0 / (np.pi * RADIUS**2)
    assert modulus == pytest.approx(effective_modulus_kpa(layers), rel=1e-6)


def test_confined_compression_of_the_stack() -> None:
    layers = [Layer(thickness_mm=t, young_kpa=e, poisson=0.49) for t, e in LAYERS]
    depth = np.cumsum([0.0, *(layer.thickness_mm for layer in layers)])
    body = mesh_rectangle(np.linspace(0.0, RADIUS, 4), depth, 3, a_is_radius=True)
    rows, columns, _ = body.nodes.shape
    dofs = 1 + np.arange(rows * columns * 2).reshape(rows, columns, 2)
    dofs[:, 0, 1] = 0  # the upper face moves as one
    dofs[:, -1] = FIXED
    dofs[[0, -1], :, 0] = FIXED  # the axis, and walls that hold the side
    young, poisson = (np.array([getattr(layer, name) for layer in layers]) for name in ("young_kpa", "poisson"))
    top = np.array([0])
    stiffness = condense_layers(body, dofs, retain=top, young_kpa=young, poisson=poisson).restrict(top).stiffness[0, 0]
    modulus = stiffness * 10.0 / (np.pi * RADIUS**2)
    assert modulus == pytest.approx(860.7, rel=1e-4)
    softness = sum(t / oedometric_modulus_kpa(young_kpa=e, poisson=0.49) for t, e in LAYERS)
    assert modulus == pytest.approx(sum(t for t, _ in LAYERS) / softness, rel=1e-9)


def slab_stiffness(thickness_mm: float, poisson: float) -> NDArray[np.float64]:
    slab = Slab(
        thickness_mm=thickness_mm,
        poisson=poisson,
        face=face_of(RADIUS, Resolution()),
        block_mm=0.8 * RADIUS,
        resolution=Resolution(),
    )
    return np.asarray(np.linalg.inv(slab.compliance), dtype=float)


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_rigid_flat_punch_on_a_very_thick_slab(poisson: float) -> None:
    stiffness = slab_stiffness(100 * RADIUS, poisson)
    punch = punch_stiffness(radius_mm=RADIUS, young_kpa=1.0, poisson=poisson)
    layer = bonded_layer_ratio(0.01, poisson=poisson)
    assert stiffness.sum() / punch == pytest.approx(layer, rel=0.002)
    assert stiffness.sum() / (layer * punch) == pytest.approx(1.0, abs=0.005)


def test_pressure_under_the_punch() -> None:
    face = face_of(RADIUS, Resolution())
    force = slab_stiffness(100 * RADIUS, 0.49).sum(axis=1)
    pressure = np.linalg.solve(face.mass(), force)
    radius = np.linspace(0.0, 0.9 * RADIUS, 50)
    exact = punch_pressure_kpa(radius, punch_radius_mm=RADIUS, force_mn=float(force.sum()))
    np.testing.assert_allclose(face.interpolation(radius) @ pressure, exact, rtol=0.005)


@pytest.mark.parametrize("share", [0.2, 0.4, 1.0, 2.0])
@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_bonded_layer_under_a_flat_punch(share: float, poisson: float) -> None:
    stiffness = slab_stiffness(RADIUS / share, poisson).sum()
    punch = punch_stiffness(radius_mm=RADIUS, young_kpa=1.0, poisson=poisson)
    assert stiffness / punch == pytest.approx(bonded_layer_ratio(share, poisson=poisson), rel=0.002)


@pytest.mark.parametrize(("poisson", "force", "peak"), [(0.3, 8.1907, 0.7822), (0.49, 9.8086, 0.9367)])
def test_hertz(poisson: float, force: float, peak: float) -> None:
    """A rigid sphere of 10 mm, 0.5 mm deep in 5 kPa: the contact opens, on a face much wider than it."""
    reach, even = 3.0, Resolution(order=2, edge=0.02, growth=1.5, largest=0.03)
    slab = Slab(thickness_mm=1000.0, poisson=poisson, face=face_of(reach, even), block_mm=2.0, resolution=even)
    nodal, found = unilateral_contact(slab.compliance / 5.0, slab.face.radius_mm**2 / 20.0, 0.5)
    exact = hertz(radius_mm=10.0, indentation_mm=0.5, young_kpa=5.0, poisson=poisson)
    assert nodal.sum() == pytest.approx(force, rel=0.01)
    assert slab.face.radius_mm[found.closed].max() == pytest.approx(exact.contact_radius_mm, rel=0.02)
    pressure = np.linalg.solve(slab.face.mass(), nodal)
    inner = slab.face.radius_mm < 0.8 * exact.contact_radius_mm
    np.testing.assert_allclose(pressure[inner], exact.pressure_kpa(slab.face.radius_mm[inner]), rtol=0.01)
    assert pressure[0] == pytest.approx(peak, rel=0.01)


@dataclass(frozen=True)
class Ball:
    stress_ratio: float
    strain_ratio: float
    unevenness: float


def pulled_cylinder(contrast: float, poisson: float) -> Ball:
    """A sphere of 1 mm radius in a cylinder 60 mm wide and high between smooth plates."""
    half, order = 30.0, 6
    lines = np.concatenate([[0.0], half * 2.0 ** np.arange(-3.0, 1.0)])
    depth = np.concatenate([half - lines[::-1], half + lines[1:]])
    top, side = refine(lines, order), refine(depth, order)
    boundary = np.concatenate(
        [
            np.column_stack([top, np.zeros_like(top)]),
            np.column_stack([np.full_like(side, half), side])[1:],
            np.column_stack([top[::-1], np.full_like(top, 2 * half)])[1:],
        ]
    )
    ball_shape = Spheroid(centre_depth=half, half_width=1.0, half_height=1.0)
    outer = mesh_around(boundary, ball_shape, order, layers=7)
    inner = mesh_inside(boundary, ball_shape, order, layers=1)
    count, layers, _ = outer.nodes.shape
    dofs = 1 + np.arange(count * layers * 2).reshape(count, layers, 2)
    dofs[boundary[:, 1] == 0.0, 0, 1] = 0
    dofs[boundary[:, 1] == 2 * half, 0, 1] = FIXED
    dofs[[0, -1], :, 0] = FIXED
    core = int(dofs.max()) + 1 + np.arange(count * inner.nodes.shape[1] * 2).reshape(count, -1, 2)
    core[:, 0, 0], core[:, 0, 1] = FIXED, core[0, 0, 1]
    core[[0, -1], :, 0] = FIXED
    core[:, -1] = dofs[:, -1]

    def material(value: float, layers: int) -> NDArray[np.float64]:
        return np.full(layers, value)

    top_dof = np.array([0])
    around = condense_layers(
        outer,
        dofs,
        retain=top_dof,
        young_kpa=material(1.0, outer.layers),
        poisson=material(poisson, outer.layers),
    )
    ball = condense_layers(
        inner,
        core,
        retain=np.zeros(0, dtype=np.int64),
        young_kpa=material(contrast, inner.layers),
        poisson=material(poisson, inner.layers),
    )
    whole = around + ball
    force = np.where(whole.dofs == 0, np.pi * half**2, 0.0)  # a far stress of 1 kPa, compressing
    moved = np.linalg.solve(whole.stiffness, force)
    moved = np.append(moved, 0.0)  # what FIXED, the last, moves
    place = np.searchsorted(whole.dofs, dofs[:, -1])
    sphere = moved[np.where(dofs[:, -1] == FIXED, len(whole.dofs), place)]
    r, z = outer.nodes[:, -1, 0], outer.nodes[:, -1, 1] - half
    sideways = float(r @ sphere[:, 0] / (r @ r))
    line = np.polynomial.Polynomial.fit(z, sphere[:, 1], 1, domain=[-1, 1])
    along = float(line.coef[1])
    shear, lame = contrast / (2 * (1 + poisson)), contrast * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return Ball(
        stress_ratio=-(lame * (2 * sideways + along) + 2 * shear * along),
        strain_ratio=-along,
        unevenness=float(np.abs(np.concatenate([sphere[:, 0] - sideways * r, sphere[:, 1] - line(z)])).max()),
    )


@pytest.mark.parametrize(
    ("contrast", "poisson", "stress"), [(20.0, 0.49, 1.87451), (8.0, 0.49, 1.73126), (20.0, 0.3, 1.84940)]
)
def test_sphere_in_uniaxial_stress(contrast: float, poisson: float, stress: float) -> None:
    found = pulled_cylinder(contrast, poisson)
    _, strain = sphere_in_uniaxial_stress(contrast=contrast, poisson=poisson)
    assert found.stress_ratio == pytest.approx(stress, rel=0.001)
    assert found.strain_ratio == pytest.approx(strain, rel=0.001)
    assert found.unevenness < 1e-3 * strain, "Eshelby: the strain inside is uniform"


RING_EDGES_MM = np.linspace(0.0, 9.6, 21)
WITH_SPHERE = """2.0974 2.08187 2.05186 2.00913 1.95641 1.89664 1.83308 1.76892 1.70712 1.65023
                 1.6003 1.5591 1.52777 1.50743 1.49906 1.50364 1.52283 1.55892 1.61582 1.70016"""
PLAIN = """1.32045 1.32136 1.32321 1.32603 1.3299 1.33494 1.34125 1.34903 1.35854 1.37005
           1.38393 1.40079 1.42119 1.44606 1.47659 1.51425 1.5614 1.62115 1.69837 1.80082"""


@pytest.mark.parametrize(("with_sphere", "reference"), [(True, WITH_SPHERE), (False, PLAIN)])
def test_ring_means_of_the_pressure(*, with_sphere: bool, reference: str) -> None:
    sphere = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
    phantom = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=sphere if with_sphere else None)
    field = press(load_probe("tsis-2011"), phantom, force_n=1.0)
    means = []
    for low, high in itertools.pairwise(RING_EDGES_MM):
        radius = np.linspace(low, high, 41)
        pressure = np.interp(radius, field.radius_mm, field.pressure_kpa)
        means.append(np.trapezoid(pressure * radius, radius) / np.trapezoid(radius, radius))
    np.testing.assert_allclose(means, np.array(reference.split(), dtype=float), rtol=1e-3)
