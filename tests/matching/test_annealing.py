"""Soft pairs against the whole matrix, and the spline that follows them as they harden."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from scipy.stats import multivariate_normal

from tsis.matching import annealing
from tsis.matching.annealing import Cooling, anneal, soft_pairs
from tsis.matching.spline import spline_basis

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


COOLING = Cooling(factor=0.9, start=annealing.START, end=0.003, rounds=4)


def _whole_matrix(
    transformed: np.ndarray, target: np.ndarray, temperature: float, *, balancings: int = 2000
) -> np.ndarray:
    """Weights of `soft_pairs`, shape (n, m), from the full matrix with the outliers' row and column."""
    weights = np.zeros((len(transformed) + 1, len(target) + 1))
    weights[:-1, :-1] = np.exp(-cdist(transformed, target, "sqeuclidean") / (2 * temperature)) / temperature
    weights[:-1, -1], weights[-1, :-1] = annealing.outlier_weights(transformed), annealing.outlier_weights(target)
    for _ in range(balancings):
        weights[:-1] /= weights[:-1].sum(axis=1, keepdims=True)
        weights[:, :-1] /= weights[:, :-1].sum(axis=0, keepdims=True)
    return np.asarray(weights[:-1, :-1])


@pytest.fixture
def to_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is left out and balancing goes on until nothing changes."""
    monkeypatch.setattr(annealing, "BALANCED", 1e-12)
    monkeypatch.setattr(annealing, "BALANCINGS", 5000)
    monkeypatch.setattr(annealing, "CUT_OFF", 100.0)


def test_columns_of_the_field_make_the_covariance_of_two_gaussian_processes() -> None:
    """Entry by entry; what is dropped of it is a hundred-thousandth of its largest eigenvalue."""
    points = np.random.default_rng(3).normal(size=(30, 2))
    design, ridge = annealing.field_design(points, np.arange(30))
    expected = np.zeros((30, 30))
    for i, j in np.ndindex(30, 30):
        square = float(((points[i] - points[j]) ** 2).sum())
        for width, amplitude in zip(annealing.FIELD_WIDTHS, annealing.FIELD_AMPLITUDES, strict=True):
            expected[i, j] += amplitude**2 * np.exp(-square / (2 * width**2))
    covariance = design[:, 3:] @ np.diag(1 / ridge[3:]) @ design[:, 3:].T
    np.testing.assert_allclose(covariance, expected, atol=1e-5 * 30 * expected.max())
    np.testing.assert_array_equal(design[:, :3], np.column_stack([np.ones(30), points]))


@pytest.mark.parametrize("temperature", [1.0, 0.05, 1e-4])
@pytest.mark.usefixtures("to_the_end")
def test_soft_pairs_equal_the_whole_matrix(warped: Warped, temperature: float) -> None:
    target = warped.target[:40]
    plain = _whole_matrix(warped.source, target, temperature)
    start = np.exp(np.random.default_rng(1).normal(size=40))
    paired, drawn, _ = soft_pairs(warped.source, target, temperature, start)
    np.testing.assert_allclose(paired, plain.sum(axis=1), atol=1e-9)
    np.testing.assert_allclose(drawn, plain @ target, atol=1e-9)


@pytest.mark.parametrize("temperature", [1.0, 0.05, 1e-4])
@pytest.mark.parametrize("balancings", [1, 10])
def test_so_do_those_of_a_few_balancings(
    warped: Warped, temperature: float, balancings: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(annealing, "BALANCED", 0.0)
    monkeypatch.setattr(annealing, "BALANCINGS", balancings)
    monkeypatch.setattr(annealing, "CUT_OFF", 100.0)
    paired, drawn, _ = soft_pairs(warped.source, warped.target, temperature, np.ones(len(warped.target)))
    plain = _whole_matrix(warped.source, warped.target, temperature, balancings=balancings)
    np.testing.assert_allclose(paired, plain.sum(axis=1), atol=1e-9)
    np.testing.assert_allclose(drawn, plain @ warped.target, atol=1e-9)


@pytest.mark.usefixtures("to_the_end")
def test_every_pair_within_reach_is_kept_however_many_there_are() -> None:
    moved, target = np.random.default_rng(3).normal(size=(2, 90, 2)) * 0.2
    paired, drawn, _ = soft_pairs(moved, target, 3.0, np.ones(90))
    plain = _whole_matrix(moved, target, 3.0, balancings=5000)
    np.testing.assert_allclose(paired, plain.sum(axis=1), atol=1e-9)
    np.testing.assert_allclose(drawn, plain @ target, atol=1e-9)


@pytest.mark.parametrize("temperature", [0.5, 3.0])
def test_pairs_beyond_the_reach_count_as_nothing(monkeypatch: pytest.MonkeyPatch, temperature: float) -> None:
    """Beyond a squared distance of the reach times the temperature, against the whole matrix with zeros there."""
    monkeypatch.setattr(annealing, "BALANCED", 0.0)
    monkeypatch.setattr(annealing, "BALANCINGS", 40)
    monkeypatch.setattr(annealing, "CUT_OFF", 4.0)
    moved, target = np.random.default_rng(5).normal(size=(2, 60, 2)) * 2 * np.sqrt(temperature)
    away = ((moved[:, None] - target[None]) ** 2).sum(axis=2)
    weights = np.zeros((61, 61))
    weights[:-1, :-1] = np.where(away < 4.0 * temperature, np.exp(-away / (2 * temperature)) / temperature, 0.0)
    assert 200 < np.count_nonzero(weights) < 3000
    weights[:-1, -1], weights[-1, :-1] = annealing.outlier_weights(moved), annealing.outlier_weights(target)
    for _ in range(40):
        weights[:-1] /= weights[:-1].sum(axis=1, keepdims=True)
        weights[:, :-1] /= weights[:, :-1].sum(axis=0, keepdims=True)
    paired, drawn, _ = soft_pairs(moved, target, temperature, np.ones(60))
    np.testing.assert_allclose(paired, weights[:-1, :-1].sum(axis=1), atol=1e-9)
    np.testing.assert_allclose(drawn, weights[:-1, :-1] @ target, atol=1e-9)


def test_the_last_balance_saves_work_and_is_not_changed_in_place(warped: Warped) -> None:
    plain = _whole_matrix(warped.source, warped.target, 0.1).sum(axis=1)
    balance, wrong = np.ones(len(warped.target)), []
    for _ in range(5):
        before = balance.copy()
        paired, _, after = soft_pairs(warped.source, warped.target, 0.1, balance)
        np.testing.assert_array_equal(balance, before)
        wrong.append(float(np.max(np.abs(paired - plain))))
        balance = after
    assert wrong[-1] < wrong[0]
    assert np.all(np.diff(wrong) <= 0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_outlier_weights_are_a_gaussian_about_the_mass_centre(dimension: int) -> None:
    points = np.random.default_rng(6).normal(size=(80, dimension)) + 2.0
    centred = multivariate_normal(points.mean(axis=0), annealing.START * np.eye(dimension))
    expected = centred.pdf(points) / centred.pdf(centred.mean) / annealing.START
    np.testing.assert_allclose(annealing.outlier_weights(points), expected, rtol=1e-12)


def test_a_point_far_from_all_has_no_pair() -> None:
    moved, target = np.array([[0.0, 0.0], [1.0, 0.0], [9.0, 9.0]]), np.array([[0.0, 0.1], [1.0, 0.1]])
    paired, drawn, _ = soft_pairs(moved, target, 1e-3, np.ones(2))
    assert paired[:2].min() > 0.9 > 1e-9 > paired[2]
    np.testing.assert_allclose(drawn[:2] / paired[:2, None], target, atol=1e-9)


def test_cooling_finds_a_smooth_deformation(warped: Warped) -> None:
    basis = spline_basis(warped.source)
    found = basis.spline(anneal(basis, basis.rest, warped.target, COOLING))
    assert warped.rms(found(warped.source)) < 0.2 * warped.rms(warped.source)


def test_a_start_near_the_truth_needs_no_heat(warped: Warped) -> None:
    turn = np.eye(warped.source.shape[1])
    turn[:2, :2] = [[0.0, 1.0], [-1.0, 0.0]]
    basis = spline_basis(warped.source)
    start = basis.rest
    start[basis.bent + 1 :] = turn
    cooling = Cooling(factor=0.9, start=0.15, end=0.003, rounds=4)
    found = basis.design @ anneal(basis, start, warped.target @ turn, cooling)
    assert warped.rms(found @ turn.T) < 0.2 * warped.rms(warped.source)


def test_the_coarse_path_ends_near_the_fine_one(warped: Warped, monkeypatch: pytest.MonkeyPatch) -> None:
    basis = spline_basis(warped.source)
    fine = basis.design @ anneal(basis, basis.rest, warped.target, COOLING)
    monkeypatch.setattr(annealing, "COARSE", (40, 50))
    coarse = basis.design @ anneal(basis, basis.rest, warped.target, COOLING)
    assert 0 < np.sqrt(np.mean(np.sum((coarse - fine) ** 2, axis=1))) < 0.02


@pytest.mark.parametrize("coarse", [(20, 30), (20, 500), (500, 30)])
def test_more_points_take_part_the_cooler_it_is(
    monkeypatch: pytest.MonkeyPatch, warped: Warped, coarse: tuple[int, int]
) -> None:
    monkeypatch.setattr(annealing, "COARSE", coarse)
    seen = []

    def watched(
        moved: np.ndarray, target: np.ndarray, temperature: float, balance: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        seen.append((len(moved), len(target), temperature))
        assert len(balance) == len(target)
        return soft_pairs(moved, target, temperature, balance)

    monkeypatch.setattr(annealing, "soft_pairs", watched)
    basis = spline_basis(warped.source)
    anneal(basis, basis.rest, warped.target, COOLING)
    points, places, temperature = np.array(seen).T
    number = len(warped.source)
    assert (points[0], places[0]) == (min(coarse[0], number), min(coarse[1], number))
    assert (points[-1], places[-1]) == (number, number)
    for falling in (-points, -places, temperature):
        assert np.all(np.diff(falling) <= 0)


RNG = np.random.default_rng(0)


def test_outliers_do_not_draw(warped: Warped) -> None:
    dimension = warped.source.shape[1]
    stray = np.random.default_rng(2).uniform(-1.8, 1.8, (30, dimension))
    found = annealing.fit(warped.source, np.vstack([warped.target, stray]), rng=RNG)
    assert warped.rms(found.move(warped.source)) < 0.05


def test_few_points_are_matched() -> None:
    corners = np.array([[1.0, 0.0], [-0.5, 0.8], [-0.5, -0.8]])
    found = annealing.fit(corners, corners[[2, 0, 1]], rng=RNG)
    assert found.matches.tolist() == [1, 2, 0]


def test_points_given_twice_are_matched_once_each() -> None:
    source = np.repeat(np.random.default_rng(5).normal(size=(12, 2)), 2, axis=0)
    found = annealing.fit(source, source[::2] + 0.01, rng=RNG)
    matched = found.matches[found.matches >= 0]
    assert sorted(matched.tolist()) == list(range(12))
    np.testing.assert_allclose(found.move(source), source + 0.01, atol=0.05)
