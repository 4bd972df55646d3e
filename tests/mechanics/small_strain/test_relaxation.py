"""Relaxing tissue: against its own course under a rigid probe, elastic limits, and steps in time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import tsis
from tsis.errors import InputError, MechanicsError
from tsis.mechanics import press
from tsis.mechanics.small_strain.linear_press import compliances
from tsis.mechanics.small_strain.relaxation import relaxing_press, settling_time_s
from tsis.mechanics.small_strain.slab import Resolution
from tsis.model.phantom import Inclusion, Phantom, Relaxation
from tsis.model.probe import Layer, Probe

PROBE = tsis.load_probe("tsis-2011")
RIGID = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=2.0, young_kpa=1e6),))
PLAIN = Phantom(young_kpa=5.0, thickness_mm=30.0)
LUMP = replace(PLAIN, inclusion=Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0))
SOLID = Relaxation(shares=(0.4,), times_s=(2.0,))
PRONY = Relaxation(shares=(0.2, 0.15, 0.25), times_s=(0.1, 3.0, 40.0))
COARSE = Resolution(order=3, edge=0.05, growth=2.2, largest=0.3)
TIMES = np.array([0.0, 0.01, 0.1, 0.7, 3.0, 20.0, 200.0])


@given(
    shares=st.lists(st.floats(0.01, 0.3), min_size=1, max_size=3),
    first=st.floats(1e-3, 1e3),
    time=st.floats(0.0, 1e4),
)
def test_the_modulus_falls_from_the_instantaneous_to_the_settled_one(
    shares: list[float], first: float, time: float
) -> None:
    tissue = Relaxation(shares=tuple(shares), times_s=tuple(first * 10.0**index for index in range(len(shares))))
    assert tissue.modulus_ratio(0.0) == pytest.approx(tissue.instantaneous_ratio)
    assert tissue.modulus_ratio(1e9) == pytest.approx(1.0)
    assert tissue.modulus_ratio(time) >= tissue.modulus_ratio(2 * time) >= 1 - 1e-12


@pytest.mark.parametrize("tissue", [SOLID, PRONY])
@pytest.mark.parametrize("phantom", [PLAIN, LUMP])
def test_under_a_rigid_probe_the_force_follows_the_tissues_modulus(tissue: Relaxation, phantom: Phantom) -> None:
    course = relaxing_press(RIGID, phantom, tissue, approach_mm=2.0, time_s=TIMES, resolution=COARSE)
    last = relaxing_press(RIGID, phantom, tissue, approach_mm=2.0, time_s=[1e7], resolution=COARSE).force_n[0]
    np.testing.assert_allclose(course.force_n / last, tissue.modulus_ratio(TIMES), rtol=1e-4)


@pytest.mark.parametrize("phantom", [PLAIN, LUMP])
def test_first_and_last_it_is_an_elastic_press(phantom: Phantom) -> None:
    course = relaxing_press(PROBE, phantom, PRONY, approach_mm=3.0, time_s=[0.0, 1e7])
    ratio = PRONY.instantaneous_ratio
    inclusion = phantom.inclusion
    stiff = replace(
        phantom,
        young_kpa=5.0 * ratio,
        inclusion=None if inclusion is None else replace(inclusion, young_kpa=100.0 * ratio),
    )
    for index, tissue in ((0, stiff), (1, phantom)):
        elastic = press(PROBE, tissue, force_n=float(course.force_n[index]))
        assert elastic.approach_mm == pytest.approx(3.0, rel=1e-6)
        np.testing.assert_allclose(course.pressure_kpa[index, :230], elastic.pressure_kpa[:230], rtol=1e-5)
        np.testing.assert_allclose(course.face_displacement_mm[index], elastic.face_displacement_mm, rtol=1e-5)


@pytest.mark.parametrize("ramp_s", [0.0, 1.5])
def test_small_steps_in_time_find_the_same_course(ramp_s: float) -> None:
    """Memories integrated with the midpoint rule: another discretisation of the same material."""
    kernel, tissue = compliances(PROBE, LUMP, COARSE)
    ratio, lost = PRONY.instantaneous_ratio, PRONY.instantaneous_ratio * np.array(PRONY.shares)
    end, count = 6.0, 6000
    step, rates = end / count, 1 / np.array(PRONY.times_s)
    weight = step * rates / (1 + step * rates / 2)
    stiff, nodes = np.linalg.inv(tissue), len(tissue)

    def travel(time: float) -> float:
        return 3.0 * min(time / ramp_s, 1.0) if ramp_s else 3.0

    gives = np.linalg.inv(np.eye(nodes) + ratio * kernel.probe_compliance @ stiff)
    memory = np.zeros((3, nodes))
    stretch = gives @ np.full(nodes, travel(0.0))
    for index in range(count):
        now = travel((index + 1) * step)
        # Memory at the end of the step: old + weight * ((u_old + u_new) / 2 - old); solved for u_new.
        known = memory + weight[:, None] * (stretch / 2 - memory)
        effective = ratio - lost @ weight / 2
        matrix = np.eye(nodes) + effective * kernel.probe_compliance @ stiff
        fresh = np.linalg.solve(matrix, now + kernel.probe_compliance @ stiff @ (lost @ known))
        memory = known + weight[:, None] * fresh / 2
        stretch = fresh
    force = stiff @ (ratio * stretch - lost @ memory)
    course = relaxing_press(PROBE, LUMP, PRONY, approach_mm=3.0, time_s=[end], ramp_s=ramp_s, resolution=COARSE)
    assert course.force_n[0] == pytest.approx(force.sum() / 1000, rel=1e-5)


def test_a_fast_travel_is_nearly_a_sudden_one() -> None:
    times = np.array([1.0, 5.0, 50.0])
    sudden, fast, slow = (
        relaxing_press(PROBE, PLAIN, SOLID, approach_mm=3.0, time_s=times, ramp_s=ramp, resolution=COARSE).force_n
        for ramp in (0.0, 1e-3, 0.9)
    )
    np.testing.assert_allclose(fast, sudden, rtol=1e-3)
    assert (slow >= sudden).all(), "what came later has faded less"
    assert slow[-1] == pytest.approx(sudden[-1], rel=1e-6)


def test_the_image_settles_with_the_force() -> None:
    course = relaxing_press(PROBE, LUMP, SOLID, approach_mm=3.0, time_s=[0.0, 1.0, 4.0, 100.0])
    centre = course.pressure_kpa[:, 0]
    assert (np.diff(course.force_n) < 0).all()
    assert (np.diff(centre) < 0).all()
    total = 2 * np.pi * np.trapezoid(course.pressure_kpa * course.radius_mm, course.radius_mm, axis=1)
    np.testing.assert_allclose(total, 1000 * course.force_n, rtol=3e-3)


@pytest.mark.parametrize("tolerance", [0.1, 0.01, 0.001])
def test_settling_time(tolerance: float) -> None:
    found = settling_time_s(PROBE, PLAIN, SOLID, approach_mm=2.0, tolerance=tolerance, resolution=COARSE)
    course = relaxing_press(PROBE, PLAIN, SOLID, approach_mm=2.0, time_s=[found, 1e7], resolution=COARSE)
    assert course.force_n[0] / course.force_n[1] == pytest.approx(1 + tolerance, rel=1e-8)
    assert settling_time_s(RIGID, PLAIN, SOLID, approach_mm=2.0, tolerance=tolerance) == pytest.approx(
        2.0 * np.log(0.4 / 0.6 / tolerance), rel=1e-3
    )


def test_what_settles_while_the_glass_travels_needs_no_waiting() -> None:
    assert settling_time_s(PROBE, PLAIN, SOLID, approach_mm=2.0, tolerance=0.9, resolution=COARSE) == 0.0


def test_a_dome_must_be_pressed_until_it_touches_everywhere() -> None:
    domed = tsis.load_probe("tsis-domed")
    whole = relaxing_press(domed, PLAIN, SOLID, approach_mm=4.5, time_s=[0.0, 1e7])
    elastic = press(domed, PLAIN, force_n=float(whole.force_n[1]))
    assert elastic.approach_mm == pytest.approx(4.5, rel=2e-3)
    with pytest.raises(MechanicsError, match=r"approach_mm must close the contact over the whole face.* got 1:"):
        relaxing_press(domed, PLAIN, SOLID, approach_mm=1.0, time_s=[0.0])


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"approach_mm": -1.0}, "approach_mm must lie in"),
        ({"time_s": [-1.0]}, "time_s must lie in"),
        ({"time_s": [np.nan]}, "time_s must be finite"),
        ({"ramp_s": np.inf}, "ramp_s must lie in"),
    ],
)
def test_what_a_course_refuses(given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        relaxing_press(PROBE, PLAIN, SOLID, **{"approach_mm": 2.0, "time_s": [1.0], **given})


@pytest.mark.parametrize(
    ("given", "phrase"),
    [
        ({"shares": (0.3, 0.2)}, "one value a term; got 2 and 1"),
        ({"shares": (1.2,)}, "shares must lie in"),
        ({"times_s": (0.0,)}, "times_s must lie in"),
        ({"shares": (0.6, 0.5), "times_s": (1.0, 2.0)}, "add up to at most 0.99"),
        ({"shares": (0.1, 0.1), "times_s": (1.0, 1.0)}, "times_s must all differ"),
    ],
)
def test_what_a_relaxation_refuses(given: dict[str, Any], phrase: str) -> None:
    with pytest.raises(InputError, match=phrase):
        Relaxation(**{"shares": (0.3,), "times_s": (2.0,), **given})
