"""The catalog's lamps against those that one would try first, and against what symmetry and energy allow."""

from __future__ import annotations

from dataclasses import replace

import pytest
from studies.lamps import lighting, run

import tsis
from tsis.model.light import FOUR_LEDS


@pytest.mark.parametrize("name", ["tsis-2011", "tsis-domed"])
def test_a_press_changes_the_catalogs_light_less_than_that_of_lamps_that_shine_straight_in(name: str) -> None:
    probe = tsis.load_probe(name)
    own, straight = (lighting(replace(probe, leds=leds), rays=100_000, seed=2) for leds in (probe.leds, FOUR_LEDS))
    assert own.press_error < 0.06
    assert straight.press_error > 2 * own.press_error
    assert 0 < own.darkest < 1


def test_light_that_two_seeds_trace_agrees() -> None:
    first, second = (lighting(tsis.load_probe("tsis-2011"), rays=200_000, seed=seed) for seed in (1, 2))
    assert first.reaching == pytest.approx(second.reaching, rel=0.02)
    assert first.spread == pytest.approx(second.spread, rel=0.05)


def test_places_are_ranked_by_what_a_press_changes() -> None:
    found = run(tsis.load_probe("tsis-2011"), [(5.0, 0.0), (2.5, 50.0), (2.5, 70.0)], rays=100_000, seed=1)
    assert [(one.height_mm, one.aim_deg) for one in found] == [(2.5, 50.0), (2.5, 70.0), (5.0, 0.0)]
    assert [one.press_error for one in found] == sorted(one.press_error for one in found)
