"""Presses with large deformations against an independent code, small strain, and what any press must obey."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.errors import InputError, MechanicsError
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import press_finite, press_pairs, press_path, press_steps
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.model.press import PressField

PROBE = tsis.load_probe("tsis-2011")
DOMED = tsis.load_probe("tsis-domed")
PLAIN = Phantom(young_kpa=5.0, thickness_mm=30.0)
COARSE = FiniteResolution(order=3, rim_mm=0.6, growth=3.0, largest=0.3, ray_layers=2)


def lump(diameter: float, depth: float, young: float, **other: Any) -> Phantom:
    return replace(PLAIN, inclusion=Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, **other))


def force_n(field: PressField) -> float:
    """Integral of the pressure over the face, by the hat functions that its means belong to."""
    step, radius = field.radius_mm[1], field.radius_mm
    area = 2 * np.pi * radius * step
    area[0] = np.pi * step**2 / 3
    area[-1] = np.pi * step * (radius[-1] - step / 3)
    return float((area * field.pressure_kpa).sum()) / 1e3


@pytest.fixture
def oracle(shared_data: Path) -> Any:
    return json.loads((shared_data / "oracle" / "finite_strain.json").read_text(encoding="utf-8"))["press"]


def test_an_independent_code_finds_the_same(oracle: Any) -> None:
    assert [row["force_mN"] for row in oracle] == [250.0, 750.0]
    pairs = press_pairs(PROBE, lump(10.0, 5.0, 100.0), forces_n=(0.25, 0.75))
    for row, (with_it, without) in zip(oracle, pairs, strict=True):
        assert with_it.approach_mm == pytest.approx(row["approach_mm"], rel=0.005)
        assert without.approach_mm == pytest.approx(row["approach_without_mm"], rel=0.005)
        assert with_it.face_displacement_mm[0] * 1e3 == pytest.approx(row["w0_um"], rel=0.01)
        assert without.face_displacement_mm[0] * 1e3 == pytest.approx(row["w0_without_um"], rel=0.01)
        signal = 1e3 * (with_it.face_displacement_mm - without.face_displacement_mm)
        there = {float(radius): value for radius, value in row["dw_um_at_r_mm"].items()}
        found = np.interp(list(there), with_it.radius_mm, signal)
        np.testing.assert_allclose(found, list(there.values()), atol=0.02 * max(there.values()))
        for field in (with_it, without):
            assert force_n(field) == pytest.approx(row["force_mN"] / 1e3, rel=1e-6)


def test_the_work_of_the_force_is_the_energy_that_is_stored() -> None:
    points, weights = np.polynomial.legendre.leggauss(5)
    low, high = 0.1, 0.3
    forces = low + (high - low) * (points + 1) / 2
    steps = press_steps(PROBE, lump(10.0, 5.0, 100.0), (low, *forces, high))
    travel = np.array([step.field.approach_mm for step in steps])
    # The integral of F d(travel) by parts: Gauss points lie in the force, where the travel is smooth.
    inside = 1e3 * (high - low) / 2 * float(weights @ travel[1:-1])
    work = 1e3 * (high * travel[-1] - low * travel[0]) - inside
    assert steps[-1].stored_mn_mm - steps[0].stored_mn_mm == pytest.approx(work, rel=1e-5)


def test_several_loads_are_those_of_one_load_each() -> None:
    both = press_path(PROBE, PLAIN, forces_n=(0.1, 0.3), resolution=COARSE)
    alone = press_finite(PROBE, PLAIN, force_n=0.3, resolution=COARSE)
    assert both[1].approach_mm == pytest.approx(alone.approach_mm, rel=1e-8)
    np.testing.assert_allclose(both[1].face_displacement_mm, alone.face_displacement_mm, rtol=1e-6)
    assert [field.force_n for field in both] == [0.1, 0.3]


def test_a_press_with_the_inclusion_is_plain_tissue_plus_the_pair() -> None:
    phantom = lump(10.0, 5.0, 100.0)
    whole, plain = (press_finite(PROBE, one, force_n=0.2, resolution=COARSE) for one in (phantom, PLAIN))
    ((with_it, without),) = press_pairs(PROBE, phantom, forces_n=(0.2,), resolution=COARSE)
    signal = with_it.face_displacement_mm - without.face_displacement_mm
    np.testing.assert_allclose(whole.face_displacement_mm - plain.face_displacement_mm, signal, atol=1e-12)


def test_no_contrast_no_signal() -> None:
    ((with_it, without),) = press_pairs(PROBE, lump(8.0, 5.0, 5.0), forces_n=(0.1,), resolution=COARSE)
    np.testing.assert_array_equal(with_it.face_displacement_mm, without.face_displacement_mm)


def signal(phantom: Phantom, force: float, resolution: FiniteResolution | None = None) -> NDArray[np.float64]:
    ((with_it, without),) = press_pairs(PROBE, phantom, forces_n=(force,), resolution=resolution)
    return with_it.face_displacement_mm - without.face_displacement_mm


@pytest.mark.slow
def test_small_loads_are_small_strain() -> None:
    """With a rim so small that the flat face of the other model is met."""
    sharp, force = FiniteResolution(fillet_mm=0.05, rim_mm=0.05), 0.02
    for phantom in (PLAIN, lump(10.0, 5.0, 100.0)):
        finite, small = (
            press_finite(PROBE, phantom, force_n=force, resolution=sharp),
            press(PROBE, phantom, force_n=force),
        )
        inside = small.radius_mm < 0.8 * PROBE.radius_mm
        assert finite.approach_mm == pytest.approx(small.approach_mm, rel=0.01)
        np.testing.assert_allclose(finite.face_displacement_mm[inside], small.face_displacement_mm[inside], rtol=0.01)


@pytest.mark.slow
def test_large_loads_strengthen_the_signal() -> None:
    """At 0.75 N by about a tenth of what 0.25 N would make of it, and not by a third as nodes that stick would say."""
    phantom = lump(10.0, 5.0, 100.0)
    ratio = signal(phantom, 0.75, COARSE)[0] / (3 * signal(phantom, 0.25, COARSE)[0])
    assert 1.02 < ratio < 1.10


@pytest.mark.slow
@pytest.mark.parametrize("poisson", [0.3, 0.49, 0.495])
def test_finer_meshes_change_nothing(poisson: float) -> None:
    """Within 1 % on three meshes, nearly incompressible or not."""
    phantom = replace(
        PLAIN, poisson=poisson, inclusion=Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0, poisson=poisson)
    )
    meshes = (
        FiniteResolution(),
        FiniteResolution(rim_mm=0.3, growth=2.0, largest=0.15, ray_layers=5),
        FiniteResolution(order=5, rim_mm=0.3, growth=2.0, largest=0.15, ray_layers=5),
    )
    pairs = [press_pairs(PROBE, phantom, forces_n=(0.5,), resolution=one)[0] for one in meshes]
    inside = pairs[0][0].radius_mm < 0.8 * PROBE.radius_mm
    finest = pairs[-1]
    signals = [(one.face_displacement_mm - other.face_displacement_mm)[inside] for one, other in pairs]
    for (with_it, _), change in zip(pairs[:-1], signals[:-1], strict=True):
        assert with_it.approach_mm == pytest.approx(finest[0].approach_mm, rel=0.01)
        np.testing.assert_allclose(
            with_it.face_displacement_mm[inside], finest[0].face_displacement_mm[inside], rtol=0.01
        )
        np.testing.assert_allclose(change, signals[-1], atol=0.01 * np.abs(signals[-1]).max())


def test_a_domed_face_touches_in_the_middle_first() -> None:
    small, large = press_path(DOMED, PLAIN, forces_n=(0.1, 0.2), resolution=COARSE)
    edges = [field.radius_mm[field.pressure_kpa > 1e-6].max() for field in (small, large)]
    assert 4.0 < edges[0] < edges[1] < DOMED.radius_mm
    for field, edge in zip((small, large), edges, strict=True):
        middle, outer = (field.pressure_kpa[np.searchsorted(field.radius_mm, share * edge)] for share in (0.0, 0.8))
        assert middle > 1.2 * outer
        np.testing.assert_allclose(field.pressure_kpa[field.radius_mm > edge], 0.0, atol=1e-6)
        assert force_n(field) == pytest.approx(field.force_n, rel=1e-6)
    assert small.approach_mm > press_finite(PROBE, PLAIN, force_n=0.1, resolution=COARSE).approach_mm


@pytest.mark.slow
@pytest.mark.parametrize(("diameter", "depth", "young"), [(10.0, 5.0, 100.0), (13.0, 5.0, 40.0)])
def test_the_domed_probe_presses_at_both_loads(diameter: float, depth: float, young: float) -> None:
    half, whole = press_pairs(DOMED, lump(diameter, depth, young), forces_n=(0.5, 1.0))
    for (with_it, without), force in zip((half, whole), (0.5, 1.0), strict=True):
        assert force_n(with_it) == pytest.approx(force, rel=1e-6)
        assert with_it.approach_mm < without.approach_mm
        assert with_it.face_displacement_mm[0] > without.face_displacement_mm[0]


@pytest.mark.slow
def test_the_edge_of_a_domed_contact_moves_smoothly() -> None:
    """Fine steps of the load: what the face answers has no kinks where the edge passes points or elements."""
    forces = tuple(np.linspace(0.2, 0.4, 21))
    steps = press_path(DOMED, PLAIN, forces_n=forces)
    answer = np.array([field.face_displacement_mm[[0, 80, 160]] for field in steps])
    smooth = np.polynomial.Chebyshev.fit
    for one in answer.T:
        fit = smooth(forces, one, 4)(np.array(forces))
        assert np.abs(one - fit).max() < 1e-3 * one.max()


def test_bonded_sides_hold_the_layers() -> None:
    free, held = (
        press_finite(replace(PROBE, sides=sides), PLAIN, force_n=0.2, resolution=COARSE) for sides in ("free", "bonded")
    )
    assert held.face_displacement_mm[0] < free.face_displacement_mm[0]
    assert held.approach_mm < free.approach_mm


@pytest.mark.slow
def test_a_flat_spheroid_is_felt_otherwise_than_a_sphere() -> None:
    sphere, flat = lump(8.0, 5.0, 100.0), lump(8.0, 5.0, 100.0, semi_axes_mm=(4.0, 4.0, 2.0))
    ball = lump(8.0, 5.0, 100.0, semi_axes_mm=(4.0, 4.0, 4.0))
    np.testing.assert_allclose(signal(ball, 0.1, COARSE), signal(sphere, 0.1, COARSE), atol=1e-9)
    assert 0.2 < signal(flat, 0.1, COARSE)[0] / signal(sphere, 0.1, COARSE)[0] < 0.95


def test_one_thick_layer_and_a_wide_inclusion() -> None:
    probe = Probe(radius_mm=8.0, layers=(Layer(thickness_mm=6.0, young_kpa=60.0),))
    ((with_it, without),) = press_pairs(probe, lump(18.0, 4.0, 40.0), forces_n=(0.1,), resolution=COARSE)
    assert with_it.approach_mm < without.approach_mm


@pytest.mark.slow
def test_a_load_beyond_the_model_names_the_one_that_is_not() -> None:
    with pytest.raises(MechanicsError, match=r"the last load that converged is [0-9.e-]+ N: choose at most that"):
        press_finite(PROBE, PLAIN, force_n=20.0, resolution=COARSE)


@pytest.mark.parametrize("force", [0.0, -1.0, 51.0, float("nan")])
def test_forces_outside_the_range_are_refused(force: float) -> None:
    with pytest.raises(InputError, match="force_n"):
        press_finite(PROBE, PLAIN, force_n=force)


def test_forces_ascend() -> None:
    with pytest.raises(InputError, match="ascend"):
        press_path(PROBE, PLAIN, forces_n=(0.5, 0.2))
    with pytest.raises(InputError, match="at least one"):
        press_path(PROBE, PLAIN, forces_n=())


def test_inclusions_that_are_not_round_about_the_axis_are_refused() -> None:
    for phantom in (lump(8.0, 5.0, 50.0, offset_mm=(1.0, 0.0)), lump(8.0, 5.0, 50.0, semi_axes_mm=(4.0, 3.0, 4.0))):
        with pytest.raises(InputError, match="axis"):
            press_finite(PROBE, phantom, force_n=0.1)
