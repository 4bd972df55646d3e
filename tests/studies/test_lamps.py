"""Light of lamps at several places: what symmetry, chance and the order of the table allow."""

from __future__ import annotations

from dataclasses import replace

import pytest
from studies.lamps import lighting, run

import tsis

PROBE = tsis.load_probe("tsis-2011")


def test_light_that_two_seeds_trace_agrees() -> None:
    first, second = (lighting(PROBE, rays=200_000, seed=seed) for seed in (1, 2))
    assert first.reaching == pytest.approx(second.reaching, rel=0.02)
    assert first.spread == pytest.approx(second.spread, rel=0.05)
    assert first.depletion == pytest.approx(second.depletion, rel=0.2)


@pytest.mark.slow
def test_level_light_is_not_missed_elsewhere_and_steep_light_is_even_along_the_face() -> None:
    """A level beam meets the face once, so no contact can darken another place; a steep one comes from all sides."""
    narrow = tuple(replace(led, half_angle_deg=15.0) for led in PROBE.leds)
    found = run(replace(PROBE, leds=narrow), [(5.0, 0.0), (2.5, 50.0)], rays=200_000, seed=1)
    level, steep = sorted(found, key=lambda one: one.aim_deg)
    assert abs(level.depletion) < 0.01 < 0.1 < steep.depletion
    assert steep.flux < 0.3 < 2.0 < level.flux


def test_places_are_ranked_by_what_cannot_be_divided_out() -> None:
    found = run(PROBE, [(5.0, 45.0), (2.5, 0.0), (6.0, -10.0)], rays=100_000, seed=1)
    assert [one.error for one in found] == sorted(one.error for one in found)
    assert found[0].error < 0.5 * found[-1].error
    assert all(one.error == pytest.approx((one.press_error**2 + one.depletion**2) ** 0.5) for one in found)
