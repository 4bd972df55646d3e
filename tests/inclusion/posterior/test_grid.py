"""The self-placing grid on densities whose moments are known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.stats import truncnorm

from tsis.inclusion.posterior.grid import refine

if TYPE_CHECKING:
    from numpy.typing import NDArray

LOW, HIGH = np.array([-10.0, -20.0, 0.0]), np.array([10.0, 20.0, 5.0])


def normal(
    mean: NDArray[np.float64], covariance: NDArray[np.float64], points: NDArray[np.float64]
) -> NDArray[np.float64]:
    away = points - mean
    return np.asarray(-0.5 * np.einsum("ni,ij,nj->n", away, np.linalg.inv(covariance), away), dtype=float)


def dense_moments(
    log_density: object, low: NDArray[np.float64], high: NDArray[np.float64], per_axis: int = 160
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean and standard deviation on one regular grid."""
    assert callable(log_density)
    axes = [a + (b - a) * (np.arange(per_axis) + 0.5) / per_axis for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    log_weight = log_density(points)
    weight = np.exp(log_weight - log_weight.max())
    weight /= weight.sum()
    mean = weight @ points
    return mean, np.sqrt(weight @ (points - mean) ** 2)


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), width=st.floats(1e-3, 0.08))
@example(seed=30260, width=0.0625)  # a thin slanted plate that few cells hit
def test_normal_densities_anywhere_in_the_box(seed: int, width: float) -> None:
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((3, 3)) * (HIGH - LOW)[:, None] * width / 6
    covariance = root @ root.T + np.diag((1e-4 * (HIGH - LOW)) ** 2)
    sd = np.sqrt(np.diag(covariance))
    mean = np.clip(LOW + (HIGH - LOW) * rng.random(3), LOW + 6 * sd, HIGH - 6 * sd)
    grid = refine(lambda points: normal(mean, covariance, points), LOW, HIGH)
    np.testing.assert_allclose(grid.mean(), mean, atol=0.03 * sd.max(), rtol=0)
    assert (np.abs(grid.mean() - mean) < 0.03 * sd).all()
    samples = grid.samples(4096)
    assert (np.abs(samples.mean(axis=0) - mean) < 0.06 * sd).all()
    np.testing.assert_allclose(samples.std(axis=0), sd, rtol=0.06)
    found = np.corrcoef(samples.T)
    np.testing.assert_allclose(found, covariance / np.outer(sd, sd), atol=0.06)


def banana(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bent: y follows x**2 / 8, z leans on y."""
    x, y, z = points.T
    return np.asarray(-0.5 * ((x / 2.0) ** 2 + (y - x**2 / 8) ** 2 / 0.3**2 + (z - 2.0 - y / 5) ** 2 / 0.2**2))


def test_a_bent_density() -> None:
    grid = refine(banana, LOW, HIGH)
    samples = grid.samples(8192)
    # x is normal with sd 2; y = x**2 / 8 has mean 1/2 and variance 2 (4 / 8)**2, plus 0.3**2.
    mean, sd = np.array([0.0, 0.5, 2.1]), np.array([2.0, np.sqrt(0.5 + 0.09), np.sqrt((0.5 + 0.09) / 25 + 0.04)])
    assert (np.abs(grid.mean() - mean) < 0.1 * sd).all()
    np.testing.assert_allclose(samples.std(axis=0), sd, rtol=0.1)
    bend = np.polyfit(samples[:, 0], samples[:, 1], 2)
    np.testing.assert_allclose(bend, [1 / 8, 0.0, 0.0], atol=0.03)


@pytest.mark.parametrize("offset", [-1.5, -0.5, 0.0, 0.5, 1.5])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_density_cut_by_the_edge_of_the_box(axis: int, offset: float) -> None:
    """Cells that straddle the edge count by their share: else the mean is off by half a cell."""
    mean, sd = np.array([0.0, 0.0, 2.5]), np.array([0.7, 1.1, 0.2])
    mean[axis] = HIGH[axis] + offset * sd[axis]
    covariance = np.diag(sd**2)
    other = (axis + 1) % 3
    covariance[axis, other] = covariance[other, axis] = 0.6 * sd[axis] * sd[other]  # tilted against the edge
    grid = refine(lambda points: normal(mean, covariance, points), LOW, HIGH)
    samples = grid.samples(8192)
    exact = truncnorm(-np.inf, -offset, loc=mean[axis], scale=sd[axis])
    assert grid.mean()[axis] == pytest.approx(exact.mean(), abs=0.05 * exact.std())
    assert samples[:, axis].std() == pytest.approx(exact.std(), rel=0.05)
    assert (samples <= HIGH).all()
    assert (samples >= LOW).all()


def test_a_flat_density_fills_the_box() -> None:
    grid = refine(lambda points: np.zeros(len(points)), LOW, HIGH)
    samples = grid.samples(4096)
    np.testing.assert_allclose(grid.mean(), (LOW + HIGH) / 2, atol=1e-9)
    np.testing.assert_allclose(samples.std(axis=0), (HIGH - LOW) / np.sqrt(12), rtol=0.02)
    np.testing.assert_allclose(np.quantile(samples, 0.05, axis=0), LOW + 0.05 * (HIGH - LOW), atol=0.2)


def test_a_support_that_is_no_box() -> None:
    """A flat density on a ball: known mean and spread, and no sample outside."""

    def inside(points: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.asarray(((points - [1.0, 2.0, 2.5]) ** 2).sum(axis=1) <= 4.0)

    grid = refine(lambda points: np.zeros(len(points)), LOW, HIGH, support=inside)
    samples = grid.samples(4096)
    np.testing.assert_allclose(grid.mean(), [1.0, 2.0, 2.5], atol=0.05)
    np.testing.assert_allclose(samples.std(axis=0), 2.0 / np.sqrt(5), rtol=0.04)
    assert inside(samples).mean() > 0.999


def test_the_answer_is_far_finer_than_one_regular_grid() -> None:
    covariance = np.diag([0.01, 0.02, 0.01]) ** 2
    mean = np.array([3.14, -2.7, 1.7])
    found = refine(lambda points: normal(mean, covariance, points), LOW, HIGH).mean()
    assert (np.abs(found - mean) < 0.05 * np.sqrt(np.diag(covariance))).all()


def test_samples_are_the_same_every_time() -> None:
    grid = refine(banana, LOW, HIGH)
    np.testing.assert_array_equal(grid.samples(512), grid.samples(512))
    assert grid.samples(300).shape == (300, 3)
