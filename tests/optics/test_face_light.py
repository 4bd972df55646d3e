"""The light on a dented face: its terms and the camera's map, rays through dents that no fit has seen, symmetry."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import erf

from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.files.cache import cache_folder
from tsis.model.calibration import LightMap
from tsis.model.probe import FOUR_LEDS, Led
from tsis.optics import face_light as room
from tsis.optics.angles import real_contact
from tsis.optics.face_light import (
    POWERS,
    Irradiance,
    irradiance,
    leaving_light,
    powers,
    slope_terms,
    smooth,
    symmetries,
    watched_slopes,
)
from tsis.optics.rays.geometry import evenly_pressed_face, evenly_raised_face, hertz_dent
from tsis.optics.rays.tracing import trace_rays

if TYPE_CHECKING:
    from pathlib import Path


NODES = np.linspace(-10.0, 10.0, 21)
SLOPE = st.floats(-0.1, 0.1)
PLACE = st.floats(-9.0, 9.0)


def light(**changes: Any) -> Irradiance:
    """Light that grows along x and with the square of the displacement, with a flux and even terms."""
    terms = np.zeros((3, len(POWERS), 21, 21))
    known = np.array([0.0, 1.0, 2.0])
    terms[:, 0] = (1 + 0.02 * NODES) * (1 + 0.3 * known**2)[:, None, None]
    terms[:, 1], terms[:, 2] = 0.5, -0.25
    terms[:, POWERS.index((2, 0))] = 2.0
    terms[:, POWERS.index((2, 2))] = 3.0
    fields: dict[str, Any] = {
        "radius_mm": 10.0,
        "nodes_mm": NODES,
        "displacement_mm": known,
        "terms": terms,
        "lift_per_mm": 0.1,
        "depletion": 0.4,
        "mean_per_mm2": 1e-3,
        "error": 0.01,
    }
    return Irradiance(**(fields | changes))


@given(x=PLACE, y=PLACE, u=st.floats(0.0, 2.5), sx=SLOPE, sy=SLOPE)
def test_terms_are_followed_exactly(x: float, y: float, u: float, sx: float, sy: float) -> None:
    found = light().at([x], [y], displacement_mm=u, slope_x=sx, slope_y=sy).item()
    level = (1 + 0.02 * x) * (1 + 0.3 * u**2)
    expected = (level + 0.5 * sx - 0.25 * sy + 2 * sx**2 + 3 * sx**2 * sy**2) * np.exp(0.1 * u)
    assert found == pytest.approx(expected, rel=1e-12)


def test_it_is_never_negative_and_goes_on_beyond_its_ends() -> None:
    steeply_lit = light(terms=light().terms * np.where(np.arange(11) == 2, 20.0, 1.0)[:, None, None])
    assert steeply_lit.at([0.0], [0.0], slope_y=0.4).item() == 0.0
    steepest, steeper = (light().at([0.0], [0.0], slope_x=slope).item() for slope in (0.5, 3.0))
    assert steeper == pytest.approx(steepest, rel=1e-12), "as far as the even terms are known"
    assert light().at([99.0], [0.0]).item() == pytest.approx(1.2)
    deepest = light(lift_per_mm=0.0).at([0.0], [0.0], displacement_mm=[[7.0]]).item()
    assert deepest == pytest.approx(1 + 0.3 * 2.5**2), "a quarter beyond the last known displacement"


def test_a_press_becomes_a_map_that_holds_its_dent() -> None:
    dent = hertz_dent(10.0, tip_radius_mm=8.0, depth_mm=0.5, peak_pressure_kpa=10.0, offset_mm=(1.0, -2.0))
    shown = light().on(dent)
    # Inside the contact the dent is a paraboloid.
    x, y = 1.5, -2.5
    moved, slope_x, slope_y = 0.5 - (0.5**2 + 0.5**2) / 16, -0.5 / 8, 0.5 / 8
    expected = light().at([x], [y], displacement_mm=moved, slope_x=slope_x, slope_y=slope_y).item()
    assert shown.at([x], [y]).item() == pytest.approx(expected, rel=2e-3)
    assert not shown.growth_per_mm.any()
    assert not shown.flux_x.any()


def test_contact_darkens_the_whole_face_by_what_it_takes() -> None:
    dent = hertz_dent(10.0, tip_radius_mm=8.0, depth_mm=0.5, peak_pressure_kpa=10.0, offset_mm=(1.0, -2.0))
    shown = light().on(dent)
    bare = light(depletion=0.0).on(dent, saturation_kpa=10.0).relative
    np.testing.assert_allclose(light().on(dent, saturation_kpa=1e6).relative, shown.relative, rtol=1e-4)
    np.testing.assert_allclose(bare, shown.relative, rtol=1e-12)
    left = light().on(dent, saturation_kpa=10.0).relative / bare
    assert np.ptp(left) == pytest.approx(0.0, abs=1e-12), "contact darkens the whole face alike"
    even = light(terms=np.where(np.arange(11) == 0, 1.0, 0.0)[:, None, None] * np.ones((3, 1, 21, 21)), lift_per_mm=0.0)
    left = even.on(dent, saturation_kpa=10.0).relative
    # A contact of 2 mm on a face of 10 mm, whose pressure is 10 kPa times sqrt(1 - r^2) at the share r of its radius.
    touching, _ = quad(lambda r: 2 * r * erf(np.sqrt(np.pi * (1 - r**2)) / 2), 0.0, 1.0)
    assert 1 / left[0, 0] - 1 == pytest.approx(0.4 * touching * (2.0 / 10.0) ** 2, rel=0.02)


def test_small_dents_are_followed_by_the_map_of_the_undented_face() -> None:
    linear, whole = light().near_undented(), light()
    for moved in (0.0, 0.175, 0.35):  # on its parabola
        at: dict[str, Any] = {"displacement_mm": moved, "slope_x": 0.0, "slope_y": 0.0}
        np.testing.assert_allclose(linear.at([1.0, 3.0], [2.0], **at), whole.at([1.0, 3.0], [2.0], **at), rtol=1e-12)
    at = {"displacement_mm": 0.25, "slope_x": 0.0, "slope_y": 0.0}
    np.testing.assert_allclose(linear.at([1.0, 3.0], [2.0], **at), whole.at([1.0, 3.0], [2.0], **at), rtol=1e-4)


def test_so_they_are_when_tilted_as_much_as_a_typical_dent_displaces() -> None:
    """0.5 and -0.25 of light that has grown by 0.3 u**2."""
    linear, typical = light().near_undented(), 0.75 * 0.35
    level = (1 + 0.02 * NODES) * (1 + 0.3 * typical**2)
    np.testing.assert_allclose(linear.flux_x, np.broadcast_to(0.5 / level, linear.flux_x.shape), rtol=1e-12)
    np.testing.assert_allclose(linear.flux_y, np.broadcast_to(-0.25 / level, linear.flux_y.shape), rtol=1e-12)


def test_growth_beyond_the_rim_is_that_of_the_nearest_place_inside() -> None:
    dark = light().terms.copy()
    outside = np.hypot(NODES, NODES[:, None]) > 10.0
    dark[1:, 0, outside] = 0.0
    np.testing.assert_allclose(
        light(terms=dark).near_undented().growth_per_mm, light().near_undented().growth_per_mm, rtol=1e-12
    )


def test_growth_is_bounded_where_there_is_hardly_any_light() -> None:
    dark = light().terms.copy()
    dark[0, 0, 10, 10] = 0.0
    found = light(terms=dark).near_undented()
    assert found.growth_per_mm[10, 10] == found.growth_per_mm.max() == 2.0
    assert np.abs(found.bend_per_mm2).max() <= 2.0 / 0.35


@pytest.mark.parametrize(
    ("changes", "phrase"),
    [
        ({"nodes_mm": np.zeros(21)}, "nodes_mm must hold at least two ascending"),
        ({"terms": np.ones((3, 2, 21, 21))}, "terms must have the shape (3, 11, 21, 21)"),
        ({"terms": np.full((3, 11, 21, 21), np.nan)}, "terms must be finite"),
        ({"lift_per_mm": np.inf}, "lift_per_mm must lie in"),
        ({"lift_per_mm": 10.5}, "lift_per_mm must lie in [-10, 10]"),
        ({"radius_mm": -1.0}, "radius_mm must lie in"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        light(**changes)
    assert phrase in str(refused.value)


PROBE = replace(load_probe("tsis-2011"), leds=FOUR_LEDS)  # level lamps at half height


@pytest.fixture(scope="module")
def fitted() -> Irradiance:
    return irradiance(PROBE, rays=1e6, cached=False)


@pytest.mark.slow
def test_it_predicts_what_leaves_a_dent_that_no_fit_has_seen(fitted: Irradiance) -> None:
    # Twice as blunt as any dent of the fit, beside the axis, and in partial contact.
    dent = hertz_dent(12.0, tip_radius_mm=18.0, depth_mm=0.5, peak_pressure_kpa=15.0, offset_mm=(-2.0, 1.0))
    traced = trace_rays(PROBE, dent, rays=1.5e6, seed=99)
    model, _ = leaving_light(fitted, dent, saturation_kpa=20.0, bins=24)
    touched = traced.coupled > 0.3 * traced.coupled.max()
    error = model[touched] / traced.coupled[touched] - 1
    noise = traced.coupled_error[touched] / traced.coupled[touched]
    assert abs(error.mean()) < 0.04
    assert np.sqrt((error**2).mean() - (noise**2).mean()) < 0.05
    even, _ = leaving_light(fitted, dent, saturation_kpa=20.0, bins=24, by=LightMap.uniform())
    error_of_even = even[touched] / traced.coupled[touched] - 1
    assert np.sqrt((error_of_even**2).mean()) > 5 * np.sqrt((error**2).mean()), "what it is good for"


def test_it_adds_up_to_the_light_that_arrives(fitted: Irradiance) -> None:
    arriving = trace_rays(PROBE, rays=1e6, seed=5).arriving
    side = np.linspace(-11.9, 11.9, 120)
    inside = np.hypot(side, side[:, None]) < 12.0
    total = fitted.mean_per_mm2 * fitted.at(side, side)[inside].sum() * (side[1] - side[0]) ** 2
    assert total == pytest.approx(arriving.sum(), rel=0.02)
    assert fitted.at(side, side)[inside].mean() == pytest.approx(1.0, abs=0.03)
    assert 0.0 < fitted.error < 0.1


def test_four_lamps_make_light_of_their_symmetry(fitted: Irradiance) -> None:
    moved = {"displacement_mm": 0.5}
    here = fitted.at([3.0], [1.0], slope_x=0.1, slope_y=0.05, **moved).item()
    turned = fitted.at([-1.0], [3.0], slope_x=-0.05, slope_y=0.1, **moved).item()
    mirrored = fitted.at([3.0], [-1.0], slope_x=0.1, slope_y=-0.05, **moved).item()
    assert turned == pytest.approx(here, rel=1e-6)
    assert mirrored == pytest.approx(here, rel=1e-6)
    # Most of what reaches the face comes from the far lamp, so a slope that rises away from it catches more.
    facing_far, facing_near = (fitted.at([3.0], [0.0], slope_x=slope).item() for slope in (0.1, -0.1))
    assert facing_far > 1.05 * facing_near


def test_a_raised_face_is_the_traced_one(fitted: Irradiance) -> None:
    traced = trace_rays(PROBE, evenly_raised_face(12.0, 0.4), rays=1e6, seed=3, bins=6)
    side = np.linspace(-12.0, 12.0, 241)[:-1] + 0.05
    model = fitted.mean_per_mm2 * 0.01 * fitted.at(side, side, displacement_mm=0.4) / np.exp(fitted.lift_per_mm * 0.4)
    middle = model.reshape(6, 40, 6, 40).sum(axis=(1, 3))[2:4, 2:4]
    np.testing.assert_allclose(middle, traced.arriving[2:4, 2:4], rtol=0.03)


def test_contact_takes_light_from_the_whole_face(fitted: Irradiance) -> None:
    """The factor of an evenly touched face, by the model and by rays of another seed."""
    touched = evenly_pressed_face(12.0, 20.0)  # the saturation pressure, as in the fit
    bare, covered = (trace_rays(PROBE, face, rays=2e5, seed=8).arriving.sum() for face in (None, touched))
    fraction = float(real_contact(np.array(20.0), 20.0))
    assert 1 / (1 + fitted.depletion * fraction) == pytest.approx(covered / bare, rel=0.02)


@pytest.mark.parametrize(
    ("azimuths", "count"),
    [((0.0, 90.0, 180.0, 270.0), 8), ((0.0, 180.0), 4), ((0.0,), 2), ((0.0, 120.0, 240.0), 2), ((17.0,), 1)],
)
def test_symmetries_of_lamps(azimuths: tuple[float, ...], count: int) -> None:
    assert len(symmetries(replace(PROBE, leds=tuple(Led(azimuth_deg=azimuth) for azimuth in azimuths)))) == count


def test_lamps_of_different_power_break_the_symmetry() -> None:
    leds = (Led(azimuth_deg=0.0), Led(azimuth_deg=180.0, power=2.0))
    assert len(symmetries(replace(PROBE, leds=leds))) == 2


def test_lamps_at_one_azimuth_match_those_of_their_own_power() -> None:
    """Seen from above every weak lamp falls on a stronger one, and is no image of it."""
    above = (Led(azimuth_deg=0.0), Led(azimuth_deg=0.0, power=2.0))
    across = tuple(replace(led, azimuth_deg=180.0) for led in above)
    assert len(symmetries(replace(PROBE, leds=(*above, across[1])))) == 2
    assert len(symmetries(replace(PROBE, leds=(*above, *across)))) == 4


def test_terms_of_slopes_are_found_again() -> None:
    rng = np.random.default_rng(2)
    known = rng.standard_normal((11, 2, 2))
    tilted = np.einsum("tk,tij->kij", powers(*watched_slopes().T), known)
    np.testing.assert_allclose(slope_terms(known[0], known[1:3], tilted), known, atol=1e-10)


def test_smoothing_keeps_cubic_surfaces() -> None:
    def surface(x: Any, y: Any) -> Any:
        return 1 + 0.1 * x - 0.02 * x * y + 0.001 * (x**3 - y**2 * x)

    fine = (np.arange(24 * 50) + 0.5) / 50 - 12.0
    bins = surface(fine, fine[:, None]).reshape(24, 50, 24, 50).mean(axis=(1, 3))
    nodes = np.linspace(-12.0, 12.0, 13)
    inside = np.hypot(nodes, nodes[:, None]) < 10.0
    found = smooth(bins, 12.0, nodes)
    np.testing.assert_allclose(found[inside], surface(nodes, nodes[:, None])[inside], atol=1e-3)


def test_light_is_kept_on_disk_and_damage_is_noticed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("TSIS_CACHE_DIR", str(tmp_path))
    few: dict[str, Any] = {"rays": 1e5, "seed": 3}
    parts: list[tuple[int, int]] = []
    first = irradiance(PROBE, **few, progress=lambda done, total: parts.append((done, total)))
    assert parts == [(i, 8) for i in range(1, 9)]

    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("traced again")

    with monkeypatch.context() as patched:
        patched.setattr(room, "trace_batches", refuse)
        np.testing.assert_array_equal(irradiance(PROBE, **few).terms, first.terms)
        stiffer = tuple(replace(layer, young_kpa=1.0) for layer in PROBE.layers)
        np.testing.assert_array_equal(irradiance(replace(PROBE, layers=stiffer), **few).terms, first.terms)
        others: list[dict[str, Any]] = [few | {"seed": 4}, few | {"index_outside": 1.33}]
        for other in others:
            with pytest.raises(AssertionError, match="traced again"):
                irradiance(PROBE, **other)
    (file,) = (cache_folder() / "irradiance").iterdir()
    file.write_bytes(file.read_bytes()[:-7])
    again = irradiance(PROBE, **few)
    np.testing.assert_array_equal(again.terms, first.terms)
    assert again.lift_per_mm == first.lift_per_mm


def test_a_probe_in_the_dark_is_refused() -> None:
    dark = replace(PROBE, leds=(Led(height_mm=12.9, diameter_mm=0.01, aim_deg=79.0, half_angle_deg=1.0),))
    with pytest.raises(InputError, match="leds must light the face"):
        irradiance(dark, rays=1e5, cached=False)


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"probe": None}, "probe must be a Probe"),
        ({"rays": 10}, "rays must lie in"),
        ({"rays": 1e5 + 0.5}, "rays must be a whole number"),
        ({"seed": 0.5}, "seed must be a whole number"),
        ({"seed": -1}, "seed must lie in"),
    ],
)
def test_bad_input_of_a_trace_is_refused_in_one_sentence(given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        irradiance(given.pop("probe", PROBE), cached=False, **given)
    assert phrase in str(refused.value)
