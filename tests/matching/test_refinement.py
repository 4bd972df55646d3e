"""Refinement of a map: predictions against normal distributions written out, and moves to the right pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial import cKDTree

from tsis.matching import posterior
from tsis.matching.methods import UNMATCHED, NormalFrame, spacing
from tsis.matching.outline import RANK_SIGMA, Ranking, chains
from tsis.matching.pose_evidence import AMPLITUDES, SIGMAS, SmoothField, gaussian_kernel, hard_evidence
from tsis.matching.pose_search import PoseSearch, _followed, settled
from tsis.matching.refinement import (
    MANY_PAIRS,
    chained,
    grown,
    halved,
    one_to_one,
    predicted,
    reattached,
    repatched,
    segment_shifts,
    shifted,
)

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


def _curve(count: int = 80) -> tuple[np.ndarray, np.ndarray]:
    """A closed outline with a smooth deformation of it."""
    angle = 2 * np.pi * np.arange(count) / count
    radius = 1 + 0.25 * np.cos(2 * angle) + 0.15 * np.sin(3 * angle) + 0.1 * np.cos(5 * angle)
    source = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    source = NormalFrame.of(source).inward(source)
    return source, source + 0.05 * np.sin(2 * source[:, ::-1])


@pytest.mark.parametrize("amplitude", [0.05, 0.2])
@pytest.mark.parametrize("noise", [0.004, 0.03])
def test_the_amplitude_and_noise_that_made_the_values_are_found(amplitude: float, noise: float) -> None:
    rng = np.random.default_rng(2)
    points = rng.normal(size=(150, 2))
    covariance = amplitude**2 * gaussian_kernel(points, points, 0.5) + 1e-10 * np.eye(150)
    field = np.linalg.cholesky(covariance) @ rng.normal(size=(150, 2))
    found = hard_evidence(SmoothField.of(points), points + field + noise * rng.normal(size=(150, 2)), np.arange(150))
    assert found is not None
    assert found.amplitude in AMPLITUDES or amplitude / 2.1 < found.amplitude < amplitude * 2.1
    assert noise / 2.1 < found.sigma < noise * 2.1


def test_an_affine_part_changes_no_hyperparameter() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(40, 2))
    values = points + 0.1 * np.sin(2 * points) + 0.01 * rng.normal(size=points.shape)
    matrix = np.array([[1.1, 0.2], [-0.2, 1.1]])
    one, other = (
        hard_evidence(SmoothField.of(points), each, np.arange(40)) for each in (values, values @ matrix + 5.0)
    )
    assert one is not None
    assert other is not None
    size = np.sqrt(np.linalg.det(matrix))
    assert other.width == one.width
    assert other.sigma == pytest.approx(size * one.sigma, rel=0.1)


def test_predictions_equal_those_of_the_whole_covariance() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(30, 2))
    target = points + 0.1 * np.sin(2 * points[:, ::-1])
    matches = np.where(np.arange(30) % 3 == 0, UNMATCHED, np.arange(30))
    found = hard_evidence(SmoothField.of(points), target, matches)
    assert found is not None
    spread = predicted(SmoothField.of(points), found)
    rows = np.flatnonzero(matches != UNMATCHED)
    wide = np.column_stack([np.ones(30), points])
    kernel = found.amplitude**2 * gaussian_kernel(points, points, found.width) + 100.0 * wide @ wide.T
    gain = kernel[:, rows] @ np.linalg.inv(kernel[np.ix_(rows, rows)] + found.sigma**2 * np.eye(len(rows)))
    np.testing.assert_allclose(found.moved, gain @ target[rows], atol=1e-3)
    np.testing.assert_allclose(spread**2, np.diag(kernel - gain @ kernel[rows]), atol=3e-5)


def test_growth_pairs_what_the_deformation_moved_far(warped: Warped) -> None:
    step, field = spacing(warped.source), SmoothField.of(warped.source)
    inner = np.linalg.norm(warped.source, axis=1) < 0.9
    some = hard_evidence(field, warped.target, np.where(inner, np.argsort(warped.order), UNMATCHED))
    assert some is not None
    found = grown(field, warped.target, step, some)
    assert found.log > some.log
    assert warped.right(found.matches) > 0.95


def test_a_patch_of_wrong_pairs_is_paired_again(warped: Warped) -> None:
    step, field = spacing(warped.source), SmoothField.of(warped.source)
    pairs = np.argsort(warped.order)
    patch = np.argsort(np.linalg.norm(warped.source - warped.source[0], axis=1))[:6]
    wrong = pairs.copy()
    wrong[patch] = pairs[np.roll(patch, 1)]
    before = hard_evidence(field, warped.target, wrong)
    assert before is not None
    assert warped.right(repatched(field, warped.target, step, before).matches) == 1


def test_chains_are_the_curves() -> None:
    following = np.array([1, 2, 0, 4, UNMATCHED, 3])
    found = [(order.tolist(), closed) for order, closed in chains(following)]
    assert found == [([5, 3, 4], False), ([0, 1, 2], True)]


def test_order_along_a_curve_mends_a_gap_in_the_wrong_place() -> None:
    source, target = _curve()
    seen = np.arange(80) != 40  # one point has no partner
    search = PoseSearch.of(source, target[seen])
    truth = np.where(seen, np.cumsum(seen) - 1, UNMATCHED)
    wrong = truth.copy()
    wrong[40:60], wrong[60] = truth[41:61], UNMATCHED
    before = hard_evidence(search.field, search.target, wrong)
    assert before is not None
    found = chained(search.field, search.target, search.step, search.curves, before)
    np.testing.assert_array_equal(found.matches, truth)


def _ranked_loss(ranking: Ranking, matches: np.ndarray) -> float:
    """Squared residuals of the pairs and bending, by least squares with a row for each penalty."""
    paired = matches != UNMATCHED
    weights = np.full(ranking.design.shape[1], RANK_SIGMA)
    weights[:3] = np.sqrt(1e-9)
    goal = np.vstack([ranking.target[matches[paired]], np.zeros((len(weights), 2))])
    rows = np.vstack([ranking.design[paired], np.diag(weights)])
    return float(((goal - rows @ np.linalg.lstsq(rows, goal)[0]) ** 2).sum())


def test_the_loss_at_each_place_of_a_curve_is_that_of_its_pairs() -> None:
    source, target = _curve()
    ranking = Ranking.of(SmoothField.of(source), target)
    rng = np.random.default_rng(6)
    order = rng.permutation(80)[:60]
    places = (rng.permutation(60)[:20] + np.arange(7)[:, None]) % 60
    inside = rng.uniform(size=places.shape) < 0.9
    loss = ranking.placed_loss(order, places, inside, target[30:50])
    for number in range(len(places)):
        matches = np.full(80, UNMATCHED)
        matches[order[places[number, inside[number]]]] = np.arange(30, 50)[inside[number]]
        assert loss[number] == pytest.approx(_ranked_loss(ranking, matches), rel=1e-5)


@pytest.mark.parametrize("segment", [slice(20, 40), slice(5, 42)])
def test_a_slid_segment_slides_back(segment: slice) -> None:
    source, target = _curve()
    truth = np.arange(80)
    truth[[segment.start - 1, segment.stop]] = UNMATCHED
    wrong = truth.copy()
    wrong[segment.start : segment.stop] = np.arange(segment.start, segment.stop) + 1
    wrong[segment.stop - 1] = UNMATCHED
    ranking = Ranking.of(SmoothField.of(source), target)
    search = PoseSearch.of(source, target)
    before = hard_evidence(search.field, target, wrong)
    assert before is not None
    ((order, closed),) = chains(search.following)
    assert closed
    proposals = list(segment_shifts(order, closed, search.ahead, ranking, before))
    losses = [_ranked_loss(ranking, matches) for matches in proposals]
    assert losses == pytest.approx(sorted(losses), rel=1e-6), "the likeliest first"
    best = max((hard_evidence(search.field, target, each) for each in proposals), key=lambda item: item.log)  # type: ignore[union-attr]
    assert best is not None
    assert best.log > before.log
    paired = best.matches != UNMATCHED
    assert np.mean(best.matches[paired] == np.arange(80)[paired]) > 0.95


@pytest.mark.parametrize("way", [1, -1])
def test_a_segment_that_slid_over_a_skipped_target_slides_back(way: int) -> None:
    """Only at one of its ends is a point without partner; at the other its partners leave a target out."""
    source, target = _curve()
    wrong = np.arange(80)
    wrong[31:50] += way
    wrong[50 if way > 0 else 30] = UNMATCHED
    search = PoseSearch.of(source, target)
    before = hard_evidence(search.field, target, wrong)
    assert before is not None
    ranking = Ranking.of(search.field, target)
    ((order, closed),) = chains(search.following)
    proposals = segment_shifts(order, closed, search.ahead, ranking, before)
    best = min(proposals, key=lambda matches: _ranked_loss(ranking, matches))
    paired = best != UNMATCHED
    assert np.count_nonzero(paired) >= 78
    np.testing.assert_array_equal(best[paired], np.arange(80)[paired])


@pytest.mark.parametrize("shift", [3, 17, 41])
def test_a_curve_that_slid_by_any_number_of_points_slides_back(shift: int) -> None:
    source, target = _curve()
    search = PoseSearch.of(source, target)
    before = hard_evidence(search.field, target, np.roll(np.arange(80), shift))
    assert before is not None
    proposals = list(shifted(chains(search.following)[0], Ranking.of(search.field, target), before))
    assert any(np.array_equal(each, np.arange(80)) for each in proposals)


def test_a_curve_in_its_place_is_not_proposed_first() -> None:
    source, target = _curve()
    search = PoseSearch.of(source, target)
    truth = hard_evidence(search.field, target, np.arange(80))
    assert truth is not None
    first = next(iter(shifted(chains(search.following)[0], Ranking.of(search.field, target), truth)))
    assert not np.array_equal(first, np.arange(80))


@pytest.mark.parametrize(("shift", "extra"), [(5, 0), (-4, 2), (2, -1)])
def test_runs_of_an_open_curve_slide_back_each_by_its_own_number(shift: int, extra: int) -> None:
    """Pairs of the first 20 points slid by ``shift``, those of the last 20 by ``extra`` more; between them all hide."""
    angle = np.linspace(0.3, 5.0, 80)
    source = angle[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]) / 3
    search = PoseSearch.of(source, source)
    (order, closed), *_ = search.curves
    assert not closed
    place = np.argsort(order)
    seen = (place >= 10) & (place < 30) | (place >= 50) & (place < 70)
    slid = place + shift + np.where(place >= 50, extra, 0)
    before = np.full(80, UNMATCHED)
    before[order[slid[seen]]] = np.flatnonzero(seen)
    pose = hard_evidence(search.field, source, before)
    assert pose is not None
    proposals = list(shifted((order, closed), Ranking.of(search.field, source), pose))
    truth = np.where(seen, np.arange(80), UNMATCHED)
    assert any(np.array_equal(each, truth) for each in proposals)


@pytest.mark.parametrize("dimension", [2, 3])
def test_pairs_on_one_side_are_left_from_each_side(dimension: int) -> None:
    points = np.random.default_rng(5).normal(size=(50, dimension))
    matches = np.where(np.arange(50) % 7 == 0, UNMATCHED, np.arange(50)[::-1])
    sides = list(halved(points, matches))
    assert len(sides) == 3**dimension - 1
    for side in sides:
        kept = side != UNMATCHED
        np.testing.assert_array_equal(side[kept], matches[kept])
        left = points - points.mean(axis=0)
        kept_mean, other = left[kept].mean(axis=0), left[(matches != UNMATCHED) & ~kept]
        assert (other @ kept_mean).mean() < 0
    paired = np.sum([side != UNMATCHED for side in sides], axis=0)
    np.testing.assert_array_equal(paired, np.where(matches == UNMATCHED, 0, len(sides) // 2))


def test_partners_one_to_one_mend_what_soft_pairs_leave(warped: Warped) -> None:
    search = PoseSearch.of(warped.source, warped.target)
    start = 0.7 * warped.truth + 0.3 * warped.source
    soft = settled(search, start)
    assert soft is not None
    found = _followed(search, soft)
    assert warped.rms(found.moved) < 0.01 < warped.rms(start)


def test_false_partners_hardly_draw(warped: Warped) -> None:
    step = spacing(warped.source)
    seen = np.arange(len(warped.truth)) % 4 != 0
    stray = np.random.default_rng(0).uniform(-1.5, 1.5, (sum(seen) // 4, warped.truth.shape[1]))
    found = posterior.fit(warped.source, np.vstack([warped.truth[seen], stray]), rng=np.random.default_rng(0))
    wrong = np.sqrt(np.sum((found.move(warped.source) - warped.truth) ** 2, axis=1))
    assert np.median(wrong[seen]) < 0.1 * step
    assert np.median(wrong[~seen]) < 0.2 * step


def test_without_partners_nothing_is_matched(warped: Warped) -> None:
    search = PoseSearch.of(warped.source, warped.target)
    assert settled(search, warped.source + 50.0) is None
    assert posterior._interpolated(warped.source, warped.source, warped.target + 50.0, search.step) is None


def test_unambiguous_partners_are_reached_and_noise_is_passed_by(warped: Warped) -> None:
    step = spacing(warped.source)
    smooth = warped.truth + 0.02 * np.sin(3 * warped.source)
    reached = posterior._interpolated(warped.source, smooth, warped.target, step)
    assert reached is not None
    assert warped.rms(reached(warped.source)) < 1e-4 < warped.rms(smooth)
    noisy = warped.target + 0.3 * step * np.random.default_rng(1).normal(size=warped.target.shape)
    assert posterior._interpolated(warped.source, smooth, noisy, step) is None


def test_the_least_standard_deviation_bounds_the_noise(warped: Warped) -> None:
    found = hard_evidence(SmoothField.of(warped.source), warped.target, np.argsort(warped.order))
    assert found is not None
    assert found.sigma >= 0.9 * SIGMAS[0]


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("rows", "columns"), [(250, 400), (400, 250)])
@pytest.mark.parametrize("gate", [0.1, 0.3, 9.0])
def test_pairs_of_many_points_are_the_mutual_nearest_of_two_trees(
    dimension: int, rows: int, columns: int, gate: float
) -> None:
    assert rows * columns > MANY_PAIRS
    rng = np.random.default_rng([3, dimension, rows])
    moved, target = rng.normal(size=(rows, dimension)), rng.normal(size=(columns, dimension))
    away, nearest = (np.asarray(found) for found in cKDTree(target).query(moved))
    back = np.asarray(cKDTree(moved).query(target)[1])
    expected = np.where((back[nearest] == np.arange(rows)) & (away < gate), nearest, UNMATCHED)
    assert np.any(expected != UNMATCHED)
    np.testing.assert_array_equal(one_to_one(moved, target, gate), expected)


def test_many_points_out_of_reach_have_no_pair() -> None:
    points = np.random.default_rng(4).normal(size=(260, 2))
    assert np.all(one_to_one(points, points + 50.0, 1.0) == UNMATCHED)
    np.testing.assert_array_equal(one_to_one(points, points[::-1], 1e-6), np.arange(260)[::-1])


@pytest.mark.parametrize("clutter", [0, 30])
def test_a_part_that_moved_away_is_found_with_clutter_and_without(clutter: int) -> None:
    rng = np.random.default_rng(5)
    source = np.vstack([rng.normal([-0.8, 0], 0.3, (30, 2)), rng.normal([0.9, 0], 0.2, (15, 2))])
    moved = source + np.where(np.arange(45)[:, None] < 30, 0.0, [0.3, 0.8])
    target = np.vstack([moved, rng.uniform(-2, 2, (clutter, 2))])
    matches = np.where(np.arange(45) < 30, np.arange(45), UNMATCHED)
    pose = hard_evidence(SmoothField.of(source), target, matches)
    assert pose is not None
    proposed = list(reattached(SmoothField.of(source), target, 0.1, pose))
    assert all(np.array_equal(each[:30], matches[:30]) for each in proposed)
    assert max(np.count_nonzero(each[30:] == np.arange(30, 45)) for each in proposed) >= 10


def test_without_free_targets_nothing_moves_away() -> None:
    source, target = _curve()
    pose = hard_evidence(SmoothField.of(source), target, np.where(np.arange(80) < 60, np.arange(80), UNMATCHED))
    assert pose is not None
    assert not list(reattached(SmoothField.of(source), target[:60], 0.1, pose))
