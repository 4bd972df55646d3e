"""Evidence of a pose against the density written out, and what it says of symmetric, mirrored and unrelated sets."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import pytest
from benchmarks.matching.distort import even_texture, strokes, tactile_surface
from benchmarks.matching.trials import DATA, matching_error, public_trials
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from tsis.matching import posterior, register, registration
from tsis.matching.methods import MatchFit, NormalFrame
from tsis.matching.outline import Ranking, _local_medians, chains, laid_pieces, main_curve, successors
from tsis.matching.pose_evidence import (
    AMPLITUDES,
    SIGMAS,
    WIDTHS,
    SmoothField,
    _affine_prior,
    _count_prior,
    gaussian_kernel,
    hard_evidence,
    size_and_stretch,
)
from tsis.matching.posterior import (
    MOST_UNSOUND,
    THRESHOLDS,
    PosePosterior,
    is_sound,
    least_confidence,
    log_rotation_prior,
    pose_posterior,
    probability_right,
    trust_measures,
)

if TYPE_CHECKING:
    from benchmarks.matching.distort import Family, Shape
    from tests.matching.conftest import Warped


def _outline(*radii: float, count: int = 80) -> np.ndarray:
    """An outline with a radius of 1 and the given cosines of one, two, ... periods."""
    angle = 2 * np.pi * np.arange(count) / count
    radius = 1 + sum(size * np.cos((order + 1) * angle + order) for order, size in enumerate(radii))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def _rotated(points: np.ndarray, degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    return np.asarray(points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]))


def test_the_evidence_equals_the_restricted_likelihood() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(18, 2))
    target = points + 0.1 * np.sin(2 * points[:, ::-1]) + 0.02 * rng.normal(size=points.shape)
    span = np.column_stack([np.ones(18), points])
    size, stretch = size_and_stretch(np.array(np.linalg.lstsq(span, target, rcond=None)[0][1:], dtype=float))
    free = null_space(span.T).T
    logs = []
    for width in WIDTHS:
        kernel = gaussian_kernel(points, points, width)
        for amplitude in AMPLITUDES:
            for sigma in SIGMAS:
                covariance = size**2 * free @ (amplitude**2 * kernel + sigma**2 * np.eye(18)) @ free.T
                normal = multivariate_normal(np.zeros(len(free)), covariance)
                logs.append(normal.logpdf((free @ target).T).sum())
    expected = logsumexp(logs) - np.log(len(logs)) + _affine_prior(size, stretch, 18, 2) + _count_prior(18, 18, target)
    found = hard_evidence(SmoothField.of(points), target, np.arange(18))
    assert found is not None
    assert found.log == pytest.approx(expected, abs=0.1)


@pytest.mark.parametrize("method", ["tprl", "cpd", "tps-rpm"])
@pytest.mark.parametrize("order", [2, 3, 5])
def test_a_symmetric_shape_has_alternatives_and_is_not_reliable(order: int, method: str) -> None:
    shape = _outline(*[0.0] * (order - 1), 0.2, count=60)
    found = register(shape, _rotated(shape, 5.0), method=method, rotation_sd_deg=1000.0)
    assert not found.reliable
    assert len(found.alternatives) >= order
    assert found.alternatives[0].probability < 0.9


def test_a_circle_is_not_reliable() -> None:
    found = register(_outline(), _rotated(_outline(), 2.0), rotation_sd_deg=1000.0)
    assert not found.reliable
    assert len(found.alternatives) > 3


def _noisy_posterior(noise: float) -> tuple[np.ndarray, PosePosterior]:
    """An outline, and the posterior of its match with a noisy copy."""
    shape = _outline(0.0, 0.2, 0.1, count=60)
    shape -= shape.mean(axis=0)
    shape /= np.sqrt((shape**2).sum(axis=1).mean())
    rng = np.random.default_rng(2)
    return shape, pose_posterior(shape, shape + noise * rng.normal(size=shape.shape), rng=rng)


def test_without_noise_the_prior_and_the_evidence_of_pairs_make_the_posterior() -> None:
    _, found = _noisy_posterior(0.0)
    priors = np.array([log_rotation_prior(item.affine[1:], None) for item in found.maps])
    expected = priors + [item.log for item in found.maps]
    np.testing.assert_allclose(found.logs - found.logs[0], expected - expected[0], atol=1e-9)


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.08])
def test_a_neighbour_as_partner_is_no_other_pose(noise: float) -> None:
    """Under noise of several spacings every pair may be wrong while the transform is right."""
    shape, found = _noisy_posterior(noise)
    assert found.best is not None
    assert np.sqrt(((found.best.moved - shape) ** 2).sum(axis=1).mean()) < 0.245
    assert found.log_odds(found.best.moved) > 3
    assert np.exp(found.logs).sum() + np.exp(found.unrelated) == pytest.approx(1.0)


def test_the_first_map_is_of_the_most_probable_pose() -> None:
    _, found = _noisy_posterior(0.08)
    assert found.best is not None
    assert found.log_odds(found.best.moved) >= max(found.log_odds(item.moved) for item in found.maps) - 0.5


def test_a_prior_of_the_rotation_orders_the_alternatives() -> None:
    shape = _outline(0.0, 0.25)
    found = register(shape, _rotated(shape, 170.0), rotation_sd_deg=5.0)
    assert found.alternatives[0].rotation_deg < 90


def test_an_outline_with_a_mark_is_reliable() -> None:
    shape = _outline(0.05, 0.25, 0.15, 0.1)
    target = _rotated(shape + 0.03 * np.sin(3 * shape[:, ::-1]), 40.0)
    found = register(shape, target)
    assert found.reliable
    np.testing.assert_allclose(found.moved, target, atol=0.02)
    assert sum(pose.probability for pose in found.alternatives) <= 1 + 1e-9


@pytest.mark.parametrize("strays", [0, 12])
@pytest.mark.parametrize("hidden", ["piece", "scattered", "none"])
def test_a_piece_of_the_outline_is_laid_on_its_place(hidden: str, strays: int) -> None:
    rng = np.random.default_rng(8)
    shape = _outline(0.05, 0.25, 0.15, 0.1, count=90)
    source = shape / np.sqrt((shape**2).sum(axis=1).mean())
    some = {"piece": np.arange(20, 80), "scattered": np.sort(rng.permutation(90)[:60]), "none": np.arange(90)}[hidden]
    target = np.vstack([_rotated(source, 140.0)[some], rng.uniform(-1.5, 1.5, (strays, 2))])
    shuffle = rng.permutation(len(target))
    point = np.append(some, np.full(strays, 999))[shuffle]  # the source's point of each target point
    target = target[shuffle]
    curve = main_curve(source, chains(successors(source)))
    near = []
    for matches in laid_pieces(curve, Ranking.of(SmoothField.of(source), target), successors(target)):
        paired = np.flatnonzero(matches >= 0)
        away = np.abs((point[matches[paired]] - paired + 45) % 90 - 45)
        near.append(np.mean((away <= 3) & (point[matches[paired]] < 90)))
    assert max(near) > (0.99 if not strays and hidden != "scattered" else 0.75)
    assert min(near) < 0.2


def test_steps_along_a_curve_are_compared_with_their_neighbours_median() -> None:
    steps = np.random.default_rng(3).uniform(0.5, 2.0, 40)
    expected = [np.median(steps[max(k - 4, 0) : k + 5]) for k in range(40)]
    np.testing.assert_array_equal(_local_medians(steps, 4), expected)
    doubled = np.column_stack([steps, np.zeros(40)]).ravel()
    np.testing.assert_array_equal(_local_medians(doubled, 8)[::2], expected)


def test_points_that_are_given_twice_match_without_a_warning() -> None:
    angle = np.linspace(0, 5, 60)
    spiral = angle[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    found = register(spiral + 0.03 * np.sin(spiral[:, ::-1]), np.vstack([spiral, spiral[:20]]))
    assert found.reliable
    np.testing.assert_allclose(found.moved, spiral, atol=0.01)


@pytest.mark.parametrize("first", [0, 30, 55])
def test_an_oval_with_a_hidden_piece_is_not_turned_over(first: int) -> None:
    shape = _outline(0.02, 0.22, 0.03, count=100)
    target = np.roll(_rotated(shape + 0.03 * np.sin(3 * shape[:, ::-1]), 10.0), -first, axis=0)[:72]
    found = register(shape, target)
    away = np.roll(found.untrusted.moved, -first, axis=0)[:72] - target
    assert np.sqrt((away**2).sum(axis=1).mean()) < 0.02


@pytest.mark.parametrize("method", ["tprl", "cpd"])
@pytest.mark.parametrize("count", [40, 400])
def test_unrelated_sets_are_not_reliable(method: str, count: int) -> None:
    rng = np.random.default_rng(2)
    found = register(rng.uniform(size=(40, 2)), rng.uniform(size=(count, 2)), method=method)
    assert found.confidence < 0.5
    assert not found.reliable


def test_a_mirrored_cloud_is_not_reliable() -> None:
    cloud = np.random.default_rng(3).normal(size=(60, 3)) * [1.0, 0.7, 0.4]
    assert not register(cloud, cloud * [-1.0, 1.0, 1.0]).reliable


@pytest.mark.parametrize("matrix", [np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, 1.0, 0.1]), np.diag([5.0, 1.0, 1.0])])
def test_a_mirrored_or_sheared_map_is_not_sound(matrix: np.ndarray) -> None:
    cloud = np.random.default_rng(4).normal(size=(50, 3))
    assert is_sound(lambda points: points @ np.diag([1.2, 1.0, 0.9]), cloud)
    assert not is_sound(lambda points: points @ matrix, cloud)


CLEAR = (50.0, 0.0, 0.0, -3.0, 0.0, 0.3, -50.0, 1.0)  # measures of an answer beyond doubt


@pytest.mark.parametrize(
    ("place", "value", "most"),
    [(5, 1.0, 0.9), (7, 0.0, 0.5), (0, 2.5, 0.97), (6, 0.0, 0.0)],
    ids=["stretched more than any in the calibration", "folded", "a rival", "unrelated"],
)
def test_one_doubt_makes_an_answer_unreliable(place: int, value: float, most: float) -> None:
    assert probability_right(np.array(CLEAR)) >= 0.999
    assert probability_right(np.array([*CLEAR[:place], value, *CLEAR[place + 1 :]])) <= most


@pytest.mark.parametrize("shape", [even_texture, strokes])
@settings(max_examples=8, derandomize=True)
@given(degrees=st.floats(0, 360), seed=st.integers(0, 1000))
def test_any_rotation_is_found(shape: Shape, degrees: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    source = shape(60, rng=rng)
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    truth = (source + 0.015 * np.sin(5 * source[:, ::-1])) @ turn
    found = register(source, truth[rng.permutation(60)], rng=rng)
    assert np.sqrt(np.mean(np.sum((found.untrusted.moved - truth) ** 2, axis=1))) < 0.02


@pytest.mark.parametrize("seed", range(4))
def test_outliers_and_missing_points_hardly_move_what_is_seen(seed: int) -> None:
    rng = np.random.default_rng(seed)
    source = strokes(80, rng=rng)
    truth = source + 0.03 * np.sin(6 * source[:, ::-1])
    seen = source[:, 0] < np.quantile(source[:, 0], 0.85)
    found = register(source, np.vstack([truth[seen], rng.uniform(0.2, 1.0, (17, 2))]), rng=rng)
    wrong = np.sqrt(np.sum((found.untrusted.moved - truth) ** 2, axis=1))
    assert np.median(wrong[seen]) < 0.01
    assert np.sqrt(np.mean(wrong[seen] ** 2)) < 0.03


@pytest.mark.parametrize("noise", [0.02, 0.05])
def test_noise_is_hardly_amplified(warped: Warped, noise: float) -> None:
    rng = np.random.default_rng(3)
    noisy = warped.target + noise * rng.normal(size=warped.target.shape)
    found = posterior.fit(warped.source, noisy, rng=rng)
    assert warped.rms(found.move(warped.source)) < 1.2 * noise * np.sqrt(warped.source.shape[1])


@pytest.mark.skipif(not DATA.is_dir(), reason="the public trials are not on this machine")
@pytest.mark.parametrize(
    ("shape", "family", "level"),
    [
        ("fish", "deformation", 5),
        ("chinese", "rotation", 6),
        pytest.param("fish", "rotation", 6, marks=pytest.mark.slow),
        pytest.param("chinese", "deformation", 5, marks=pytest.mark.slow),
    ],
)
def test_public_trials_are_matched_far_better_than_by_coherent_point_drift(
    shape: str, family: Family, level: int
) -> None:
    means = {}
    for method in ("tprl", "cpd"):
        trials = public_trials(DATA, shape=shape, family=family, level=level, count=3)
        errors = [
            matching_error(trial, register(trial.source, trial.target, method=method).untrusted.moved)
            for trial in trials
        ]
        means[method] = float(np.mean(errors))
    assert means["tprl"] < 0.5 * means["cpd"]
    assert means["tprl"] < 0.02


WRONG = 0.245  # 0.1 of the unit box, in root-mean-square radii
MANY = settings(max_examples=15, derandomize=True, deadline=None)


@cache
def _judged(kind: str) -> tuple[np.ndarray, np.ndarray, PosePosterior]:
    """A bent surface or a filled cloud of points, where they went, and the posterior of the two sets."""
    rng = np.random.default_rng(3)
    source = tactile_surface(60, rng=rng) if kind == "surface" else rng.normal(size=(60, 3))
    source = NormalFrame.of(source).inward(source)
    truth = source + 0.05 * np.sin(2 * source[:, [1, 2, 0]])
    return source, truth, pose_posterior(source, truth, rng=rng)


def _believed(kind: str, matrix: np.ndarray) -> tuple[float, float]:
    """Confidence in the true map followed by a matrix, and the error of that answer, in radii."""
    source, truth, searched = _judged(kind)

    def move(points: np.ndarray, /) -> np.ndarray:
        return np.asarray((points + 0.05 * np.sin(2 * points[:, [1, 2, 0]])) @ matrix)

    error = np.sqrt(((move(source) - truth) ** 2).sum(axis=1).mean())
    size = np.sqrt(((move(source) - move(source).mean(axis=0)) ** 2).sum(axis=1).mean())
    measures = trust_measures(searched, move(source), sound=is_sound(move, source))
    return probability_right(measures), float(error / size)


def test_an_answer_just_reliable_errs_more_often_than_the_accepted_mean() -> None:
    """Those above it err less, so that the mean of all is what is accepted."""
    accepted = np.geomspace(0.001, 0.03, 30)
    at_the_edge = 1 - np.array([least_confidence(share) for share in accepted])
    assert (np.diff(at_the_edge) > 0).all()
    assert (at_the_edge > accepted).all()


@pytest.mark.parametrize("kind", ["surface", "cloud"])
def test_the_right_map_is_believed(kind: str) -> None:
    confidence, error = _believed(kind, np.eye(3))
    assert error < 1e-12
    assert confidence >= THRESHOLDS[0][1]


@pytest.mark.parametrize("kind", ["surface", "cloud"])
@MANY
@given(seed=st.integers(0, 10_000), shear=st.floats(0.4, 3.0))
def test_a_sheared_answer_is_not(kind: str, seed: int, shear: float) -> None:
    turn = Rotation.random(random_state=seed).as_matrix()
    matrix = np.eye(3)
    matrix[0, 1] = shear
    confidence, error = _believed(kind, turn.T @ matrix @ turn)
    assert confidence < THRESHOLDS[0][1] or error <= WRONG


@pytest.mark.parametrize("kind", ["surface", "cloud"])
@MANY
@given(seed=st.integers(0, 10_000), depth=st.floats(0.05, 1.0))
def test_an_answer_inside_out_is_not(kind: str, seed: int, depth: float) -> None:
    """Mirrored along any direction, as far as the original depth or pressed flatter."""
    normal = np.random.default_rng(seed).normal(size=3)
    normal /= np.linalg.norm(normal)
    confidence, _ = _believed(kind, np.eye(3) - (1 + depth) * np.outer(normal, normal))
    assert confidence <= MOST_UNSOUND


@pytest.mark.parametrize("matrix", [-np.eye(3), np.array([[1.0, 1.2, 0], [0, 1, 0], [0, 0, 1]])])
def test_a_method_that_answers_so_is_withheld(monkeypatch: pytest.MonkeyPatch, matrix: np.ndarray) -> None:
    """Its own map is among those that the posterior compares."""

    def crooked(source: np.ndarray, target: np.ndarray, /, *, rng: np.random.Generator) -> MatchFit:
        del target, rng
        return MatchFit(
            move=lambda points, /: points @ matrix, matches=np.arange(len(source)), trust=np.ones(len(source))
        )

    monkeypatch.setattr(registration, "METHODS", {"crooked": crooked})
    source, truth, _ = _judged("surface")
    assert not register(source, truth, method="crooked").reliable
