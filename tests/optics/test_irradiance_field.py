"""The light on a dented face: what its terms mean, how it becomes a map for the camera, and refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import erf

from tsis.errors import InputError
from tsis.optics.face_light import POWERS, Irradiance
from tsis.optics.rays.geometry import hertz_dent

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
        ({"radius_mm": -1.0}, "radius_mm must lie in"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(changes: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        light(**changes)
    assert phrase in str(refused.value)
