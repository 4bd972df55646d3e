"""Parts of the tracer by themselves: lamps, the spline of the face, its contact, and what one arrival counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import map_coordinates

from tsis.catalog.probes import load_probe
from tsis.model.probe import Glass, Led
from tsis.optics.rays.geometry import (
    contact_fraction,
    evenly_pressed_face,
    height_and_slopes,
    heights,
    scene,
    way_to_surface,
)
from tsis.optics.rays.kernel import (
    ARRIVING,
    BEYOND,
    CONTACT,
    COUPLED,
    FACE,
    FLUX_X,
    FLUX_Y,
    LOST,
    REFLECTED,
    TALLIES,
    Record,
    _arrive,
    _bin,
    _enter,
    _record_reflected,
    emitted,
    lamps,
)

PROBE = load_probe("tsis-2011")
SIDE = np.linspace(-12.0, 12.0, 49)
BUMP = 0.3 * np.exp(-((SIDE - 1) ** 2 + (SIDE[:, None] + 2) ** 2) / 20)
CONTACT_FRACTION = np.clip(1 - np.hypot(SIDE, SIDE[:, None]) / 8, 0.0, 1.0)
FACE_OF_GRID = heights(SIDE, BUMP, CONTACT_FRACTION)
PLACES = np.random.default_rng(1).uniform(-9.0, 9.0, size=(40, 2))


def test_rays_start_on_the_disc_of_the_lamp_and_half_of_the_intensity_lies_at_half_angle() -> None:
    lamp = Led(azimuth_deg=30.0, aim_deg=20.0, half_angle_deg=25.0, diameter_mm=4.0, height_mm=5.0)
    lit = lamps(replace(PROBE, leds=(lamp,)))
    outwards = np.array([np.cos(np.radians(30)), np.sin(np.radians(30)), 0.0])
    axis = np.array([*(-outwards[:2] * np.cos(np.radians(20))), np.sin(np.radians(20))])
    exponent = np.log(0.5) / np.log(np.cos(np.radians(25)))
    within = 1 - np.cos(np.radians(25)) ** (exponent + 1)  # fraction of the light of a cosine power law
    for u, v, t in np.random.default_rng(2).uniform(size=(20, 3)):
        place, direction = (np.array(found) for found in emitted(lit, 0, u, v, within, t))
        centre = PROBE.radius_mm * outwards + [0.0, 0.0, 5.0]
        assert (place - centre) @ outwards == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(place - centre) == pytest.approx(2.0 * np.sqrt(u))
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        assert np.degrees(np.arccos(direction @ axis)) == pytest.approx(25.0)
    around = [np.array(emitted(lit, 0, 0.0, 0.0, within, t)[1]) for t in np.arange(12) / 12]
    np.testing.assert_allclose(np.mean(around, axis=0), axis * np.cos(np.radians(25)), atol=1e-12)
    rim = [np.array(emitted(lit, 0, 1.0, v, 0.0, 0.0)[0]) for v in np.arange(12) / 12]
    np.testing.assert_allclose(np.mean(rim, axis=0), PROBE.radius_mm * outwards + [0.0, 0.0, 5.0], atol=1e-12)


def test_the_face_is_the_quadratic_spline_with_its_own_slopes() -> None:
    def spline(x: float, y: float) -> float:
        place = [[(y - SIDE[0]) / 0.5], [(x - SIDE[0]) / 0.5]]
        return float(map_coordinates(BUMP, place, order=2, mode="mirror")[0])

    step = 1e-5
    for x, y in PLACES:
        height, along, across = height_and_slopes(FACE_OF_GRID, x, y)
        assert height == pytest.approx(spline(x, y), abs=1e-12)
        assert along == pytest.approx((spline(x + step, y) - spline(x - step, y)) / (2 * step), abs=1e-6)
        assert across == pytest.approx((spline(x, y + step) - spline(x, y - step)) / (2 * step), abs=1e-6)


def test_no_slope_of_the_face_exceeds_its_steepest() -> None:
    slopes = np.array([height_and_slopes(FACE_OF_GRID, x, y)[1:] for x in SIDE[2:-2:2] for y in SIDE[2:-2:2]])
    largest = np.hypot(*np.abs(slopes).max(axis=0))  # the steepest along x and along y, wherever they are
    assert largest <= FACE_OF_GRID.steepest < 1.2 * largest


def test_contact_is_linear_between_grid_points() -> None:
    linear = RegularGridInterpolator((SIDE, SIDE), CONTACT_FRACTION)
    for x, y in PLACES:
        assert contact_fraction(FACE_OF_GRID, x, y) == pytest.approx(float(linear([y, x])[0]), abs=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_way_to_a_plane_is_its_distance_over_the_cosine(side: float) -> None:
    flat = heights(SIDE, np.zeros_like(BUMP), CONTACT_FRACTION)._replace(lowest=0.2, highest=0.2)
    direction = (0.6, 0.0, -0.8 * side)
    level, pull = 4.0, 0.5
    position = (1.0, 2.0, 4.1 + side * 1.6)
    found = way_to_surface(flat, level, pull, side, position, direction, 100.0, False)
    assert found == pytest.approx(2.0)
    assert way_to_surface(flat, level, pull, side, position, direction, 1.9, False) == np.inf
    assert way_to_surface(flat, level, pull, side, position, direction, 100.0, True) == np.inf
    assert way_to_surface(flat, level, pull, side, position, (0.6, 0.0, 0.8 * side), 100.0, False) == np.inf


@pytest.mark.parametrize(("elevation_deg", "turns_back"), [(20.0, True), (33.0, True), (34.5, False), (60.0, False)])
def test_light_in_the_glass_that_the_layers_turn_back_is_out_of_reach(elevation_deg: float, turns_back: bool) -> None:
    """Total reflection at the layers begins at sin(elevation)^2 = 1.515^2 - 1.41^2, which is 33.6 degrees."""
    view = scene(replace(PROBE, glass=Glass(thickness_mm=3.0, refractive_index=1.515)), None)
    assert float(np.degrees(np.arcsin(np.sqrt(1.515**2 - float(view.indices[0]) ** 2)))) == pytest.approx(33.6, abs=0.1)
    elevation, totals = np.radians(elevation_deg), np.zeros(TALLIES)
    direction = (-np.cos(elevation), 0.0, -np.sin(elevation))
    start = (12.0 - direction[0], 0.0, 11.5 - direction[2])
    medium, place, inside, weight = _enter(view, start, direction, 0.5, totals)
    assert medium == len(view.indices) - 1
    assert place == pytest.approx((12.0, 0.0, 11.5))
    assert inside[2] == pytest.approx(direction[2] / 1.515)
    assert weight + totals[REFLECTED] == pytest.approx(0.5)
    assert totals[BEYOND] == pytest.approx(weight if turns_back else 0.0)


def test_an_arrival_is_counted_in_its_bin_by_its_direction() -> None:
    """Light that falls at 60 degrees on a face that is half touched; tilted faces catch ``1 + flux slope`` of it."""
    view = scene(PROBE, evenly_pressed_face(12.0, 10.0), saturation_kpa=20.0)
    slopes = np.array([[0.2, 0.0], [0.0, -0.4], [-2.0, 0.0]])
    record = Record(
        totals=np.zeros(TALLIES),
        maps=np.zeros((5, 8, 8)),
        slopes=slopes,
        tilted=np.zeros((3, 8, 8)),
        path=np.zeros((0, 4)),
    )
    position, weight, back = (-4.0, 7.0, 0.0), 0.25, 0.3
    direction = (np.sin(np.pi / 3), 0.0, -np.cos(np.pi / 3))
    left = _arrive(view, record, position, 0.0, 0.0, direction, weight, back)
    row, column = _bin(view, record, position)
    assert (row, column) == (6, 2)  # bins of 3 mm from -12 mm
    fraction = float(contact_fraction(view.face, -4.0, 7.0))
    assert 0.0 < fraction < 1.0
    assert left == pytest.approx(weight * (fraction + (1 - fraction) * (1 - back)))
    flux = np.sqrt(3.0)
    expected = {
        ARRIVING: weight,
        FLUX_X: weight * flux,
        FLUX_Y: 0.0,
        LOST: weight * (1 - fraction) * (1 - back),
        COUPLED: weight * fraction,
    }
    for part, value in expected.items():
        assert record.maps[part, row, column] == pytest.approx(value)
        assert record.maps[part].sum() == pytest.approx(value)
    np.testing.assert_allclose(record.tilted[:, row, column], [weight * (1 + 0.2 * flux), weight, 0.0])
    assert [record.totals[CONTACT], record.totals[FACE]] == pytest.approx([expected[COUPLED], expected[LOST]])


def test_reflected_light_counts_on_steeper_faces_by_the_light_that_fell_on_this_one() -> None:
    """The flux through a face is the direction times its normal ``(slope_x, slope_y, -1)``."""
    view = scene(PROBE, evenly_pressed_face(12.0, 10.0))
    steeper = np.array([[1.0, 0.0], [0.2, 1.5], [-3.0, 0.0]])
    record = Record(
        totals=np.zeros(TALLIES),
        maps=np.zeros((5, 8, 8)),
        slopes=steeper,
        tilted=np.zeros((3, 8, 8)),
        path=np.zeros((0, 4)),
    )
    along, across = slope = (0.3, -0.5)
    normal = np.array([*slope, -1.0])
    came = np.array([0.9, 0.1, -0.2]) / np.linalg.norm([0.9, 0.1, -0.2])
    cosine = float(came @ normal) / float(np.linalg.norm(normal))
    went = came - 2 * (came @ normal) / (normal @ normal) * normal
    x, y, z = went.tolist()
    _record_reflected(view, record, (1.0, 1.0, 0.0), along, across, (x, y, z), 0.4, cosine)
    tilted = np.column_stack([slope + steeper, np.full(3, -1.0)])
    expected = 0.4 * np.maximum(tilted @ went, 0.0) / (came @ normal)
    assert (expected > 0).tolist() == [True, True, False]
    np.testing.assert_allclose(record.tilted.sum(axis=(1, 2)), expected, rtol=1e-12)
