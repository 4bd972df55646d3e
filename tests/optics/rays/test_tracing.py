"""The tally, the maps and the refusals of the tracer."""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tsis.catalog.probes import load_probe
from tsis.errors import InputError
from tsis.model.press import PressField
from tsis.model.probe import FOUR_LEDS, Glass, Layer, Led, Probe
from tsis.optics.rays.geometry import evenly_raised_face, hertz_dent, scene
from tsis.optics.rays.kernel import ARRIVING
from tsis.optics.rays.tracing import trace_batches, trace_paths, trace_rays

PROBE = replace(load_probe("tsis-2011"), leds=FOUR_LEDS)  # level lamps at half height
DENT = hertz_dent(12.0, tip_radius_mm=8.0, depth_mm=1.2, peak_pressure_kpa=25.0)

leds = st.builds(
    Led,
    azimuth_deg=st.floats(-180.0, 180.0),
    height_mm=st.floats(0.0, 4.5),
    aim_deg=st.floats(-60.0, 60.0),
    half_angle_deg=st.floats(2.0, 80.0),
    diameter_mm=st.floats(0.1, 10.0),
    power=st.floats(0.1, 3.0),
)
layers = st.builds(
    Layer, thickness_mm=st.floats(2.0, 5.0), young_kpa=st.just(50.0), refractive_index=st.floats(1.0, 1.8)
)
probes = st.builds(
    Probe,
    radius_mm=st.floats(4.0, 20.0),
    layers=st.lists(layers, min_size=2, max_size=4).map(tuple),
    glass=st.builds(Glass, thickness_mm=st.floats(0.5, 5.0), refractive_index=st.floats(1.0, 1.8)),
    leds=st.lists(leds, min_size=1, max_size=3).map(tuple),
    face_curvature_mm=st.one_of(st.none(), st.floats(80.0, 200.0)),
)


def test_a_face_that_is_not_tilted_catches_what_arrives() -> None:
    """Light that glass or walls have reflected counts when it meets the face, and not where they reflect it."""
    found = trace_batches(scene(PROBE, None), PROBE, rays=20_000, seed=3, bins=8, slopes=[(0.0, 0.0)], threads=1)
    assert found.maps[:, ARRIVING].sum() > 0
    np.testing.assert_allclose(found.tilted[:, 0], found.maps[:, ARRIVING], rtol=1e-12)


def test_the_edge_of_a_dent_is_real_whatever_rounding_makes_of_its_radius() -> None:
    radius, depth = 17.63809712641224, 0.41000000000000003  # whose contact radius squared is not its square in arrays
    dent = hertz_dent(
        radius, tip_radius_mm=radius, depth_mm=depth, peak_pressure_kpa=20.0, offset_mm=(0.2 * radius, 0.0)
    )
    assert dent.face_displacement_mm.max() == pytest.approx(depth, rel=0.01)


@settings(max_examples=25)
@given(probe=probes, depth=st.floats(0.0, 0.3), absorption=st.sampled_from([0.0, 0.05]), seed=st.integers(0, 2**40))
def test_no_light_is_lost_or_made(probe: Probe, depth: float, absorption: float, seed: int) -> None:
    dent = hertz_dent(
        probe.radius_mm,
        tip_radius_mm=probe.radius_mm,
        depth_mm=depth * probe.thickness_mm + 0.01,
        peak_pressure_kpa=20.0,
        offset_mm=(0.2 * probe.radius_mm, 0.0),
    )
    found = trace_rays(probe, dent, rays=2000, seed=seed, absorption_per_mm=absorption)
    assert sum(astuple(found.tally)) == pytest.approx(1.0, abs=1e-12)
    kept = dict(zip(found.tally.__slots__, astuple(found.tally), strict=True))
    assert min(value for name, value in kept.items() if name != "cut_off") >= 0
    assert found.coupled.sum() == pytest.approx(found.tally.contact, abs=1e-12)
    assert found.lost.sum() == pytest.approx(found.tally.face, abs=1e-12)
    assert (found.arriving - found.coupled - found.lost).min() >= -1e-15


def test_rays_that_end_by_chance_are_paid_for_by_those_that_go_on() -> None:
    found = trace_rays(PROBE, rays=20_000)
    assert 0 < found.standard_error.cut_off < 1e-3
    assert abs(found.tally.cut_off) < 4 * found.standard_error.cut_off


def test_a_flat_probe_of_silicone_keeps_its_light_from_the_face() -> None:
    found = trace_rays(PROBE, rays=20_000)
    assert found.tally.face < 1e-6, "only light more than 83 degrees from the horizontal would get out"
    assert found.tally.contact == 0.0
    assert found.arriving.sum() > 0.05
    assert found.out_of_range == 0.0


def test_lamps_at_the_glass_feed_what_never_senses() -> None:
    at_glass = replace(PROBE, leds=(Led(height_mm=11.5, diameter_mm=1.0, half_angle_deg=15.0),))
    found = trace_rays(at_glass, rays=20_000)
    # Light at an angle e above the horizon in air is out of reach when 1.515^2 - sin(e)^2 > 1.41^2.
    limit = np.degrees(np.arcsin(np.sqrt(1.515**2 - 1.41**2)))
    entered = 1 - found.tally.missed - found.tally.reflected
    assert 0.97 * entered < found.out_of_range <= entered
    assert found.arriving.sum() < 0.05 * trace_rays(PROBE, rays=20_000).arriving.sum()
    for beyond, expected in ((-6.0, 1.0), (6.0, 0.0)):
        beam = Led(height_mm=11.5, diameter_mm=0.5, half_angle_deg=1.0, aim_deg=-limit - beyond)
        found = trace_rays(replace(PROBE, leds=(beam,)), rays=20_000)
        entered = 1 - found.tally.missed - found.tally.reflected
        assert found.out_of_range / entered == pytest.approx(expected, abs=0.01)


def test_absorption_is_exact_along_a_diameter() -> None:
    beam = replace(PROBE, leds=(Led(half_angle_deg=1.0, diameter_mm=0.01),))
    found = trace_rays(beam, rays=4000, absorption_per_mm=0.03)
    reflected = (0.41 / 2.41) ** 2
    passed = np.exp(-0.03 * 24.0)
    # Sum of the geometric series of passes; the beam is within a degree or two of the diameter.
    expected = (1 - reflected) * (1 - passed) / (1 - reflected * passed)
    assert found.tally.absorbed == pytest.approx(expected, rel=3e-3)


def test_full_contact_takes_all_that_arrives() -> None:
    full = replace(evenly_raised_face(12.0, 0.0), pressure_kpa=np.full(9, 1e4))
    found = trace_rays(PROBE, full, rays=20_000)
    np.testing.assert_allclose(found.coupled, found.arriving, rtol=1e-12)
    half = replace(full, pressure_kpa=np.full(9, 20.0 * 0.476936276 / 0.886226925))  # erf(0.4769...) is one half
    found = trace_rays(PROBE, half, rays=20_000)
    np.testing.assert_allclose(found.coupled, found.arriving / 2, rtol=1e-6)


def test_a_dent_lets_light_out_by_its_curvature() -> None:
    bare = replace(DENT, pressure_kpa=np.zeros_like(DENT.pressure_kpa))
    found = trace_rays(PROBE, bare, rays=100_000)
    assert found.tally.contact == 0.0
    assert found.tally.face > 20 * found.standard_error.face
    inside = np.hypot(found.x_mm, found.y_mm[:, None]) < 5.0
    assert found.lost[inside].sum() > 0.5 * found.lost.sum()


def test_the_seed_alone_decides() -> None:
    one, other = (trace_rays(PROBE, DENT, rays=5000, seed=4, threads=threads) for threads in (1, 3))
    np.testing.assert_array_equal(one.batches, other.batches)
    assert astuple(one.tally) == astuple(other.tally)
    assert astuple(trace_rays(PROBE, DENT, rays=5000, seed=5).tally) != astuple(one.tally)


def test_turning_the_lamps_turns_the_light() -> None:
    lamp = Led(azimuth_deg=0.0, half_angle_deg=40.0)
    one, turned = (
        trace_rays(replace(PROBE, leds=(replace(lamp, azimuth_deg=azimuth),)), rays=200_000, bins=8)
        for azimuth in (0.0, 90.0)
    )
    np.testing.assert_allclose(np.rot90(one.arriving, -1), turned.arriving, atol=0.05 * one.arriving.max())
    assert one.arriving[4].sum() > 2 * one.arriving[0].sum()
    assert one.flux_x.sum() < -0.5 * one.arriving.sum(), "it runs from the lamp"
    assert abs(one.flux_y.sum()) < 0.05 * abs(one.flux_x.sum())


def test_errors_shrink_with_rays() -> None:
    few, many = (trace_rays(PROBE, DENT, rays=rays) for rays in (4e3, 4e5))
    assert many.standard_error.contact < few.standard_error.contact / 5
    assert many.tally.contact == pytest.approx(few.tally.contact, abs=5 * few.standard_error.contact)


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"probe": "tsis-2011"}, "probe must be a Probe"),
        ({"pressed": 3.0}, "pressed must be a PressField, a PressMap or None"),
        ({"rays": 10}, "rays must lie in"),
        ({"rays": np.nan}, "rays must be a whole number"),
        ({"seed": -1}, "seed must lie in"),
        ({"bins": 10_000}, "bins must lie in"),
        ({"rays": 2000.7}, "rays must be a whole number"),
        ({"bins": 4.9}, "bins must be a whole number"),
        ({"seed": 1.9}, "seed must be a whole number"),
        ({"threads": 1.5}, "threads must be a whole number"),
        ({"saturation_kpa": 0.0}, "saturation_kpa must lie in"),
        ({"index_outside": 0.5}, "index_outside must lie in"),
        ({"index_outside": 1 + 1j}, "index_outside must be real"),
        ({"absorption_per_mm": -1.0}, "absorption_per_mm must lie in"),
        ({"numerical_aperture": 2.0}, "numerical_aperture must lie in"),
        ({"threads": 0}, "threads must lie in"),
        ({"pressed": evenly_raised_face(12.0, 9.9)}, "must leave 5% of the layers' 10 mm"),
    ],
)
def test_bad_input_is_refused_in_one_sentence(given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        trace_rays(**({"probe": PROBE} | given))
    assert phrase in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"probe": None}, "probe must be a Probe"),
        ({"pressed": 3.0}, "pressed must be a PressField, a PressMap or None"),
        ({"rays": 0}, "rays must lie in"),
        ({"rays": 2.7}, "rays must be a whole number"),
        ({"seed": 1.9}, "seed must be a whole number"),
        ({"lamp": 0.5}, "lamp must be a whole number"),
        ({"lamp": 4}, "lamp must lie in [0, 3]"),
    ],
)
def test_paths_that_cannot_be_followed_are_refused(given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError) as refused:
        trace_paths(**({"probe": PROBE} | given))
    assert phrase in str(refused.value)


def test_a_lamp_given_as_a_whole_float_is_that_lamp() -> None:
    (one,), (other,) = (trace_paths(PROBE, rays=1, lamp=lamp) for lamp in (2, 2.0))  # type: ignore[arg-type]
    np.testing.assert_array_equal(one, other)


def test_a_face_pressed_outwards_is_traced_too() -> None:
    radius = np.linspace(0.0, 12.0, 25)
    bulging = PressField(
        radius_mm=radius,
        face_displacement_mm=-0.5 * np.cos(np.pi * radius / 24),
        pressure_kpa=np.zeros(25),
        approach_mm=0.0,
        force_n=0.0,
    )
    assert sum(astuple(trace_rays(PROBE, bulging, rays=5000).tally)) == pytest.approx(1.0, abs=1e-12)
