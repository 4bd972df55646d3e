"""Single rays against Snell, Fresnel and geometry."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.catalog.probes import load_probe
from tsis.model.probe import Glass, Layer, Probe
from tsis.optics.angles import fresnel
from tsis.optics.rays.geometry import evenly_raised_face, scene
from tsis.optics.rays.kernel import mirrored, reflectance, refracted
from tsis.optics.rays.tracing import follow_path

if TYPE_CHECKING:
    from tsis.optics.rays.geometry import Scene

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
