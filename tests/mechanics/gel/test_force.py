"""Pressure, force and Green's functions of a bonded gel layer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import tsis
from tsis.errors import InputError
from tsis.mechanics.finite_strain.soft_sphere import squeeze_path
from tsis.mechanics.gel.contact import GelGrid, layer_compliance
from tsis.mechanics.gel.force import DepthErrors, gel_force, gel_force_scale, pressure_from_depth
from tsis.model.gel_sensor import BoundedValue, GelSensor


def integrated(q: float, poisson: float) -> np.ndarray:
    """Compliances (n, t, c, c) of a layer of thickness and modulus 1: Navier's equations integrated through it."""
    shear, lame = 0.5 / (1 + poisson), poisson / (1 + poisson) / (1 - 2 * poisson)
    both, stiff = lame + shear, lame + 2 * shear
    through = expm(
        np.array(
            [
                [0, 0, 1, 0],
                [0, 0, 0, 1],
                [stiff * q * q / shear, 0, 0, -q * both / shear],
                [0, shear * q * q / stiff, q * both / stiff, 0],
            ]
        )
    )
    face = [[0, -shear * q, -shear, 0], [lame * q, 0, 0, -stiff]]
    system = np.vstack([through[:2], face])
    along, inward = (np.linalg.solve(system, load) for load in ([0, 0, 1, 0], [0, 0, 0, 1]))
    return np.array([inward[1], along[0], inward[0], along[1]])


@given(q=st.floats(0.05, 5.0), poisson=st.floats(0.0, 0.495))
@settings(max_examples=40)
def test_compliances_are_those_of_the_integrated_equations(q: float, poisson: float) -> None:
    c = layer_compliance(q, young_kpa=1.0, poisson=poisson, thickness_mm=1.0)
    expected = integrated(q, poisson)
    assert [float(c.normal), float(c.tangential), float(c.coupling)] == pytest.approx(expected[:3], rel=1e-6, abs=1e-9)
    assert expected[3] == pytest.approx(expected[2], rel=1e-6, abs=1e-9)  # reciprocity


@pytest.mark.parametrize(("ratio", "expected"), [(0.2, 1.2741), (0.4, 1.6638), (1.0, 3.4840), (2.0, 8.337)])
def test_a_flat_punch_has_the_published_stiffness(ratio: float, expected: float) -> None:
    pixels, depth = 63, 0.05
    size = 1.0 / 24.3
    y, x = (np.mgrid[:pixels, :pixels] - (pixels - 1) / 2) * size
    grid = GelGrid((pixels, pixels), (size, size), 100.0, 0.49, 1.0 / ratio)
    inside = np.hypot(x, y) <= 1.0
    result = pressure_from_depth(np.where(inside, depth, 0.0), grid, contact=inside)
    assert 1000 * result.force_n / (2 * 100 / (1 - 0.49**2) * depth) == pytest.approx(expected, rel=0.015)


def test_a_sphere_finds_its_contact_and_shear_moves_the_face() -> None:
    """Hertz on a thick gel; its force is 1.06 of the half-space's at this thickness (Dimitriadis et al. 2002)."""
    size, radius, contact = 0.15, 10.0, 1.5
    y, x = (np.mgrid[:40, :40] - 19.5) * size
    depth = contact**2 / radius - (x**2 + y**2) / (2 * radius)
    grid = GelGrid((40, 40), (size, size), 100.0, 0.49, 30.0)
    result = pressure_from_depth(depth, grid, contact=depth > 0)
    modulus = 100.0 / (1 - 0.49**2)
    assert 1000 * result.force_n == pytest.approx(4 * modulus * contact**3 / (3 * radius) * 1.06, rel=0.015)
    assert np.sqrt((result.pressure_kpa > 0).sum() * size**2 / np.pi) == pytest.approx(contact, rel=0.05)
    nothing = np.zeros((40, 40))
    work = [
        (grid.displacement_mm(result.pressure_kpa, np.stack([nothing, nothing]))[0] * result.pressure_kpa).sum(),
        (grid.displacement_mm(nothing, np.stack([result.pressure_kpa, nothing]))[2] * result.pressure_kpa).sum(),
    ]
    assert work[0] == pytest.approx(-work[1], abs=1e-9 * abs(result.pressure_kpa).sum())  # reciprocity
    even = GelGrid((8, 8), (1e3, 1e3), 100.0, 0.49, 4.0).displacement_mm(np.zeros((8, 8)), np.ones((2, 8, 8)))
    assert even[0, 4, 4] == pytest.approx(4.0 * 2 * 1.49 / 100, rel=0.01)  # simple shear


SENSOR = GelSensor(
    name="test",
    width_mm=20.16,
    height_mm=15.12,
    thickness_mm=BoundedValue(value=4.0, low=3.8, high=4.2),
    young_kpa=BoundedValue(value=150.0, low=135.0, high=165.0),
    poisson=BoundedValue(value=0.485, low=0.48, high=0.49),
    image_px=(160, 120),
    mm_per_pixel=(0.126, 0.126),
)


@pytest.fixture(scope="module")
def presses() -> list[tuple[float, np.ndarray]]:
    """Depth maps of a steel ball on the gel by finite elements at finite strain."""
    gel = tsis.Layer(thickness_mm=4.0, young_kpa=150.0, poisson=0.485)
    probe = tsis.Probe(radius_mm=11.0, layers=(gel,), name="gel")
    forces = (0.15, 0.4, 0.8)
    squeezed = squeeze_path(probe, sphere_radius_mm=2.5, young_kpa=2e4, poisson=0.3, forces_n=forces)
    y, x = (np.mgrid[:120, :160] - np.array([59.5, 79.5])[:, None, None]) * 0.126
    radius = np.hypot(x, y)
    return [
        (force, np.interp(radius, one.field.radius_mm, one.field.face_displacement_mm))
        for force, one in zip(forces, squeezed, strict=True)
    ]


@pytest.mark.slow
def test_force_of_a_ball_at_finite_strain(presses: list[tuple[float, np.ndarray]]) -> None:
    rng = np.random.default_rng(28)
    results = []
    for force, depth in presses:
        result = gel_force(depth + rng.normal(0, 0.005, depth.shape), sensor=SENSOR, draws=60)
        low, high = result.interval_n()
        assert result.force_n == pytest.approx(force, rel=0.1)
        assert low < force < high
        assert not result.problems
        results.append(result)
    scale = gel_force_scale(results[:2], [force for force, _ in presses[:2]])
    weighed = gel_force(presses[2][1], sensor=SENSOR, scale=scale, errors=DepthErrors(scale_sd=0.02), draws=60)
    assert weighed.force_n == pytest.approx(0.8, rel=0.06)


def test_depths_within_their_uncertainty_are_no_contact() -> None:
    """Some micrometres of error over the whole map made half of the force."""
    y, x = (np.mgrid[:120, :160] - np.array([59.5, 79.5])[:, None, None]) * 0.126
    cap = np.maximum(0.25 - (x**2 + y**2) / 12.0, 0.0)
    error = 0.035 * np.sin(x / 3.0)  # slow, as that of integrated slopes; none under the ball
    true, blind, informed = (
        gel_force(depth, sensor=SENSOR, sd_mm=sd, draws=20)
        for depth, sd in ((cap, None), (cap + error, None), (cap + error, np.full(cap.shape, 0.025)))
    )
    assert blind.force_n > 1.25 * informed.force_n
    assert informed.force_n == pytest.approx(true.force_n, rel=0.25)
    assert blind.problems
    assert not informed.problems
    with pytest.raises(InputError, match="sd_mm must have the shape"):
        gel_force(cap, sensor=SENSOR, sd_mm=np.ones((3, 3)))


def test_force_refuses_maps_that_hold_no_press() -> None:
    with pytest.raises(InputError, match="no pixel is pressed in by more than"):
        gel_force(np.zeros((120, 160)), sensor=SENSOR)
    with pytest.raises(InputError, match="aspect ratio"):
        gel_force(np.ones((120, 120)), sensor=SENSOR)
    with pytest.raises(InputError, match="finite"):
        gel_force(np.full((120, 160), np.nan), sensor=SENSOR)
    edge = np.zeros((120, 160))
    edge[:10, :10] = 0.2
    assert "border" in gel_force(edge, sensor=SENSOR, draws=20).problems[0]


def test_a_shallow_press_is_not_called_deep(monkeypatch: pytest.MonkeyPatch) -> None:
    """A correction beyond what was measured is named by itself."""
    y, x = (np.mgrid[:120, :160] - np.array([59.5, 79.5])[:, None, None]) * 0.126
    cap = np.maximum(0.25 - (x**2 + y**2) / 12.0, 0.0)
    assert not gel_force(cap, sensor=SENSOR, draws=20).problems
    monkeypatch.setattr("tsis.mechanics.gel.force.LARGEST_CORRECTION", 1.0)
    (problem,) = gel_force(cap, sensor=SENSOR, draws=20).problems
    assert problem.startswith("large strain raises the force 1.0")
    assert "deep" not in problem
