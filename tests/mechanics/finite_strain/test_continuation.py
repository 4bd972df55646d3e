"""Presses reached from their neighbours agree with load paths, and errors say where the model ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain import FiniteResolution, PressContinuation, SlabPress, press_pairs
from tsis.mechanics.finite_strain._continuation import path_around

PROBE = tsis.load_probe("tsis-2011")
COARSE = FiniteResolution(order=3, rim_mm=0.4, growth=3.0, largest=0.3, ray_layers=2)
START = SlabPress.on_sphere(
    diameter_mm=8.0, depth_mm=6.0, contrast=1.0, tissue_young_kpa=5.0, thickness_mm=30.0, force_n=0.3
)


def continuation() -> PressContinuation:
    return PressContinuation(PROBE, START.phantom, COARSE)


def test_a_state_does_not_depend_on_the_way_to_it() -> None:
    target = SlabPress.on_sphere(
        diameter_mm=10.0, depth_mm=4.0, contrast=12.0, tissue_young_kpa=7.0, thickness_mm=26.0, force_n=0.6
    )
    one = continuation()
    by_load = one.first(target).result.field
    followed = one.follow(one.first(START), target).result.field
    np.testing.assert_allclose(followed.pressure_kpa, by_load.pressure_kpa, atol=1e-5 * by_load.pressure_kpa.mean())
    np.testing.assert_allclose(followed.face_displacement_mm, by_load.face_displacement_mm, atol=1e-6)
    assert followed.approach_mm == pytest.approx(by_load.approach_mm, rel=1e-6)


def test_on_its_own_lines_it_is_the_press_of_a_load_path() -> None:
    stiff = START.with_contrast(16.0)
    ((with_it, without),) = press_pairs(PROBE, stiff.phantom, forces_n=(0.3,), resolution=COARSE)
    one = continuation()
    uniform = one.first(START)
    np.testing.assert_allclose(uniform.result.field.pressure_kpa, without.pressure_kpa, atol=1e-5)
    followed = one.follow(uniform, stiff).result.field
    np.testing.assert_allclose(followed.pressure_kpa, with_it.pressure_kpa, atol=1e-5)


def test_the_way_around_a_stalled_path_ends_in_the_same_states() -> None:
    stiff = START.with_contrast(16.0).phantom
    pairs = press_pairs(PROBE, stiff, forces_n=(0.3, 0.5), resolution=COARSE)
    for (with_it, _), found in zip(pairs, path_around(PROBE, stiff, (0.3, 0.5), COARSE), strict=True):
        np.testing.assert_allclose(found.field.pressure_kpa, with_it.pressure_kpa, atol=1e-5)


@pytest.mark.slow
def test_soft_tissue_wraps_around_the_rim() -> None:
    one = continuation()
    with pytest.raises(MechanicsError, match="because the tissue wraps around the probe's rim; the last press that"):
        one.follow(one.first(START), replace(START, force_n=2.5))


@given(fraction=st.floats(0.0, 1.0))
def test_a_way_between_presses_stays_between_them(fraction: float) -> None:
    target = SlabPress.on_sphere(
        diameter_mm=3.0, depth_mm=11.0, contrast=20.0, tissue_young_kpa=2.0, thickness_mm=40.0, force_n=1.5
    )
    way = START.towards(target, fraction)
    slab, sphere = way.phantom, way.phantom.inclusion
    assert sphere is not None
    assert slab.young_kpa == pytest.approx(5.0 * (2.0 / 5.0) ** fraction)
    assert sphere.young_kpa == pytest.approx(5.0 * (40.0 / 5.0) ** fraction)
    assert sphere.diameter_mm == pytest.approx(8.0 - 5.0 * fraction)
    assert slab.thickness_mm == pytest.approx(30.0 + 10.0 * fraction)
    assert way.force_n == pytest.approx(0.3 * 5.0**fraction)
