"""Large sets: what a sample says of all points, and pairs that are each other's nearest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.distort import even_texture, fourier_curve, tactile_surface
from scipy.spatial.distance import cdist

from tsis.matching import methods as sampled
from tsis.matching import register
from tsis.matching.methods import UNMATCHED, drawn, mutual_nearest

if TYPE_CHECKING:
    from benchmarks.matching.distort import Shape

STATED = 0.05  # of the extent of the shape: what the transform of a sample may be wrong by at most
FEWEST_RIGHT = 0.5  # of the matches, where the sample of the target holds all of it


def _warped(points: np.ndarray) -> np.ndarray:
    return np.asarray(points + 0.08 * np.sin(3 * points[:, ::-1] + np.arange(points.shape[1])))


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sets of 400 are large; 150 of the source are a sample, and up to 600 of the target."""
    monkeypatch.setattr(sampled, "MOST_PAIRS", 90_000)
    monkeypatch.setattr(sampled, "SAMPLE", 150)


@pytest.mark.parametrize("method", ["tprl", pytest.param("tps-rpm", marks=pytest.mark.slow)])
@pytest.mark.parametrize("shape", [even_texture, pytest.param(fourier_curve, marks=pytest.mark.slow), tactile_surface])
@pytest.mark.usefixtures("few")
def test_the_transform_of_a_sample_moves_all(shape: Shape, method: str) -> None:
    rng = np.random.default_rng(0)
    source = shape(400, rng=rng)
    order = rng.permutation(400)
    found = register(source, _warped(source)[order], method=method)
    assert found.notes == (
        "400 and 400 points are too many for tables of all pairs; 150 and 400 drawn from them were matched",
    )
    assert np.sqrt(np.mean(np.sum((found.moved - _warped(source)) ** 2, axis=1))) < STATED * np.ptp(source)
    made = found.matches != UNMATCHED
    matched = found.matches[made]
    assert len(set(matched)) == len(matched) > 150
    assert np.mean(order[matched] == np.flatnonzero(made)) > FEWEST_RIGHT


@pytest.mark.usefixtures("few")
def test_a_target_too_large_for_the_table_is_drawn_from_as_well() -> None:
    rng = np.random.default_rng(0)
    source = fourier_curve(1200, rng=rng)
    found = register(source, _warped(source)[rng.permutation(1200)], method="tps-rpm")
    assert "150 and 600 drawn from them" in found.notes[0]
    assert np.sqrt(np.mean(np.sum((found.moved - _warped(source)) ** 2, axis=1))) < STATED * np.ptp(source)


@pytest.mark.usefixtures("few")
def test_what_is_not_large_is_not_sampled() -> None:
    source = even_texture(80, rng=np.random.default_rng(0))
    assert register(source, _warped(source), method="tps-rpm").notes == ()
    chance, source = np.random.default_rng(0), np.zeros((1000, 2))
    assert drawn(source, np.zeros((90, 2)), rng=chance)[0] is source
    assert len(drawn(source, np.zeros((91, 2)), rng=chance)[0]) == 150


@pytest.mark.usefixtures("few")
def test_the_same_chance_draws_the_same_sample() -> None:
    points = even_texture(400, rng=np.random.default_rng(0))
    one, other, third = (drawn(points, points, rng=np.random.default_rng(seed))[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, other)
    assert np.any(one != third)


def test_mutual_nearest_equal_those_of_the_whole_table() -> None:
    rng = np.random.default_rng(0)
    moved, target = rng.uniform(size=(60, 2)), rng.uniform(size=(70, 2))
    distance = cdist(moved, target)
    step = np.median(np.sort(cdist(target, target))[:, 1])
    matches, trust = mutual_nearest(moved, target)
    for i, j in enumerate(distance.argmin(axis=1)):
        mutual = distance[:, j].argmin() == i and distance[i, j] <= step / 2
        assert matches[i] == (j if mutual else UNMATCHED)
        assert trust[i] == pytest.approx(1 - distance[i, j] / step if mutual else 0.0)
    assert 0 < np.sum(matches == UNMATCHED) < 60


def test_points_given_twice_count_once_in_the_spacing() -> None:
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    matches, trust = mutual_nearest(grid + 0.1, np.repeat(grid, 2, axis=0))
    np.testing.assert_array_equal(matches // 2, np.arange(25))
    assert trust.min() > 0.5
