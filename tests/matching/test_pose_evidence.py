"""Evidence: larger for the true map than for any other, smaller with noise and outliers, and posterior odds from it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.stats import special_ortho_group, vonmises

from tsis.matching.methods import UNMATCHED, NormalFrame
from tsis.matching.pose_evidence import (
    WIDTHS,
    PoseEvidence,
    SmoothField,
    hard_evidence,
    soft_evidence,
    unrelated_evidence,
)
from tsis.matching.pose_search import PoseSearch, settled
from tsis.matching.posterior import log_rotation_prior, pose_posterior, rotation_deg
from tsis.matching.refinement import one_to_one

if TYPE_CHECKING:
    from tests.matching.conftest import Warped

RANGE = 0.5  # root-mean-square radii: largest distance of a pair


def _turn(dimension: int, degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    turn = np.eye(dimension)
    turn[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    return turn


def _evidence(source: np.ndarray, moved: np.ndarray, target: np.ndarray) -> PoseEvidence:
    """Evidence of the pairs of moved points with their nearest targets."""
    found = hard_evidence(SmoothField.of(source), target, one_to_one(moved, target, RANGE))
    assert found is not None
    return found


@pytest.mark.parametrize("dimension", [2, 3])
def test_factors_times_themselves_are_the_kernels(dimension: int) -> None:
    points = np.random.default_rng(6).normal(size=(25, dimension))
    squares = ((points[:, None] - points) ** 2).sum(axis=2)
    for width, factor in zip(WIDTHS, SmoothField.of(points).factors, strict=True):
        np.testing.assert_allclose(factor @ factor.T, np.exp(-squares / (2 * width**2)), atol=1e-5)


def test_the_true_map_is_likelier_than_others(warped: Warped) -> None:
    true = _evidence(warped.source, warped.truth, warped.target).log
    dimension = warped.source.shape[1]
    for degrees in (90, 180):
        other = _evidence(warped.source, warped.source @ _turn(dimension, degrees), warped.target).log
        assert true > other + len(warped.target)
    assert true > _evidence(warped.source, warped.source + 0.8 * np.eye(dimension)[0], warped.target).log + 50


def test_pairs_of_a_map_near_the_true_one_are_the_same(warped: Warped) -> None:
    true = _evidence(warped.source, warped.truth, warped.target)
    near = warped.truth + np.random.default_rng(0).normal(size=warped.truth.shape) * 0.02
    assert _evidence(warped.source, near, warped.target).log == pytest.approx(true.log)


def test_noise_lowers_it(warped: Warped) -> None:
    noise = np.random.default_rng(3).normal(size=warped.target.shape)
    pairs, field = np.argsort(warped.order), SmoothField.of(warped.source)
    found = [hard_evidence(field, warped.target + size * noise, pairs) for size in (0.0, 0.02, 0.05, 0.1)]
    assert np.all(np.diff([item.log for item in found if item is not None]) < 0)
    assert len(found) == 4


def test_no_gain_from_residuals_below_the_measurement_error(warped: Warped) -> None:
    noise = np.random.default_rng(3).normal(size=warped.target.shape)
    pairs, field = np.argsort(warped.order), SmoothField.of(warped.source)
    clean, below = (hard_evidence(field, warped.target + size * noise, pairs) for size in (0.0, 2e-4))
    assert clean is not None
    assert below is not None
    assert below.log == pytest.approx(clean.log, abs=0.01 * len(warped.target))


def test_outliers_lower_what_each_target_says(warped: Warped) -> None:
    rng, pairs, found = np.random.default_rng(4), np.argsort(warped.order), []
    for count in (0, 20, 80):
        target = np.vstack([warped.target, rng.uniform(-1.6, 1.6, (count, warped.target.shape[1]))])
        item = hard_evidence(SmoothField.of(warped.source), target, pairs)
        assert item is not None
        found.append((item.log - unrelated_evidence(target)) / len(target))
    assert np.all(np.diff(found) < 0)


def test_unrelated_even_clouds_say_little(warped: Warped) -> None:
    true = _evidence(warped.source, warped.truth, warped.target).log - unrelated_evidence(warped.target)
    dimension = warped.source.shape[1]
    for seed in range(6):
        clouds = np.random.default_rng(seed).uniform(-1, 1, (2, len(warped.source), dimension))
        here, there = (NormalFrame.of(one).inward(one) for one in clouds)
        assert _evidence(here, here, there).log - unrelated_evidence(there) < 0.05 * true


@pytest.mark.parametrize("degrees", [0, 70])
def test_neither_order_nor_rotation_nor_unit_of_the_target_counts(warped: Warped, degrees: float) -> None:
    turn = _turn(warped.source.shape[1], degrees)
    order = np.random.default_rng(5).permutation(len(warped.target))
    one = _evidence(warped.source, warped.truth, warped.target)
    other = _evidence(warped.source, warped.truth @ turn, (warped.target @ turn)[order])
    # The uniform density of points without partner depends on the axes; here all points have partners.
    assert other.log == pytest.approx(one.log, rel=1e-6)
    assert other.sigma == pytest.approx(one.sigma, rel=1e-6)


def test_certain_soft_pairs_are_hard_ones(warped: Warped) -> None:
    field, pairs = SmoothField.of(warped.source), np.zeros((len(warped.source),) * 2)
    pairs[np.arange(len(pairs)), np.argsort(warped.order)] = 1.0
    soft, hard = (
        soft_evidence(field, warped.target, pairs),
        hard_evidence(field, warped.target, np.argsort(warped.order)),
    )
    assert soft is not None
    assert hard is not None
    assert soft.log == pytest.approx(hard.log)
    np.testing.assert_array_equal(soft.matches, hard.matches)


def test_one_pair_more_than_an_affine_map_takes_is_enough(warped: Warped) -> None:
    dimension = warped.source.shape[1]
    for count, enough in ((dimension + 1, False), (dimension + 2, True)):
        pairs = np.zeros((len(warped.source), len(warped.target)))
        pairs[np.arange(count), np.arange(count)] = 1.0
        assert (soft_evidence(SmoothField.of(warped.source), warped.target, pairs) is not None) == enough


def test_too_few_pairs_are_none(warped: Warped) -> None:
    nothing = np.full(len(warped.source), UNMATCHED)
    assert hard_evidence(SmoothField.of(warped.source), warped.target, nothing) is None
    far = PoseSearch.of(warped.source, warped.target)
    assert settled(far, warped.source + 50.0) is None


def test_the_prior_in_the_plane_is_von_mises() -> None:
    for degrees in (0.0, 10.0, 90.0, 180.0):
        spread = np.radians(20.0)
        expected = vonmises.logpdf(np.radians(degrees), 1 / spread**2) + np.log(2 * np.pi)
        assert log_rotation_prior(_turn(2, degrees), 20.0) == pytest.approx(expected)
        assert rotation_deg(3 * _turn(2, degrees)) == pytest.approx(degrees, abs=1e-5)


@pytest.mark.parametrize("sd_deg", [None, 30.0])
def test_the_prior_in_space_has_a_mean_of_one_over_all_rotations(sd_deg: float | None) -> None:
    turns = special_ortho_group.rvs(3, size=4000, random_state=0)
    density = np.exp([log_rotation_prior(turn, sd_deg) for turn in turns])
    assert density.mean() == pytest.approx(1.0, abs=4 * density.std() / np.sqrt(len(density)))


def test_between_two_poses_that_explain_as_much_the_prior_decides() -> None:
    angle = np.arange(60) * 2 * np.pi / 60
    outline = (1 + 0.3 * np.cos(2 * angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    outline = NormalFrame.of(outline).inward(outline)
    posterior = pose_posterior(outline, outline, rng=np.random.default_rng(0), rotation_sd_deg=60.0)
    found = sorted(posterior.alternatives(), key=lambda pose: -pose.probability)[:2]
    assert [round(pose.rotation_deg) for pose in found] == [0, 180]
    difference = log_rotation_prior(np.eye(2), 60.0) - log_rotation_prior(-np.eye(2), 60.0)
    assert np.log(found[0].probability / found[1].probability) == pytest.approx(difference, abs=0.5)
