"""A squeezed sphere against an independent code and against Hertz."""

from __future__ import annotations

import json
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.errors import InputError, MechanicsError
from tsis.mechanics.finite_strain.soft_sphere import SphereResolution, squeeze_path, squeeze_sphere
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from pathlib import Path

PROBE = tsis.load_probe("tsis-2011")
COARSE = SphereResolution(order=3, cells=5, face_cells=4)


@pytest.fixture
def oracle(shared_data: Path) -> Any:
    return json.loads((shared_data / "oracle" / "finite_strain.json").read_text(encoding="utf-8"))["sphere"]


def stiffened(factor: float) -> Probe:
    return replace(PROBE, layers=tuple(replace(one, young_kpa=factor * one.young_kpa) for one in PROBE.layers))


def compare(rows: list[Any]) -> None:
    found = squeeze_path(
        stiffened(rows[0]["probe_modulus_factor"]),
        sphere_radius_mm=3.0,
        young_kpa=rows[0]["young_kpa"],
        forces_n=[row["force_mN"] / 1e3 for row in rows],
    )
    for row, one in zip(rows, found, strict=True):
        assert one.approach_mm == pytest.approx(row["approach_mm"], rel=0.01)
        assert one.contact_radius_mm == pytest.approx(row["contact_radius_mm"], rel=0.05)
        assert one.peak_pressure_kpa == pytest.approx(row["peak_pressure_kpa"], rel=0.03)


@pytest.mark.slow
def test_an_independent_code_finds_the_same_at_a_small_load(oracle: Any) -> None:
    compare([row for row in oracle if row["young_kpa"] == 62.0][:1])


@pytest.mark.slow
@pytest.mark.parametrize("young", [62.0, 103.0])
def test_an_independent_code_finds_the_same(oracle: Any, young: float) -> None:
    rows = [row for row in oracle if row["young_kpa"] == young]
    assert len(rows) == 4
    compare(rows)


@pytest.mark.slow
def test_small_loads_are_hertz_with_both_compliances() -> None:
    """Approach and pressure within 2 %; the edge of the contact is known to a share of an element, 3 %."""
    probe = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=30.0, young_kpa=500.0),))
    young, radius, force, plane = 100.0, 3.0, 1.5, 1 - 0.49**2
    fine = SphereResolution(cells=16, rings=3, face_cells=16)
    found = squeeze_sphere(probe, sphere_radius_mm=radius, young_kpa=young, force_n=force / 1e3, resolution=fine)
    on_plate, on_face = young / plane, 1 / (plane / young + plane / 500.0)
    approach = sum((9 * force**2 / (16 * radius * modulus**2)) ** (1 / 3) for modulus in (on_plate, on_face))
    assert found.approach_mm == pytest.approx(approach, rel=0.02)
    peak = (6 * force * on_face**2 / (np.pi**3 * radius**2)) ** (1 / 3)
    assert found.peak_pressure_kpa == pytest.approx(peak, rel=0.02)
    assert found.contact_radius_mm == pytest.approx((3 * force * radius / (4 * on_face)) ** (1 / 3), rel=0.03)


@pytest.mark.slow
def test_the_work_of_the_force_is_the_energy_that_is_stored() -> None:
    points, weights = np.polynomial.legendre.leggauss(10)
    low, high = 0.1, 0.15
    forces = low + (high - low) * (points + 1) / 2
    steps = squeeze_path(PROBE, sphere_radius_mm=3.0, young_kpa=80.0, forces_n=(low, *forces, high), resolution=COARSE)
    travel = np.array([step.approach_mm for step in steps])
    inside = 1e3 * (high - low) / 2 * float(weights @ travel[1:-1])
    work = 1e3 * (high * travel[-1] - low * travel[0]) - inside
    assert steps[-1].stored_mn_mm - steps[0].stored_mn_mm == pytest.approx(work, rel=1e-5)


@pytest.mark.slow
def test_softer_spheres_spread_further() -> None:
    soft, stiff = (
        squeeze_sphere(PROBE, sphere_radius_mm=3.0, young_kpa=young, force_n=0.1, resolution=COARSE)
        for young in (40.0, 300.0)
    )
    assert soft.contact_radius_mm > stiff.contact_radius_mm
    assert soft.approach_mm > stiff.approach_mm
    assert soft.peak_pressure_kpa < stiff.peak_pressure_kpa
    field = soft.field
    step = field.radius_mm[1]
    area = 2 * np.pi * field.radius_mm * step
    area[0] = np.pi * step**2 / 3
    assert float((area * field.pressure_kpa).sum()) == pytest.approx(100.0, rel=1e-6)
    assert field.face_displacement_mm[0] > 0
    np.testing.assert_allclose(field.pressure_kpa[field.radius_mm > 1.2 * soft.contact_radius_mm], 0.0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("young", [40.0, 500.0])
def test_the_range_of_moduli_and_forces(young: float) -> None:
    forces = (0.1, 0.7, 1.2)
    found = squeeze_path(PROBE, sphere_radius_mm=3.0, young_kpa=young, forces_n=forces)
    assert all(later.contact_radius_mm > one.contact_radius_mm for one, later in pairwise(found))


def test_impossible_spheres_are_refused() -> None:
    with pytest.raises(InputError, match="sphere_radius_mm"):
        squeeze_sphere(PROBE, sphere_radius_mm=9.0, young_kpa=80.0, force_n=0.1)
    with pytest.raises(InputError, match="must ascend"):
        squeeze_path(PROBE, sphere_radius_mm=3.0, young_kpa=80.0, forces_n=(0.2, 0.1))
    with pytest.raises(InputError, match="young_kpa"):
        squeeze_sphere(PROBE, sphere_radius_mm=3.0, young_kpa=-1.0, force_n=0.1)


@pytest.mark.slow
def test_a_load_beyond_the_model_names_the_one_that_is_not() -> None:
    with pytest.raises(MechanicsError, match=r"the last load that converged is [0-9.e-]+ N: choose at most that"):
        squeeze_sphere(PROBE, sphere_radius_mm=1.0, young_kpa=5.0, force_n=5.0, resolution=COARSE)
