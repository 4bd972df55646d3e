"""A press against an independent code, and against what any linear press must obey."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import tsis
from tsis.errors import InputError, MechanicsError
from tsis.mechanics import press
from tsis.mechanics.closed_forms import effective_modulus_kpa
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.polynomial import contrast_factor
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.probe import Layer, Probe

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.model.press import PressField

PROBE = tsis.load_probe("tsis-2011")
PLAIN = Phantom(young_kpa=5.0, thickness_mm=30.0)
FINER = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
COARSE = Resolution(order=3, edge=0.05, growth=2.2, largest=0.3)


def lump(diameter: float, depth: float, young: float, **other: Any) -> Phantom:
    return replace(PLAIN, inclusion=Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, **other))


def change(phantom: Phantom, resolution: Resolution | None = None) -> NDArray[np.float64]:
    """What the inclusion adds to the displacement of the face."""
    with_it = press(PROBE, phantom, force_n=1.0, resolution=resolution).face_displacement_mm
    return with_it - press(PROBE, phantom.without_inclusion(), force_n=1.0, resolution=resolution).face_displacement_mm


@pytest.fixture
def oracle(shared_data: Path) -> Any:
    return json.loads((shared_data / "oracle" / "fem_axisymmetric.json").read_text(encoding="utf-8"))


def test_the_oracle_presses_the_catalogs_probe(oracle: Any) -> None:
    other = oracle["meta"]["probe"]
    assert other["radius"] == PROBE.radius_mm
    layers = [(layer["thickness"], layer["young"]) for layer in other["layers_from_tissue"]]
    assert layers == [(layer.thickness_mm, layer.young_kpa) for layer in PROBE.layers]
    assert {layer.poisson for layer in PROBE.layers} == {other["poisson"]}


def test_an_independent_code_finds_the_same(oracle: Any) -> None:
    radius = np.array(oracle["r_mm"])
    near = radius < 11.0
    plain = press(PROBE, PLAIN, force_n=1.0)
    bare = np.interp(radius, plain.radius_mm, plain.face_displacement_mm)
    assert len(oracle["cases"]) >= 9
    for case in oracle["cases"]:
        field = press(PROBE, lump(case["d"], case["h"], case["E"]), force_n=oracle["meta"]["force_mN"] / 1000)
        label = f"d {case['d']} h {case['h']} E {case['E']}"
        assert field.approach_mm == pytest.approx(case["delta"], rel=0.015), label
        assert plain.approach_mm == pytest.approx(case["delta0"], rel=0.015), label
        found, expected = np.interp(radius, field.radius_mm, field.face_displacement_mm), np.array(case["w"])
        np.testing.assert_allclose(found[near], expected[near], rtol=0.01, err_msg=label)
        peak = np.abs(case["dw"]).max()
        assert np.abs(found - bare).max() == pytest.approx(peak, rel=0.015), label
        np.testing.assert_allclose((found - bare)[near], np.array(case["dw"])[near], atol=0.015 * peak, err_msg=label)


def test_the_baseline_is_that_of_the_design_study() -> None:
    field = press(PROBE, PLAIN, force_n=1.0)
    found = np.interp([0.0, 8.0, 12.0], field.radius_mm, field.face_displacement_mm)
    np.testing.assert_allclose(1000 * found, [155.0, 273.0, 457.0], rtol=0.01)
    assert field.pressure_kpa[0] == pytest.approx(1.3, abs=0.05)


def test_one_layer_of_the_same_effective_modulus_gives_more_signal() -> None:
    """Known from an independent code: 60 against 49 um in the centre."""
    young = effective_modulus_kpa(PROBE.layers)
    single = Probe(radius_mm=PROBE.radius_mm, layers=(Layer(thickness_mm=PROBE.thickness_mm, young_kpa=young),))
    target = lump(10.0, 5.0, 120.0)
    fields = [press(single, phantom, force_n=1.0) for phantom in (target, PLAIN)]
    alone = fields[0].face_displacement_mm[0] - fields[1].face_displacement_mm[0]
    assert 1000 * alone == pytest.approx(60.0, abs=1.0)
    assert 1000 * change(target)[0] == pytest.approx(49.0, abs=1.0)


@pytest.mark.parametrize("phantom", [PLAIN, lump(10.0, 5.0, 100.0), lump(2.0, 4.0, 40.0)])
def test_the_tissue_pushes_and_never_pulls(phantom: Phantom) -> None:
    assert press(PROBE, phantom, force_n=1.0).pressure_kpa.min() > 0


def test_the_answer_is_linear_in_the_force() -> None:
    phantom = lump(10.0, 5.0, 100.0)
    small, large, none = (press(PROBE, phantom, force_n=force, resolution=COARSE) for force in (0.3, 1.2, 0.0))
    for name in ("pressure_kpa", "face_displacement_mm"):
        np.testing.assert_allclose(getattr(large, name), 4 * getattr(small, name), rtol=1e-12)
        assert not getattr(none, name).any()
    assert large.approach_mm == pytest.approx(4 * small.approach_mm, rel=1e-12)
    assert (none.approach_mm, none.force_n) == (0.0, 0.0)


def test_twice_the_moduli_give_half_the_displacement() -> None:
    stiff = replace(PROBE, layers=tuple(replace(layer, young_kpa=2 * layer.young_kpa) for layer in PROBE.layers))
    soft = press(PROBE, lump(10.0, 5.0, 100.0), force_n=1.0, resolution=COARSE)
    doubled = replace(lump(10.0, 5.0, 200.0), young_kpa=10.0)
    hard = press(stiff, doubled, force_n=1.0, resolution=COARSE)
    np.testing.assert_allclose(hard.face_displacement_mm, soft.face_displacement_mm / 2, rtol=1e-9)
    np.testing.assert_allclose(hard.pressure_kpa, soft.pressure_kpa, rtol=1e-9)


def test_the_answer_scales_with_the_lengths() -> None:
    """1.5 times the lengths under 2.25 times the force: the same pressures, 1.5 times the displacements."""
    large = Probe(
        radius_mm=18.0, layers=tuple(replace(layer, thickness_mm=1.5 * layer.thickness_mm) for layer in PROBE.layers)
    )
    small_field = press(PROBE, lump(8.0, 5.0, 100.0), force_n=0.5)
    larger = replace(lump(8.0, 5.0, 100.0), thickness_mm=45.0, inclusion=lump(12.0, 7.5, 100.0).inclusion)
    large_field = press(large, larger, force_n=1.125)
    np.testing.assert_allclose(large_field.pressure_kpa, small_field.pressure_kpa, rtol=1e-6)
    np.testing.assert_allclose(large_field.face_displacement_mm, 1.5 * small_field.face_displacement_mm, rtol=1e-6)


@pytest.mark.parametrize("size", [(2.0, 4.0), (10.0, 5.0), (14.0, 12.0)])
def test_an_inclusion_of_the_tissues_own_material_is_not_there(size: tuple[float, float]) -> None:
    assert np.abs(change(lump(*size, 5.0))).max() < 1e-12


def test_a_softer_inclusion_lowers_the_centre() -> None:
    assert change(lump(10.0, 5.0, 1.0))[0] < 0 < change(lump(10.0, 5.0, 40.0))[0]


def test_the_signal_saturates_with_the_modulus() -> None:
    """dw is proportional to g = (Ei - Et) / (Ei + 1.5 Et) within 2 %."""
    moduli = np.array([40.0, 60.0, 80.0, 120.0])
    inner = slice(0, 160)
    shares = np.array([change(lump(10.0, 5.0, young))[inner] / contrast_factor(young / 5.0) for young in moduli])
    spread = np.abs(shares / shares.mean(axis=0) - 1)[:, np.abs(shares[0]) > 0.1 * np.abs(shares[0]).max()]
    assert spread.max() < 0.02
    assert contrast_factor(1.0) == 0.0


@pytest.mark.parametrize("size", [(2.0, 5.0), (7.0, 12.0), (10.0, 5.0), (14.5, 4.2)])
def test_a_finer_mesh_changes_nothing(size: tuple[float, float]) -> None:
    phantom = lump(*size, 100.0)
    here, finer = (press(PROBE, phantom, force_n=1.0, resolution=mesh) for mesh in (None, FINER))
    inner = here.radius_mm < 0.9 * PROBE.radius_mm
    np.testing.assert_allclose(here.face_displacement_mm[inner], finer.face_displacement_mm[inner], rtol=1e-3)
    np.testing.assert_allclose(here.pressure_kpa[inner], finer.pressure_kpa[inner], rtol=5e-3)
    middle = here.radius_mm < 0.8 * PROBE.radius_mm  # where the docstring promises 0.1 %
    np.testing.assert_allclose(here.pressure_kpa[middle], finer.pressure_kpa[middle], rtol=1e-3)
    signal, reference = change(phantom), change(phantom, FINER)
    np.testing.assert_allclose(signal[inner], reference[inner], atol=3e-3 * np.abs(reference).max())


@pytest.mark.parametrize("edge", [0.02, 0.01, 0.004])
def test_the_pressure_sums_up_to_the_force_on_any_mesh(edge: float) -> None:
    field = press(PROBE, lump(10.0, 5.0, 100.0), force_n=0.8, resolution=Resolution(edge=edge))
    total = 2 * np.pi * np.trapezoid(field.pressure_kpa * field.radius_mm, field.radius_mm)
    assert total == pytest.approx(800.0, rel=2e-3)


@pytest.mark.parametrize("probe", [PROBE, tsis.load_probe("tsis-domed")])
def test_a_press_beyond_small_strain_is_refused_with_a_force_that_is_not(probe: Probe) -> None:
    with pytest.raises(MechanicsError, match=r"strain of \d.*choose a force of at most \d") as refused:
        press(probe, PLAIN, force_n=20.0)
    valid = float(str(refused.value).split("at most ")[1].split(" N")[0])
    assert valid > 1.0
    press(probe, PLAIN, force_n=valid)
    with pytest.raises(MechanicsError):
        press(probe, PLAIN, force_n=1.1 * valid)


@pytest.mark.parametrize("thickness", [60.0, 200.0, 500.0])
def test_thick_slabs_and_small_probes_are_meshed_as_well(thickness: float) -> None:
    """A sphere's mesh in a thick slab is slender: plain tissue must not be solved on it."""
    slab = replace(PLAIN, thickness_mm=thickness)
    small = Probe(radius_mm=2.0, layers=(Layer(thickness_mm=2.0, young_kpa=50.0),))
    for probe in (PROBE, small):
        here, finer = (press(probe, slab, force_n=0.02, resolution=mesh) for mesh in (None, FINER))
        inner = here.radius_mm < 0.9 * probe.radius_mm
        np.testing.assert_allclose(here.pressure_kpa[inner], finer.pressure_kpa[inner], rtol=5e-3)
        assert here.approach_mm == pytest.approx(finer.approach_mm, rel=1e-3)


def profile(field: PressField) -> list[int]:
    return [len(field.radius_mm), len(field.pressure_kpa), len(field.face_displacement_mm)]


def test_profiles_run_over_the_face() -> None:
    field = press(PROBE, PLAIN, force_n=1.0, resolution=COARSE)
    assert len(set(profile(field))) == 1
    assert (field.radius_mm[0], field.radius_mm[-1], field.force_n) == (0.0, 12.0, 1.0)


@pytest.mark.parametrize(
    ("phantom", "given", "phrase"),
    [
        (PLAIN, {"force_n": -1.0}, r"force_n must lie in \[0, 50\]; got -1 \(newtons\)"),
        (PLAIN, {"force_n": float("nan")}, r"force_n must lie in \[0, 50\]; got nan"),
        (PLAIN, {"force_n": 1.0, "strain": "large"}, "strain must be 'small' or 'finite'; got 'large'"),
        (PLAIN, {"strain": "finite", "resolution": COARSE}, "resolution must suit strain 'finite'; got a Res"),
        (lump(5.0, 5.0, 50.0, offset_mm=(1.0, 0.0)), {"force_n": 1.0}, "on the probe's axis .*; press_solid takes any"),
        (
            lump(5.0, 5.0, 50.0, semi_axes_mm=(2.0, 2.5, 3.0)),
            {"force_n": 1.0},
            "sphere or spheroid on the probe's axis",
        ),
    ],
)
def test_what_a_press_refuses(phantom: Phantom, given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        press(PROBE, phantom, **{"force_n": 1.0, **given})
