"""Evidence: against the mixture written out, and larger for the true map than for any other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.special import logsumexp
from scipy.stats import multivariate_normal

from tsis.matching._evidence import explained, log_evidence, upright_prior
from tsis.matching._fit import NormalFrame
from tsis.matching._spline import spline_basis

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


@pytest.mark.parametrize("variance", [1.0, 0.03, 1e-4])
@pytest.mark.parametrize("outliers", [0.01, 0.6])
def test_what_explains_the_target_equals_the_mixture(warped: Warped, variance: float, outliers: float) -> None:
    moved, target, even = warped.source, warped.target[:30], 0.1
    dimension = target.shape[1]
    about = [multivariate_normal(one, variance * np.eye(dimension)) for one in moved]
    logs = np.array([one.logpdf(target) for one in about]) + np.log((1 - outliers) / len(moved))
    total = logsumexp(np.vstack([logs, np.full(len(target), np.log(outliers * even))]), axis=0)
    shares = np.exp(logs - total)
    away = np.sum((moved[:, None] - target) ** 2, axis=2)
    found = explained(moved, target, variance, outliers, even)
    # Pairs seven standard deviations apart are left out, which weigh exp(-25) of those in one place.
    assert found.likelihood == pytest.approx(total.sum(), abs=1e-3)
    np.testing.assert_allclose(found.paired, shares.sum(axis=1), atol=1e-4)
    np.testing.assert_allclose(found.drawn, shares @ target, atol=1e-4)
    assert found.squared == pytest.approx(float(np.sum(shares * away)), abs=1e-4)


def _turned(dimension: int, degrees: float) -> np.ndarray:
    angle = np.radians(degrees)
    turn = np.eye(dimension)
    turn[:2, :2] = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    return turn


def test_the_true_map_is_likelier_than_others(warped: Warped) -> None:
    basis = spline_basis(warped.source)
    true = log_evidence(basis, basis.coordinates(warped.truth, bending=1e-6), warped.target)
    for degrees in (90, 180):
        other = basis.rest
        other[basis.bent + 1 :] = _turned(warped.source.shape[1], degrees)
        assert true > log_evidence(basis, other, warped.target) + 2 * len(warped.target)
    aside = basis.rest
    aside[basis.bent] = 0.8
    assert true > log_evidence(basis, aside, warped.target) + len(warped.target)


def test_a_map_near_the_true_one_is_as_likely(warped: Warped) -> None:
    basis = spline_basis(warped.source)
    true = log_evidence(basis, basis.coordinates(warped.truth, bending=1e-6), warped.target)
    near = warped.truth + np.random.default_rng(0).normal(size=warped.truth.shape) * 0.02
    assert log_evidence(basis, basis.coordinates(near, bending=1e-2), warped.target) == pytest.approx(true, rel=0.05)


def test_noise_lowers_it(warped: Warped) -> None:
    basis, noise = spline_basis(warped.source), np.random.default_rng(3).normal(size=warped.target.shape)
    coordinates = basis.coordinates(warped.truth, bending=1e-6)
    found = [log_evidence(basis, coordinates, warped.target + size * noise) for size in (0.0, 0.02, 0.05, 0.1)]
    assert np.all(np.diff(found) < 0)


def test_outliers_lower_what_each_target_says(warped: Warped) -> None:
    rng, basis = np.random.default_rng(4), spline_basis(warped.source)
    coordinates, found = basis.coordinates(warped.truth, bending=1e-6), []
    for count in (0, 20, 80):
        target = np.vstack([warped.target, rng.uniform(-1.6, 1.6, (count, warped.target.shape[1]))])
        found.append(log_evidence(basis, coordinates, target) / len(target))
    assert np.all(np.diff(found) < 0)


def test_unrelated_even_clouds_say_little(warped: Warped) -> None:
    basis = spline_basis(warped.source)
    true = log_evidence(basis, basis.coordinates(warped.truth, bending=1e-6), warped.target)
    dimension = warped.source.shape[1]
    for seed in range(6):
        clouds = np.random.default_rng(seed).uniform(-1, 1, (2, len(warped.source), dimension))
        here, there = (NormalFrame.of(one).inward(one) for one in clouds)
        chance = spline_basis(here)
        assert log_evidence(chance, chance.rest, there) < 0.05 * true


@pytest.mark.parametrize("upright", [True, False])
def test_the_order_of_the_points_does_not_count(warped: Warped, upright: bool) -> None:
    turn = np.eye(warped.source.shape[1]) if upright else _turned(warped.source.shape[1], 70)
    order = np.random.default_rng(5).permutation(len(warped.target))
    basis = spline_basis(warped.source)
    coordinates = basis.coordinates(warped.truth @ turn, bending=1e-6)
    one = log_evidence(basis, coordinates, warped.target @ turn)
    assert log_evidence(basis, coordinates, (warped.target @ turn)[order]) == pytest.approx(one, rel=1e-6)


def test_between_two_maps_that_explain_alike_the_upright_is_likelier() -> None:
    angle = np.arange(40) * 2 * np.pi / 40
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    basis = spline_basis(circle)
    turned = basis.rest
    turned[basis.bent + 1 :] = _turned(2, 180)
    assert log_evidence(basis, basis.rest, circle) == pytest.approx(log_evidence(basis, turned, circle))
    assert upright_prior(turned[basis.bent + 1 :], 40) < upright_prior(basis.rest[basis.bent + 1 :], 40) - 1 == -1
