"""Matching by shape contexts: known deformations, turns, outliers, and what must hold of any method."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tsis.errors import InputError
from tsis.matching import shape_context
from tsis.matching.shape_context import ANGLE_BINS, DISTANCE_BINS, INNER, OUTER, POLAR_BINS

if TYPE_CHECKING:
    from tests.matching.conftest import Warped


RNG = np.random.default_rng(0)


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


COORDINATE = st.floats(-3, 3, allow_nan=False).map(lambda x: round(x, 3))


def _turn(points: np.ndarray, angle: float) -> np.ndarray:
    """Points turned about z, from x towards y."""
    turned = points.copy()
    turned[:, 0] = np.cos(angle) * points[:, 0] - np.sin(angle) * points[:, 1]
    turned[:, 1] = np.sin(angle) * points[:, 0] + np.cos(angle) * points[:, 1]
    return turned


def _plain_counts(points: np.ndarray, axis: np.ndarray, scale: float) -> np.ndarray:
    """Neighbours in each bin, shape (n, distance, polar, angle)."""
    away = points[None, :, :] - points[:, None, :]
    length = np.linalg.norm(away, axis=2)
    angle = (np.arctan2(away[..., 1], away[..., 0]) - axis[:, None]) / (2 * np.pi) * ANGLE_BINS - 0.5
    # rings and latitudes count from the centre of the first bin
    ring = np.maximum(np.log2(np.maximum(length / scale, shape_context.SMALLEST) / INNER) + 0.5, 0.0)
    latitude, polar = np.zeros_like(length), 1
    if points.shape[1] == 3:
        polar = POLAR_BINS
        latitude = np.where(
            length > 0, (1 + away[..., 2] / np.maximum(length, shape_context.SMALLEST)) / 2 * polar, 0.0
        )
    return _radial_weight(ring, np.clip(latitude - 0.5, 0.0, polar - 1.0), angle, (DISTANCE_BINS, polar, ANGLE_BINS))


def _radial_weight(ring: np.ndarray, latitude: np.ndarray, angle: np.ndarray, bins: tuple[int, int, int]) -> np.ndarray:
    """Distribute each neighbour, shape (n, n), linearly among the nearest bins; a point is not its own neighbour."""
    counts = np.zeros((len(ring), *bins))
    row = np.broadcast_to(np.arange(len(ring))[:, None], ring.shape)
    for corner in np.ndindex(2, 2, 2):
        weight = 1.0 - np.eye(len(ring))
        positions = []
        for at, up in zip((ring, latitude, angle), corner, strict=True):
            low = np.floor(at)
            weight *= at - low if up else 1 - at + low
            positions.append(low.astype(int) + up)
        inside = (positions[0] < bins[0]) & (positions[1] < bins[1])
        where = row[inside], positions[0][inside], positions[1][inside], positions[2][inside] % bins[2]
        np.add.at(counts, where, weight[inside])
    return counts


@given(
    st.sampled_from([2, 3]).flatmap(
        lambda d: arrays(float, st.tuples(st.integers(2, 12), st.just(d)), elements=COORDINATE)
    ),
    st.floats(-7, 7),
    st.floats(0.1, 10),
)
def test_compiled_counts_equal_plain_ones(points: np.ndarray, turn: float, scale: float) -> None:
    axis = turn + np.arange(len(points)) / 3
    fast, plain = shape_context._counts(points, axis, scale), _plain_counts(points, axis, scale)
    np.testing.assert_allclose(fast, plain, atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_chi_squared_equals_its_formula(dimension: int) -> None:
    rng = np.random.default_rng(1)
    a = shape_context.histograms(rng.normal(size=(30, dimension)))
    b = shape_context.histograms(rng.normal(size=(40, dimension)))
    total = a[:, None] + b[None]
    formula = 0.5 * np.sum(np.divide((a[:, None] - b[None]) ** 2, total, out=np.zeros_like(total), where=total > 0), 2)
    cost = shape_context.chi_squared(a, b)
    np.testing.assert_allclose(cost, formula, atol=1e-12)
    assert 0 <= cost.min() <= cost.max() <= 1 + 1e-12
    np.testing.assert_allclose(np.diag(shape_context.chi_squared(a, a)), 0, atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_twelfth_of_a_turn_shifts_the_angle_bins(dimension: int) -> None:
    points = np.random.default_rng(2).normal(size=(25, dimension))
    step = 2 * np.pi / ANGLE_BINS
    bins = shape_context.histograms(points).reshape(25, DISTANCE_BINS, -1, ANGLE_BINS)
    shifted = np.roll(bins, 2, axis=-1).reshape(25, -1)
    np.testing.assert_allclose(shape_context.histograms(_turn(points, 2 * step)), shifted, atol=1e-9)
    np.testing.assert_allclose(shape_context.histograms(points, turn=-2 * step), shifted, atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_neither_size_nor_place_matters(dimension: int) -> None:
    points = np.random.default_rng(3).normal(size=(25, dimension))
    found = shape_context.histograms(7.5 * points - 30)
    np.testing.assert_allclose(found, shape_context.histograms(points), atol=1e-9)


@pytest.mark.parametrize(("ring", "sector"), [(0, 0), (2, 5), (4, 11)])
def test_a_neighbour_at_the_centre_of_a_bin_is_counted_there_alone(ring: int, sector: int) -> None:
    distance, angle = INNER * 2 ** (ring - 0.5), (sector + 0.5) * 2 * np.pi / ANGLE_BINS
    points = np.array([[0.0, 0.0], [distance * np.cos(angle), distance * np.sin(angle)]])
    bins = shape_context.histograms(points, scale=1.0)[0].reshape(DISTANCE_BINS, ANGLE_BINS)
    assert bins[ring, sector] == pytest.approx(1.0, abs=1e-9)


def test_points_far_away_are_not_counted() -> None:
    points = np.array([[0.0, 0.0], [1.5 * OUTER, 0.0]])
    assert shape_context.histograms(points, scale=1.0).sum() == 0
    np.testing.assert_allclose(
        shape_context.histograms([*points.tolist(), [0.1, 0.1]], scale=1.0).sum(axis=1), [1, 0, 1]
    )


@pytest.mark.parametrize("points", [[[1.0, 2.0]], [[1.0, 2.0]] * 4, [[1.0], [2.0]]])
def test_points_without_a_scale_or_a_plane_are_refused(points: list[list[float]]) -> None:
    with pytest.raises(InputError):
        shape_context.histograms(points)
