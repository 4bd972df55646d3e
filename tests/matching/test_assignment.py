"""The last step: stiffness against the marginal likelihood written out in full, partners against known ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import minimize_scalar
from scipy.stats import multivariate_normal

from tsis.matching._pairing import spacing
from tsis.matching._spline import SplineBasis, spline_basis
from tsis.matching._tprl import BENDINGS, assigned, interpolated, likeliest_bending

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


def _surprise(basis: SplineBasis, values: np.ndarray, bending: float) -> float:
    """Least negative log probability of what no affine map explains, over the variance of the errors."""
    blind = null_space(basis.design[:, basis.bent :].T)
    bends, seen = blind.T @ basis.design[:, : basis.bent], blind.T @ values
    shape = bends @ bends.T / bending + np.eye(len(bends))

    def negative(log_variance: float) -> float:
        place = multivariate_normal(np.zeros(len(shape)), np.exp(log_variance) * shape)
        return -float(np.sum(place.logpdf(seen.T)))

    return float(minimize_scalar(negative, bounds=(-30, 10), method="bounded", options={"xatol": 1e-8}).fun)


@pytest.mark.parametrize("dimension", [2, 3], ids=["plane", "space"])
@pytest.mark.parametrize("noise", [0.01, 0.1, 1.0])
def test_the_stiffness_has_the_largest_marginal_likelihood(dimension: int, noise: float) -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(25, dimension))
    values = points + np.sin(2 * points[:, ::-1]) + noise * rng.normal(size=points.shape)
    basis = spline_basis(points)
    chosen = likeliest_bending(basis.design, basis.bent, values)
    least = min(_surprise(basis, values, bending) for bending in BENDINGS)
    assert _surprise(basis, values, chosen) < least + 0.01  # nearly flat where there is hardly any noise


@pytest.mark.parametrize("ratio", [1e-4, 1e-2, 1.0])
def test_the_stiffness_that_made_the_values_is_found(ratio: float) -> None:
    rng = np.random.default_rng(2)
    basis = spline_basis(rng.normal(size=(150, 2)))
    coordinates = rng.normal(size=(basis.design.shape[1], 2))
    values = basis.design @ coordinates + np.sqrt(ratio) * rng.normal(size=(150, 2))
    assert ratio / 10 < likeliest_bending(basis.design, basis.bent, values) < ratio * 10


def test_an_affine_part_changes_no_stiffness() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(40, 2))
    values = np.sin(2 * points) + 0.1 * rng.normal(size=points.shape)
    basis = spline_basis(points)
    plain = likeliest_bending(basis.design, basis.bent, values)
    assert likeliest_bending(basis.design, basis.bent, values + points @ rng.normal(size=(2, 2)) + 5.0) == plain


def test_partners_one_to_one_mend_what_soft_pairs_leave(warped: Warped) -> None:
    basis, step = spline_basis(warped.source), spacing(warped.source)
    start = basis.coordinates(0.7 * warped.truth + 0.3 * warped.source, bending=1e-4)
    found = basis.design @ assigned(basis, start, warped.target, step)
    assert warped.rms(found) < 0.01 < warped.rms(basis.design @ start)


def test_false_partners_hardly_draw(warped: Warped) -> None:
    basis, step = spline_basis(warped.source), spacing(warped.source)
    start = basis.coordinates(warped.truth, bending=1e-4)
    kept = np.arange(len(warped.truth)) % 4 != 0
    stray = np.random.default_rng(0).uniform(-1.5, 1.5, (sum(kept) // 4, warped.truth.shape[1]))
    found = basis.design @ assigned(basis, start, np.vstack([warped.truth[kept], stray]), step)
    wrong = np.sqrt(np.sum((found - warped.truth) ** 2, axis=1))
    assert np.median(wrong[kept]) < 0.1 * step
    assert np.median(wrong[~kept]) < 0.2 * step


def test_without_partners_the_spline_stays(warped: Warped) -> None:
    basis, step = spline_basis(warped.source), spacing(warped.source)
    np.testing.assert_array_equal(assigned(basis, basis.rest, warped.target + 50.0, step), basis.rest)
    np.testing.assert_array_equal(interpolated(basis, basis.rest, warped.target + 50.0, step), basis.rest)


def test_partners_beyond_doubt_are_reached_and_noise_is_passed_by(warped: Warped) -> None:
    basis, step = spline_basis(warped.source), spacing(warped.source)
    smooth = basis.coordinates(warped.truth, bending=1e-2)
    reached = basis.design @ interpolated(basis, smooth, warped.target, step)
    assert warped.rms(reached) < 1e-4 < warped.rms(basis.design @ smooth)
    noisy = warped.target + 0.3 * step * np.random.default_rng(1).normal(size=warped.target.shape)
    np.testing.assert_array_equal(interpolated(basis, smooth, noisy, step), smooth)
