"""Rays against Snell, Fresnel and geometry, the tracer's parts by themselves, and the interpreter."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import map_coordinates
from tests.interpreted import assert_interpreted_alike

from tsis.catalog.probes import load_probe
from tsis.model.probe import Glass, Layer, Led, Probe
from tsis.optics.angles import fresnel
from tsis.optics.rays.geometry import (
    contact_fraction,
    evenly_pressed_face,
    evenly_raised_face,
    height_and_slopes,
    heights,
    hertz_dent,
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
    MAPS,
    MEETINGS,
    REFLECTED,
    TALLIES,
    Record,
    _arrive,
    _bin,
    _enter,
    _record_reflected,
    emitted,
    follow,
    lamps,
    mirrored,
    reflectance,
    refracted,
    trace_batch,
)
from tsis.optics.rays.tracing import follow_path

if TYPE_CHECKING:
    from tsis.model.press import PressField, PressMap
    from tsis.optics.rays.geometry import Scene
    from tsis.optics.rays.kernel import Lamps, Vector


ANGLE = st.floats(0.0, 1.57)
INDEX = st.floats(1.0, 4.0)


def stack(*indices: float, glass: float = 1.41) -> Probe:
    """A probe of 12 mm with layers of 2 mm."""
    layers = tuple(Layer(thickness_mm=2.0, young_kpa=50.0, refractive_index=index) for index in indices)
    return Probe(radius_mm=12.0, layers=layers, glass=Glass(thickness_mm=3.0, refractive_index=glass))


def unweakened(probe: Probe) -> Scene:
    """A probe in which no ray ends by chance."""
    return scene(probe, None)._replace(weak=0.0, most_meetings=30)


@given(angle=ANGLE, here=INDEX, there=INDEX)
def test_reflection_is_fresnels_mean(angle: float, here: float, there: float) -> None:
    back, through = reflectance(np.cos(angle), here, there)
    closed = fresnel(np.degrees(angle), index_from=here, index_to=there)
    assert back == pytest.approx(float(closed.reflected_s + closed.reflected_p) / 2, abs=1e-12)
    if back < 1:
        # Squared, since a cosine near one holds no more of the sine.
        assert there**2 * (1 - through**2) == pytest.approx((here * np.sin(angle)) ** 2, abs=1e-12)


@pytest.mark.parametrize(
    ("angle_deg", "here", "there", "expected"),
    [
        (0.0, 1.0, 1.41, (0.41 / 2.41) ** 2),
        (0.0, 1.41, 1.0, (0.41 / 2.41) ** 2),
        (45.18, 1.41, 1.0, 1.0),
        (80.0, 1.41, 1.0, 1.0),
        # At Brewster's angle only light polarized across reflects: ((n^2 - 1) / (n^2 + 1))^2, half of the light.
        (np.degrees(np.arctan(1.5)), 1.0, 1.5, ((1.5**2 - 1) / (1.5**2 + 1)) ** 2 / 2),
    ],
)
def test_known_reflections(angle_deg: float, here: float, there: float, expected: float) -> None:
    assert reflectance(np.cos(np.radians(angle_deg)), here, there)[0] == pytest.approx(expected, abs=1e-12)


@given(angle=ANGLE, turn=st.floats(0.0, 6.28), tilt=st.floats(-1.0, 1.0), ratio=st.floats(0.5, 2.0))
def test_directions_keep_their_length_and_plane(angle: float, turn: float, tilt: float, ratio: float) -> None:
    normal = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    across, along = np.array([np.cos(tilt), 0.0, -np.sin(tilt)]), np.array([0.0, 1.0, 0.0])
    flat = np.cos(turn) * across + np.sin(turn) * along
    came = np.sin(angle) * flat - np.cos(angle) * normal
    cosine = float(-came @ normal)
    back = np.array(mirrored(tuple(came), tuple(normal), cosine))
    np.testing.assert_allclose(back, np.sin(angle) * flat + np.cos(angle) * normal, atol=1e-12)
    through = np.sqrt(max(0.0, 1 - (ratio * np.sin(angle)) ** 2))
    if through > 0:
        behind = np.array(refracted(tuple(came), tuple(normal), cosine, through, ratio))
        np.testing.assert_allclose(behind, ratio * np.sin(angle) * flat - through * normal, atol=1e-12)


def test_a_ray_through_the_axis_has_powers_in_a_known_sequence() -> None:
    # Along a diameter every wall is met straight on: T, T R, T R^2, ... with R = ((n - 1) / (n + 1))^2.
    path = follow_path(unweakened(stack(1.41)), (12.0, 0.0, 1.0), (-1.0, 0.0, 0.0))
    reflected = (0.41 / 2.41) ** 2
    np.testing.assert_allclose(path[1:20, 3], (1 - reflected) * reflected ** np.arange(19), rtol=1e-12)
    np.testing.assert_allclose(path[1:20, 0], 12.0 * (-1.0) ** np.arange(19), atol=1e-12)
    np.testing.assert_allclose(path[1:20, 2], 1.0, atol=1e-12)


def test_total_reflection_keeps_all_power_and_a_slanting_ray_zigzags() -> None:
    # In the plane through the axis: into the wall at 30 degrees, then down to the face and up to the glass's top.
    start = np.array([12.0, 0.0, 1.0])
    down = np.array([-np.cos(np.pi / 6), 0.0, -np.sin(np.pi / 6)])
    path = follow_path(unweakened(stack(1.41)), start, down)
    sine = 0.5 / 1.41
    run = np.sqrt(1 - sine**2) / sine  # along the diameter per mm of height
    entered = 1 - float(sum(getattr(fresnel(30.0, index_from=1.0, index_to=1.41), f"reflected_{p}") for p in "sp")) / 2
    np.testing.assert_allclose(path[2], [12.0 - run, 0.0, 0.0, entered], atol=1e-12)
    np.testing.assert_allclose(path[3], [12.0 - 6 * run, 0.0, 5.0, entered], atol=1e-12)


@settings(max_examples=50)
@given(data=st.data())
def test_a_flat_stack_keeps_index_times_sine(data: st.DataObject) -> None:
    probe = stack(*data.draw(st.lists(st.floats(1.3, 1.6), min_size=2, max_size=4)), glass=1.515)
    view = unweakened(probe)
    height = data.draw(st.floats(0.1, probe.thickness_mm + 2.9))
    elevation, azimuth = data.draw(st.floats(-1.2, 1.2)), data.draw(st.floats(-0.6, 0.6))
    direction = np.array([-np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
    path = follow_path(view, (12.0, 0.0, height), direction, chance=data.draw(st.integers(0, 2**60)))
    legs = np.diff(path[1:, :3], axis=0)
    length = np.linalg.norm(legs, axis=1)
    legs, middle = legs[length > 1e-6] / length[length > 1e-6, None], (path[1:-1, 2] + path[2:, 2])[length > 1e-6] / 2
    medium = np.searchsorted(view.level, middle) - 1
    kept = view.indices[medium] * np.hypot(legs[:, 0], legs[:, 1])
    np.testing.assert_allclose(kept, kept[0], rtol=1e-9)


def test_a_dented_stack_bends_at_displaced_interfaces() -> None:
    # Layers keep their shares of the thickness under an even displacement: the interface lies at 2 + 0.5 u.
    probe = stack(1.41, 1.45, glass=1.45)
    view = scene(probe, evenly_raised_face(12.0, 1.0))._replace(weak=0.0)
    down = np.array([-np.cos(0.5), 0.0, np.sin(0.5)])
    path = follow_path(view, (12.0, 0.0, 1.5), down)
    assert path[2, 2] == pytest.approx(2.5, abs=1e-9)


def test_rays_that_miss_stay_outside() -> None:
    view = scene(load_probe("tsis-2011"), None)
    for start, direction in (((12.0, 0.0, 5.0), (1.0, 0.0, 0.0)), ((12.0, 0.0, 20.0), (-1.0, 0.0, 0.0))):
        assert len(follow_path(view, start, direction)) == 1


def test_glass_alone_carries_light_that_no_layer_takes() -> None:
    # Straight into the glass at 5 degrees: n sin = 1.515 cos(5 deg / 1.515) > 1.41, so it never comes down.
    probe = replace(load_probe("tsis-2011"), glass=Glass(thickness_mm=3.0, refractive_index=1.515))
    path = follow_path(scene(probe, None), (12.0, 0.0, 11.0), (-np.cos(0.087), 0.0, -np.sin(0.087)))
    assert path[1:, 2].min() >= 10.0 - 1e-9


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


DENT = hertz_dent(12.0, tip_radius_mm=6.0, depth_mm=1.2, peak_pressure_kpa=5.0, offset_mm=(1.0, -2.0))
SLOPES = np.array([[0.1, 0.0], [-0.3, 0.2]])


def _empty_record(slopes: np.ndarray) -> Record:
    totals, maps, tilted = np.zeros(TALLIES), np.zeros((MAPS, 6, 6)), np.zeros((len(slopes), 6, 6))
    return Record(totals=totals, maps=maps, slopes=slopes, tilted=tilted, path=np.zeros((30, 4)))


def _traced(view: Scene, lit: Lamps, rays: int, slopes: np.ndarray) -> Record:
    """Record of some rays of each lamp; the path is that of the last ray."""
    record = _empty_record(slopes)
    trace_batch(view, lit, 3, 1, rays, record)
    return record


def _followed(view: Scene, start: Vector, direction: Vector) -> tuple[int, Record]:
    """Points of one ray's path, and its record."""
    record = _empty_record(SLOPES)
    return follow(view, start, direction, 1.0, np.uint64(7), record), record


@pytest.mark.parametrize(
    ("glass", "pressed", "absorption", "slopes"),
    [
        (1.41, None, 0.0, SLOPES[:0]),
        (1.515, None, 0.01, SLOPES),
        (1.515, evenly_pressed_face(12.0, 4.0), 0.0, SLOPES),
        (1.515, DENT, 0.002, SLOPES),
        (1.515, evenly_raised_face(12.0, 1.0), 0.0, SLOPES),
    ],
    ids=["untouched", "absorbing", "contact", "dent", "raised"],
)
def test_rays_equal_those_of_the_interpreter(
    glass: float, pressed: PressField | PressMap | None, absorption: float, slopes: np.ndarray
) -> None:
    probe = replace(PROBE, glass=Glass(thickness_mm=3.0, refractive_index=glass))
    view = scene(probe, pressed, saturation_kpa=10.0, absorption_per_mm=absorption)
    totals = assert_interpreted_alike(_traced, view, lamps(probe), 24, slopes).totals
    assert totals[MEETINGS] > 150
    assert (totals[CONTACT] > 0) == (pressed is not None and bool(np.any(pressed.pressure_kpa > 0)))


@pytest.mark.parametrize(
    ("start", "elevation_deg"),
    [((12.0, 0.0, 5.0), 180.0), ((12.0, 0.0, 20.0), 0.0), ((12.0, 0.0, 11.5), -10.0), ((13.0, 1.0, 4.0), 30.0)],
    ids=["outward", "above", "in the glass", "in the layers"],
)
@pytest.mark.parametrize("most_meetings", [4, 40])
def test_a_path_equals_that_of_the_interpreter(start: Vector, elevation_deg: float, most_meetings: int) -> None:
    probe = replace(PROBE, glass=Glass(thickness_mm=3.0, refractive_index=1.515))
    view = scene(probe, DENT, aperture=0.8)._replace(weak=0.0, most_meetings=most_meetings)
    elevation = np.radians(elevation_deg)
    direction = (-float(np.cos(elevation)), 0.0, float(np.sin(elevation)))
    points, _ = assert_interpreted_alike(_followed, view, start, direction)
    assert (points > 1) == (start[2] < 20 and elevation_deg < 90)
