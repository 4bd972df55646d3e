"""Matching by shape contexts: known deformations, turns, outliers, and what must hold of any method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.matching import shape_context

if TYPE_CHECKING:
    from tests.matching.conftest import Warped

RNG = np.random.default_rng(0)


def test_finds_a_smooth_deformation(warped: Warped) -> None:
    found = shape_context.fit(warped.source, warped.target, rng=RNG)
    assert warped.right(found.matches) > 0.95
    assert warped.rms(found.move(warped.source)) < 0.05
    assert 0 < np.median(found.trust) <= found.trust.max() <= 1


def test_new_points_go_where_their_neighbours_go(warped: Warped) -> None:
    found = shape_context.fit(warped.source, warped.target, rng=RNG)
    between = (warped.source[:-1] + warped.source[1:]) / 2
    between = between[np.linalg.norm(between, axis=1) < 0.8]
    np.testing.assert_allclose(found.move(between), warped.goes(between), atol=0.1)


def test_permuting_the_target_permutes_the_matches(warped: Warped) -> None:
    order = np.random.default_rng(1).permutation(len(warped.target))
    one = shape_context.fit(warped.source, warped.target, rng=RNG)
    other = shape_context.fit(warped.source, warped.target[order], rng=RNG)
    np.testing.assert_array_equal(np.where(other.matches < 0, -1, order[other.matches]), one.matches)
    np.testing.assert_allclose(other.move(warped.source), one.move(warped.source), atol=1e-7)


@pytest.mark.parametrize("angle", [0.7, 2.5])
def test_directions_from_the_mass_centre_find_any_turn(angle: float) -> None:
    source = np.random.default_rng(3).normal(size=(60, 2)) @ np.diag([1.3, 0.6])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    found = shape_context.fit(source, source @ turn, rng=RNG, rotated=True)
    assert np.mean(found.matches == np.arange(60)) > 0.95
    np.testing.assert_allclose(found.move(source), source @ turn, atol=0.05)


@pytest.mark.parametrize("more", ["source", "target"])
def test_points_without_a_partner_are_left_alone(warped: Warped, more: str) -> None:
    few = np.flatnonzero(np.arange(len(warped.source)) % 6)
    source, target = (warped.source, warped.truth[few]) if more == "source" else (warped.source[few], warped.truth)
    found = shape_context.fit(source, target, rng=RNG)
    matched = found.matches[found.matches >= 0]
    assert len(set(matched)) == len(matched) <= min(len(source), len(target))
    assert np.all(found.trust[found.matches < 0] == 0)
    known = source if more == "target" else source[few]
    assert np.sqrt(np.mean(np.sum((found.move(known) - warped.goes(known)) ** 2, axis=1))) < 0.15
