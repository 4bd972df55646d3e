"""Coherent point drift: against the textbook, against pycpd, and on deformations that are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.matching import drift

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


def _textbook(source: np.ndarray, target: np.ndarray, rounds: int) -> tuple[np.ndarray, float]:
    """Figure 4 of Myronenko and Song (2010), every matrix in full."""
    (n, d), m, w = source.shape, len(target), drift.OUTLIERS
    kernel = np.exp(-np.sum((source[:, None] - source) ** 2, axis=2) / (2 * drift.WIDTH**2))
    moved = source
    variance = np.sum((source[:, None] - target) ** 2) / (d * n * m)
    for _ in range(rounds):
        near = np.exp(-np.sum((moved[:, None] - target) ** 2, axis=2) / (2 * variance))
        chance = near / (near.sum(axis=0) + (2 * np.pi * variance) ** (d / 2) * w / (1 - w) * n / m)
        own = np.diag(chance.sum(axis=1))
        weights = np.linalg.solve(own @ kernel + drift.STIFFNESS * variance * np.eye(n), chance @ target - own @ source)
        moved = source + kernel @ weights
        variance = np.sum(chance * np.sum((moved[:, None] - target) ** 2, axis=2)) / (chance.sum() * d)
    return moved, float(variance)


def test_low_rank_sums_equal_the_textbook(warped: Warped) -> None:
    target = np.vstack([warped.target[:60], [np.full(warped.source.shape[1], 1.5)]])
    move, variance = drift.fit_displacement(warped.source, target, rounds=8, settled=0.0)
    moved, expected = _textbook(warped.source, target, 8)
    np.testing.assert_allclose(move(warped.source), moved, atol=1e-8)
    assert variance == pytest.approx(expected, rel=1e-7)


def test_equals_pycpd(warped: Warped) -> None:
    peer = pytest.importorskip("pycpd", reason="pycpd, the peer that this is compared with, is not installed")
    move, _ = drift.fit_displacement(warped.source, warped.target, rounds=12, settled=0.0)
    there, _ = peer.DeformableRegistration(
        X=warped.target, Y=warped.source, alpha=2, beta=2, w=drift.OUTLIERS, max_iterations=12, tolerance=0.0
    ).register()
    np.testing.assert_allclose(move(warped.source), there, atol=1e-6)


def test_chances_survive_a_variance_so_small_that_each_would_underflow() -> None:
    moved, target = np.array([[0.0, 0.0], [0.3, 0.0]]), np.array([[0.1, 0.0]])
    source, explained, drawn = drift.expect(moved, target, 1e-9, 0.0)
    assert source.tolist() == [1, 0]
    assert explained.tolist() == [1]
    np.testing.assert_allclose(drawn[0], target[0])


def test_outliers_of_the_target_are_left_alone(warped: Warped) -> None:
    dimension = warped.source.shape[1]
    far = 2.5 * np.vstack([np.eye(dimension), -np.eye(dimension)])
    found = drift.fit(warped.source, np.vstack([warped.target, far]), rng=np.random.default_rng(0))
    assert found.matches.max() < len(warped.target)
    assert warped.right(found.matches) > 0.95


def test_places_without_a_target_have_no_match(warped: Warped) -> None:
    kept = warped.truth[warped.source[:, 0] < 0.5]
    found = drift.fit(warped.source, kept, rng=np.random.default_rng(0))
    matched = found.matches[found.matches >= 0]
    assert len(set(matched)) == len(matched) <= len(kept) < len(warped.source)
    assert np.all(found.trust[found.matches < 0] == 0)


@pytest.mark.parametrize("number", [1, 2, 5])
def test_points_in_one_place_are_matched_once(number: int) -> None:
    points = np.zeros((number, 2))
    found = drift.fit(points, points[:1], rng=np.random.default_rng(0))
    assert sorted(found.matches.tolist()) == [-1] * (number - 1) + [0]
    np.testing.assert_allclose(found.move(points), points, atol=1e-9)
