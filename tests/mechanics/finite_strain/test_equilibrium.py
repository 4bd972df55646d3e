"""Presses reached from their neighbours agree with load paths, and errors say where the model ends."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain import equilibrium as load_path
from tsis.mechanics.finite_strain.neo_hookean_press import (
    PressContinuation,
    PressSeries,
    SlabPress,
    path_around,
    press_finite,
    press_pairs,
)
from tsis.mechanics.finite_strain.patches import FiniteResolution

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.mechanics.finite_strain.equilibrium import Potential, State

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


@given(fraction=st.floats(0.0, 1.0))
def test_slab_and_inclusion_change_together_on_the_way(fraction: float) -> None:
    """The deep inclusion of the thick slab does not fit into the thin one, nor half-way into any but its own."""
    thick = SlabPress.on_sphere(
        diameter_mm=25.0, depth_mm=20.0, contrast=3.0, tissue_young_kpa=20.0, thickness_mm=50.0, force_n=2.0
    )
    between = START.towards(thick, fraction)
    assert between.phantom.thickness_mm == pytest.approx(30.0 + 20.0 * fraction)
    inclusion = between.phantom.inclusion
    assert inclusion is not None
    assert inclusion.diameter_mm == pytest.approx(8.0 + 17.0 * fraction)
    assert inclusion.young_kpa == pytest.approx(5.0 * 12.0**fraction)
    assert between.force_n == pytest.approx(0.3 * (2.0 / 0.3) ** fraction)


def test_a_stall_ends_with_another_choice_of_closed_contacts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The state is the same: the choice decides only how Newton's method gets there."""
    one = continuation()
    uniform, target = one.first(START), replace(START, force_n=0.35)
    direct, usual = one.follow(uniform, target), load_path.solve_equilibrium
    stiff = one._model(target).contact.steering

    def stalls(potential: Potential, *args: Any, **options: Any) -> State | None:
        return None if potential.contacts[0].steering == stiff else usual(potential, *args, **options)

    monkeypatch.setattr(load_path, "solve_equilibrium", stalls)
    steered = one.follow(uniform, target)
    difference = steered.result.field.pressure_kpa - direct.result.field.pressure_kpa
    assert np.abs(difference).max() < 1e-5 * direct.result.field.pressure_kpa.mean()
    monkeypatch.setattr("tsis.mechanics.finite_strain.neo_hookean_press.STEERINGS", (1.0,))
    with pytest.raises(MechanicsError, match=r"the press does not converge at 0\.3\d* N on tissue of 5 kPa"):
        one.follow(uniform, target)


@pytest.mark.slow
def test_the_way_around_a_stalled_path_ends_in_the_same_states() -> None:
    stiff = START.with_contrast(16.0).phantom
    pairs = press_pairs(PROBE, stiff, forces_n=(0.3, 0.5), resolution=COARSE)
    for (with_it, _), found in zip(pairs, path_around(PROBE, stiff, (0.3, 0.5), COARSE), strict=True):
        np.testing.assert_allclose(found.field.pressure_kpa, with_it.pressure_kpa, atol=1e-5)


@pytest.fixture(scope="module")
def series(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PressSeries]:
    """Presses on coarse meshes, whose anchors are solved here and cached for these tests alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TSIS_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        result = PressSeries(PROBE, COARSE)
        result.press(START.phantom.without_inclusion(), force_n=0.3)
        yield result


def test_a_series_presses_as_load_paths_do(series: PressSeries) -> None:
    stiff, uniform = START.with_contrast(16.0).phantom, START.phantom.without_inclusion()
    found, alone = (series.press(phantom, force_n=0.4) for phantom in (stiff, uniform))
    path, path_alone = (press_finite(PROBE, phantom, force_n=0.4, resolution=COARSE) for phantom in (stiff, uniform))
    inside = found.radius_mm < 0.8 * PROBE.radius_mm  # ring means: coarse meshes ripple
    for name, within in (("pressure_kpa", 0.03), ("face_displacement_mm", 0.005)):
        signal, expected = (
            (getattr(one, name)[inside] - getattr(other, name)[inside]).reshape(-1, 8).mean(axis=1)
            for one, other in ((found, alone), (path, path_alone))
        )
        assert np.abs(signal - expected).max() < within * np.abs(expected).max(), name
    assert found.approach_mm == pytest.approx(path.approach_mm, rel=2e-3)


def test_a_press_depends_on_none_before_it(series: PressSeries) -> None:
    stiff = START.with_contrast(16.0).phantom
    before = series.press(stiff, force_n=0.4)
    fresh = PressSeries(PROBE, COARSE)  # its anchors come from the cache
    fresh.press(replace(stiff, young_kpa=6.0), force_n=0.5)
    again = fresh.press(stiff, force_n=0.4)
    np.testing.assert_array_equal(again.pressure_kpa, before.pressure_kpa)
    assert series.press(replace(stiff, name="another name"), force_n=0.4) is before


def test_a_series_says_where_the_model_ends(series: PressSeries) -> None:
    with pytest.raises(MechanicsError, match=r"force_n must be at least .* here"):
        series.press(START.phantom, force_n=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "diameter", "within"), [("tsis-domed", 10.0, 0.002), ("tsis-2011", 15.0, 0.005)])
def test_a_series_agrees_with_load_paths_on_default_meshes(name: str, diameter: float, within: float) -> None:
    """Ring means of the signal's pressure over the inner 0.8 of the face, of its peak."""
    probe, stiff = tsis.load_probe(name), replace(START, force_n=0.5).with_contrast(20.0).phantom
    assert stiff.inclusion is not None
    stiff = replace(stiff, inclusion=replace(stiff.inclusion, diameter_mm=diameter, depth_mm=5.0))
    both = [stiff, stiff.without_inclusion()]
    series = PressSeries(probe)
    (one, other), (path, path_other) = (
        [press(phantom, force_n=0.5) for phantom in both]
        for press in (series.press, lambda phantom, force_n: press_finite(probe, phantom, force_n=force_n))
    )
    inside = one.radius_mm < 0.8 * probe.radius_mm
    signal, expected = (
        (a.pressure_kpa - b.pressure_kpa)[inside].reshape(-1, 8).mean(axis=1)
        for a, b in ((one, other), (path, path_other))
    )
    assert np.abs(signal - expected).max() < within * np.abs(expected).max()


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
