"""Robust point matching: known deformations, and what must hold of any method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.matching import annealing as tps_rpm

if TYPE_CHECKING:
    from tests.matching.conftest import Warped

RNG = np.random.default_rng(0)


def test_finds_a_smooth_deformation(warped: Warped) -> None:
    found = tps_rpm.fit(warped.source, warped.target, rng=RNG)
    assert warped.right(found.matches) == 1
    assert warped.rms(found.move(warped.source)) < 0.02


def test_new_points_go_where_their_neighbours_go(warped: Warped) -> None:
    found = tps_rpm.fit(warped.source, warped.target, rng=RNG)
    between = (warped.source[:-1] + warped.source[1:]) / 2
    between = between[np.linalg.norm(between, axis=1) < 0.8]
    np.testing.assert_allclose(found.move(between), warped.goes(between), atol=0.04)


def test_permuting_the_target_permutes_the_matches(warped: Warped) -> None:
    order = np.random.default_rng(1).permutation(len(warped.target))
    one = tps_rpm.fit(warped.source, warped.target, rng=RNG)
    other = tps_rpm.fit(warped.source, warped.target[order], rng=RNG)
    np.testing.assert_array_equal(order[other.matches], one.matches)
    np.testing.assert_allclose(other.move(warped.source), one.move(warped.source), atol=1e-7)


def test_outliers_do_not_draw(warped: Warped) -> None:
    dimension = warped.source.shape[1]
    stray = np.random.default_rng(2).uniform(-1.8, 1.8, (30, dimension))
    found = tps_rpm.fit(warped.source, np.vstack([warped.target, stray]), rng=RNG)
    assert warped.rms(found.move(warped.source)) < 0.05


def test_few_points_are_matched() -> None:
    corners = np.array([[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]])
    found = tps_rpm.fit(corners, corners[[2, 0, 1]], rng=RNG)
    assert found.matches.tolist() == [1, 2, 0]


def test_points_given_twice_are_matched_once_each() -> None:
    source = np.repeat(np.random.default_rng(5).normal(size=(12, 2)), 2, axis=0)
    found = tps_rpm.fit(source, source[::2] + 0.01, rng=RNG)
    matched = found.matches[found.matches >= 0]
    assert sorted(matched.tolist()) == list(range(12))
    np.testing.assert_allclose(found.move(source), source + 0.01, atol=0.05)
