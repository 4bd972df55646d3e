"""Codes and their order depend on the seed alone, and tell nothing of the truth."""

from __future__ import annotations

import numpy as np
import pytest

from tsis.errors import InputError
from tsis.study.folder import printed_targets, random_targets
from tsis.study.plan import DeviceReading, coded, first_readings

TARGETS = [True] * 8 + [False] * 8


def test_order_and_codes_depend_on_the_seed_alone() -> None:
    places = list(range(16))
    once, again, other = coded(places, 4), coded([-place for place in places], 4), coded(places, 5)
    assert list(once) == list(again)
    assert [-place for place in once.values()] == list(again.values())
    assert list(once) != list(other)
    assert list(once.values()) != list(other.values())
    assert sorted(once.values()) == places


def test_codes_differ_even_of_many() -> None:
    assert len(coded(range(20_000), 1)) == 20_000


def test_neither_place_nor_code_tells_of_the_truth() -> None:
    """Over many seeds the ranks of inclusions scatter about the middle as chance has them, by place and by code."""
    seeds = 1500
    sums = np.zeros((seeds, 2))
    for seed in range(seeds):
        given = coded(TARGETS, seed)
        truth = np.array(list(given.values()))
        by_code = np.argsort(np.argsort(list(given)))
        sums[seed] = np.arange(16)[truth].sum(), by_code[truth].sum()
    expected, variance = 8 * 7.5, 8 * 8 * 17 / 12  # of Wilcoxon's rank sum
    assert np.abs(sums.mean(axis=0) - expected).max() < 4 * np.sqrt(variance / seeds)
    assert np.abs(sums.var(axis=0) / variance - 1).max() < 4 * np.sqrt(2 / seeds)


def test_every_target_comes_to_every_place() -> None:
    firsts = [next(iter(coded(range(16), seed).values())) for seed in range(800)]
    counts = np.bincount(firsts, minlength=16)
    assert float(((counts - 50) ** 2 / 50).sum()) < 37.7  # chi-square of 15 degrees of freedom, 0.1 %


@pytest.mark.parametrize("seed", [-1, 1.5, "1", True])
def test_a_seed_that_is_none(seed: object) -> None:
    with pytest.raises(InputError, match="seed must"):
        coded([1], seed)  # type: ignore[arg-type]


def test_drawn_targets_lie_in_their_ranges_and_tissue_is_alike_in_both_kinds() -> None:
    targets = random_targets(400, 400, rng=np.random.default_rng(2))
    inside = np.array([list(one.values.values()) for one in targets if one.has_inclusion])
    assert (inside.min(axis=0) >= (2, 4, 40)).all()
    assert (inside.max(axis=0) <= (15, 12, 120)).all()
    tissue = [[one.phantom.young_kpa for one in targets if one.has_inclusion is kind] for kind in (True, False)]
    assert abs(np.log(tissue[0]).mean() - np.log(tissue[1]).mean()) < 4 * 0.1 * np.sqrt(2 / 400)
    assert np.std(np.log(tissue[1])) == pytest.approx(0.1, rel=0.15)


def test_printed_targets_are_those_of_the_catalog_and_none_is_no_study() -> None:
    assert sum(one.has_inclusion for one in printed_targets(10, 3)) == 10
    with pytest.raises(InputError, match="blank must"):
        printed_targets(0, 0)


def test_the_first_reading_is_the_lowest_repeat_of_each_operator_and_device() -> None:
    rows = [("T-2222", "a", "Ada", 3), ("T-2222", "a", "Ben", 2), ("T-2222", "a", "Ada", 2), ("T-2222", "b", "Ada", 5)]
    readings = [
        DeviceReading(code=code, device=device, operator=operator, repeat=repeat, score=0.5)
        for code, device, operator, repeat in rows
    ]
    assert [reading.key for reading in first_readings(readings)] == [rows[2], rows[1], rows[3]]
    assert first_readings([]) == ()
