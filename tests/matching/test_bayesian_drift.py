"""Bayesian coherent point drift: against the paper's matrices in full, pycpd, and maps that are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from tsis.matching import bayesian_drift
from tsis.matching.drift import WIDTH

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


def textbook(source: np.ndarray, target: np.ndarray, rounds: int, w: float) -> tuple[np.ndarray, float]:
    """The rounds of Hirose (2021) before the variance settles, with the scale 1, every matrix in full."""
    (n, d), m, stiffness = source.shape, len(target), bayesian_drift.STIFFNESS
    kernel = np.exp(-np.sum((source[:, None] - source) ** 2, axis=2) / (2 * WIDTH**2)) + 1e-10 * np.eye(n)
    rotation, shift, moved = np.eye(d), np.zeros(d), source
    blur = np.full(n, 1 / stiffness)
    box = np.prod(bayesian_drift.ROOM * (target.max(axis=0) - target.min(axis=0)))
    variance = bayesian_drift.WIDENING * np.sum((source[:, None] - target) ** 2) / (d * n * m)
    for _ in range(rounds):
        away = np.sum((moved[:, None] - target) ** 2, axis=2)
        near = np.exp(-away / (2 * variance)) / (2 * np.pi * variance) ** (d / 2)
        near *= ((1 - w) / n * np.exp(-d * blur / (2 * variance)))[:, None]
        chance = near / (w / box + near.sum(axis=0))
        counts = chance.sum(axis=1)
        expected = chance @ target / counts[:, None]
        precision = np.diag(counts) / variance
        covariance = np.linalg.inv(stiffness * np.linalg.inv(kernel) + precision)
        displaced = source + covariance @ precision @ ((expected - shift) @ rotation - source)
        blur = np.diag(covariance)
        there, here, mean_blur = (counts @ each / counts.sum() for each in (expected, displaced, blur))
        cross = (counts[:, None] * (expected - there)).T @ (displaced - here) / counts.sum()
        left, _, right = np.linalg.svd(cross)
        rotation = left @ np.diag([*[1] * (d - 1), np.linalg.det(left @ right)]) @ right
        shift = there - rotation @ here
        moved = displaced @ rotation.T + shift
        away = np.sum((moved[:, None] - target) ** 2, axis=2)
        variance = np.sum(chance * away) / (counts.sum() * d) + mean_blur
    return moved, float(variance)


def test_low_rank_sums_equal_the_paper(warped: Warped) -> None:
    target = np.vstack([warped.target[:60], [np.full(warped.source.shape[1], 1.5)]])
    drifted = bayesian_drift.fit_drift(warped.source, target, outliers=0.2, rounds=6, settled=0.0)
    moved, variance = textbook(warped.source, target, 6, 0.2)
    np.testing.assert_allclose(drifted.move(warped.source), moved, atol=1e-4)
    assert drifted.variance == pytest.approx(variance, rel=1e-4)


def test_a_stiff_field_without_outliers_is_rigid_drift(warped: Warped) -> None:
    peer = pytest.importorskip("pycpd", reason="pycpd, the peer that this is compared with, is not installed")
    drifted = bayesian_drift.fit_drift(warped.source, warped.target, outliers=0.0, stiffness=1e9, settled=1e-9)
    moved, (scale, rotation, _) = peer.RigidRegistration(
        X=warped.target, Y=warped.source, w=0.0, max_iterations=300, tolerance=1e-12
    ).register()
    np.testing.assert_allclose(drifted.move(warped.source), moved, atol=1e-3)
    assert drifted.move.scale == pytest.approx(scale, rel=1e-3)
    np.testing.assert_allclose(drifted.move.rotation, rotation.T, atol=1e-3)


def test_a_similarity_is_found_exactly(warped: Warped) -> None:
    cosine, sine = np.cos(0.3), np.sin(0.3)
    rotation = np.eye(warped.source.shape[1])
    rotation[:2, :2] = [[cosine, -sine], [sine, cosine]]
    target = 1.2 * warped.source @ rotation.T + 0.1
    drifted = bayesian_drift.fit_drift(warped.source, target[warped.order], outliers=0.1, stiffness=1e6)
    np.testing.assert_allclose(drifted.move(warped.source), target, atol=0.01)
    assert np.linalg.det(drifted.move.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize("share", [0.1, 0.4, 0.7])
def test_the_bound_chooses_the_fraction_of_outliers(share: float) -> None:
    turn = np.linspace(0.5, 9, 60)
    source = (turn * np.array([np.cos(turn), np.sin(turn)])).T / 6
    truth = source + 0.06 * np.sin(1.7 * source[:, ::-1])
    rng = np.random.default_rng(3)
    target = np.vstack([truth, rng.uniform(-1.6, 1.6, (round(share / (1 - share) * len(truth)), 2))])
    drifts = {each: bayesian_drift.fit_drift(source, target, outliers=each) for each in bayesian_drift.FRACTIONS}
    best = max(drifts.values(), key=lambda drift: drift.bound)
    assert best is drifts[share]
    assert best.outliers == pytest.approx(share, abs=0.06)
    error = np.sqrt(np.mean(np.sum((best.move(source) - truth) ** 2, axis=1)))
    assert error < 0.05
