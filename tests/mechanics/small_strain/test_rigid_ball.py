"""A sphere in the probe: against Hertz, a finer mesh, and the work of the force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.mechanics.closed_forms import hertz

import tsis
from tsis.errors import InputError, MechanicsError
from tsis.mechanics.small_strain.rigid_ball import Indentation, indent
from tsis.mechanics.small_strain.slab import Resolution
from tsis.model.probe import Layer, Probe

PROBE = tsis.load_probe("tsis-2011")
THICK = Probe(radius_mm=100.0, layers=(Layer(thickness_mm=200.0, young_kpa=50.0, poisson=0.49),))


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_on_a_thick_probe_it_is_hertz(poisson: float) -> None:
    thick = replace(THICK, layers=(replace(THICK.layers[0], poisson=poisson),))
    found = indent(thick, sphere_radius_mm=10.0, force_n=0.1)
    modulus = 50.0 / (1 - poisson**2)
    depth = (9 * 100.0**2 / (16 * modulus**2 * 10.0)) ** (1 / 3)
    exact = hertz(radius_mm=10.0, indentation_mm=depth, young_kpa=50.0, poisson=poisson)
    assert found.depth_mm == pytest.approx(depth, rel=0.005)
    assert found.contact_radius_mm == pytest.approx(exact.contact_radius_mm, rel=1e-3)


@pytest.mark.parametrize("force", [pytest.param(0.02, marks=pytest.mark.slow), 0.3, 1.0])
def test_a_finer_mesh_changes_nothing(force: float) -> None:
    here, finer = (
        indent(PROBE, sphere_radius_mm=10.0, force_n=force, resolution=mesh)
        for mesh in (None, Resolution(order=6, edge=0.006, growth=1.9, largest=0.1))
    )
    assert here.depth_mm == pytest.approx(finer.depth_mm, rel=1e-5)
    assert here.contact_area_mm2 == pytest.approx(finer.contact_area_mm2, rel=1e-4)
    np.testing.assert_allclose(here.face_displacement_mm, finer.face_displacement_mm, atol=2e-4 * finer.depth_mm)


def test_around_the_contact_a_half_space_moves_as_hertz_found() -> None:
    found = indent(THICK, sphere_radius_mm=10.0, force_n=0.1)
    radius, contact = found.radius_mm, found.contact_radius_mm
    out = (radius > contact) & (radius < 5 * contact)
    share = contact / radius[out]
    exact = (2 - 1 / share**2) * np.arcsin(share) + np.sqrt(1 / share**2 - 1)
    np.testing.assert_allclose(
        found.face_displacement_mm[out], contact**2 / (10.0 * np.pi) * exact, atol=5e-3 * found.depth_mm
    )


def test_more_force_goes_deeper_and_wider() -> None:
    found = [indent(PROBE, sphere_radius_mm=10.0, force_n=force) for force in (0.1, 0.2, 0.4)]
    for name in ("depth_mm", "contact_area_mm2"):
        values = [getattr(one, name) for one in found]
        assert values[0] < values[1] < values[2]
    areas = [one.area_deeper_than_mm2(0.05) for one in found]
    assert areas[0] < areas[1] < areas[2]


def test_area_deeper_than() -> None:
    radius = np.linspace(0.0, 2.0, 201)
    cone = Indentation(
        force_n=1.0, depth_mm=1.0, contact_radius_mm=0.5, radius_mm=radius, face_displacement_mm=1.0 - radius / 2
    )
    assert cone.area_deeper_than_mm2(0.25) == pytest.approx(np.pi * 1.5**2, rel=1e-9)
    assert cone.area_deeper_than_mm2(1.5) == 0.0
    whole = replace(cone, face_displacement_mm=np.ones(201))
    assert whole.area_deeper_than_mm2(0.5) == pytest.approx(np.pi * 4.0)


def test_refusals() -> None:
    with pytest.raises(MechanicsError, match=r"wider than 5 mm, .* choose a force below \d"):
        indent(PROBE, sphere_radius_mm=10.0, force_n=20.0)
    with pytest.raises(InputError, match="probe must be flat to be indented; got face_curvature_mm 40"):
        indent(tsis.load_probe("tsis-domed"), sphere_radius_mm=10.0, force_n=0.1)
    with pytest.raises(InputError, match="sphere_radius_mm must lie in"):
        indent(PROBE, sphere_radius_mm=0.0, force_n=0.1)
