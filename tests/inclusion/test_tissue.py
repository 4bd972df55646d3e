"""The modulus of tissue from a light press, and the forces that follow from it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import tsis
from tsis.errors import InputError, TsisError
from tsis.inclusion import InclusionPrior
from tsis.inclusion.tissue import prior_on_tissue, protocol_forces, tissue_modulus
from tsis.mechanics import press
from tsis.model.calibration import Calibration, LightMap
from tsis.model.image import TactileImage
from tsis.model.phantom import Phantom
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from tsis.model.probe import Probe

DOMED, FLAT = (tsis.load_probe(name) for name in ("tsis-domed", "tsis-2011"))
SCALE = 0.1  # mm per pixel


def calibration(probe: str) -> Calibration:
    return Calibration(
        gain_grey_per_kpa=4.0, saturation_kpa=60.0, light=LightMap.uniform(), gain_sd=0.03, probe=probe, name="test"
    )


def light_press(young_kpa: float, *, seed: int, probe: tsis.Probe = DOMED, force_n: float = 0.2) -> TactileImage:
    """A frame by finite elements on this one tissue, erf contact and noise: no table, no grid of moduli."""
    field = press(probe, Phantom(young_kpa=young_kpa, thickness_mm=31.0), force_n=force_n, strain="small")
    rng = np.random.default_rng(seed)
    half = int(probe.radius_mm / SCALE) + 4
    y, x = np.mgrid[-half : half + 1, -half : half + 1] * SCALE
    pressure = np.interp(np.hypot(x, y), field.radius_mm, field.pressure_kpa, right=0.0)
    gain = 4.0 * (1 + 0.03 * rng.standard_normal())
    grey = gain * 60.0 * tsis.optics.angles.real_contact(pressure, 60.0)
    grey = np.clip(np.round(grey + rng.normal(0.0, 1.0, grey.shape)), 0, 255)
    return TactileImage(
        grey=grey, mm_per_pixel=(SCALE, SCALE), axis_px=(half, half), force_n=force_n, name="light press"
    )


@pytest.mark.parametrize("young_kpa", [2.0, 7.0, 25.0])
def test_the_modulus_of_a_press_under_a_dome(young_kpa: float) -> None:
    found = tissue_modulus(light_press(young_kpa, seed=5), probe=DOMED, calibration=calibration("tsis-domed"))
    assert found.trusted
    assert found.young_kpa == pytest.approx(young_kpa, rel=0.12)
    low, high = found.interval_kpa
    assert low < found.young_kpa < high
    assert np.log(high / low) == pytest.approx(2 * 1.645 * found.sd, rel=0.2)


def test_a_press_beside_an_edge_is_no_tissue() -> None:
    """Light on one ring only is not a press on any even tissue."""
    image = light_press(5.0, seed=6)
    y, x = np.indices(image.grey.shape) - image.grey.shape[0] // 2
    ring = np.abs(np.hypot(x, y) * SCALE - 8.0) < 0.8
    found = tissue_modulus(
        replace(image, grey=np.where(ring, 90.0, 0.0)), probe=DOMED, calibration=calibration("tsis-domed")
    )
    assert not found.trusted


@pytest.mark.parametrize(
    ("change", "options", "message"),
    [
        ({"force_n": None}, {}, "force_n"),
        ({}, {"thickness_mm": 1e-3}, "thickness_mm"),
        ({}, {"thickness_sd": np.nan}, "thickness_sd"),
        ({}, {"calibration": calibration("tsis-2011")}, "tsis-2011"),
    ],
)
def test_wrong_input_is_refused(change: dict[str, Any], options: dict[str, Any], message: str) -> None:
    image = replace(light_press(5.0, seed=7), **change)
    call: dict[str, Any] = {"probe": DOMED, "calibration": calibration("tsis-domed")} | options
    with pytest.raises(TsisError, match=message):
        tissue_modulus(image, **call)


def test_the_usual_forces_are_those_of_the_usual_tissue() -> None:
    assert protocol_forces(DOMED, tissue_young_kpa=5.0) == (0.5, 1.0)
    assert protocol_forces(FLAT, tissue_young_kpa=5.0) == (1.0,)


@pytest.mark.parametrize("probe", [DOMED, FLAT])
def test_the_careful_protocol_repeats_the_usual_one_within_five_minutes(probe: Probe) -> None:
    """15 s a press and 30 s a site, on target and reference."""
    usual = protocol_forces(probe, tissue_young_kpa=5.0)
    careful = protocol_forces(probe, tissue_young_kpa=5.0, careful=True)
    assert careful == len(careful) // len(usual) * usual
    assert 2 * (30 + 15 * len(careful)) <= 300 < 2 * (30 + 15 * (len(careful) + len(usual)))


@settings(max_examples=10)
@given(tissue=st.floats(1.0, 50.0), factor=st.floats(1.1, 3.0))
def test_forces_grow_with_the_tissue_and_cover_the_dome(tissue: float, factor: float) -> None:
    """Under the lower force the dome touches with its whole face: pressure at its rim, by a press of its own."""
    low, high = protocol_forces(DOMED, tissue_young_kpa=tissue)
    assert low < high
    field = press(DOMED, Phantom(young_kpa=tissue, thickness_mm=30.0), force_n=low, strain="small")
    assert field.pressure_kpa[-3:].min() > 0
    if factor * tissue <= 50.0:
        assert protocol_forces(DOMED, tissue_young_kpa=factor * tissue)[0] >= low


@pytest.mark.parametrize("tissue", [0.1, 500.0, np.nan])
def test_tissue_out_of_range_has_no_forces(tissue: float) -> None:
    with pytest.raises(InputError, match="tissue_young_kpa"):
        protocol_forces(DOMED, tissue_young_kpa=tissue)


@given(tissue=st.floats(0.5, 80.0))
def test_a_prior_on_another_tissue_has_its_contrasts(tissue: float) -> None:
    prior, moved = InclusionPrior(), prior_on_tissue(InclusionPrior(), tissue)
    np.testing.assert_allclose(np.array(moved.young_kpa) / tissue, np.array(prior.young_kpa) / prior.tissue_young_kpa)
    assert prior_on_tissue(moved, 5.0).young_kpa == pytest.approx(prior.young_kpa)


@pytest.mark.slow
@pytest.mark.parametrize("young_kpa", [1.5, 4.0, 12.0, 30.0])
def test_the_modulus_of_finite_presses_of_the_virtual_probe(young_kpa: float) -> None:
    held = 0
    for seed in range(4):
        virtual = VirtualProbe(DOMED, rng=np.random.default_rng(900 + seed))
        image = virtual.press(Phantom(young_kpa=young_kpa, thickness_mm=30.0), force_n=0.2)
        found = tissue_modulus(image, probe=DOMED, calibration=virtual.calibration)
        assert found.young_kpa == pytest.approx(young_kpa, rel=0.15)
        held += found.interval_kpa[0] <= young_kpa <= found.interval_kpa[1]
    assert held >= 2
