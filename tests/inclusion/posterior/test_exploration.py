"""The chart that straightens a posterior, and the grid's correction by parabola, spline or likelihood itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.exploration import CHECKED, SignalChart, _corrected, _search
from tsis.mechanics.surrogate.polynomial import contrast_factor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.posterior.grid import Grid

PRIOR, BEND = InclusionPrior(), np.zeros(2)
CHART = SignalChart(prior=PRIOR, bend_mm=BEND)
MIDDLE, SD = np.array([9.0, 7.0, 80.0]), np.array([0.5, 0.4, 8.0])


def nearby(inclusions: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(-(((inclusions - MIDDLE) / SD) ** 2).sum(axis=1) / 2)


class Exact:
    """The fast likelihood plus a difference that depends on the place in the chart."""

    def __init__(self, difference: Any) -> None:
        self.difference, self.evaluated = difference, 0

    def __call__(self, inclusions: NDArray[np.float64]) -> SimpleNamespace:
        self.evaluated += len(inclusions)
        return SimpleNamespace(log_evidence=nearby(inclusions) + self.difference(CHART.points(inclusions)))


@pytest.fixture(scope="module")
def grid() -> Grid:
    fast: Any = nearby
    return _search(fast, CHART, 12, None)


def scaled(grid: Grid, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates in sd of the grid's samples."""
    samples = grid.samples(CHECKED)
    return np.asarray((points - samples.mean(axis=0)) / samples.std(axis=0))


def test_a_parabola_is_recovered_and_not_extrapolated(grid: Grid) -> None:
    curve = np.array([[0.2, 0.3, -0.1], [0.3, -0.4, 0.2], [-0.1, 0.2, 0.1]])

    def difference(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x = scaled(grid, points)
        return np.asarray(0.7 + x @ [0.1, -0.3, 0.2] + np.einsum("ni,ij,nj->n", x, curve, x))

    exact: Any = Exact(difference)
    fast: Any = nearby
    found = _corrected(grid, exact, fast, CHART)
    met, everywhere = difference(grid.samples(CHECKED)), difference(grid.cells.points)
    assert everywhere.max() > met.max() + 0.1, "some cells lie beyond every sample"
    np.testing.assert_allclose(
        found.log_density - grid.log_density, np.clip(everywhere, met.min(), met.max()), atol=1e-8
    )
    assert exact.evaluated == CHECKED


def test_where_no_parabola_fits_a_spline_does(grid: Grid) -> None:
    """A ridge bent by the difference: a fifth of the cells are evaluated, and no probability moves far."""

    def difference(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x = scaled(grid, points)
        return np.asarray(-2 * (x[:, 0] - np.tanh(x[:, 1])) ** 2 + 3 * np.cos(x[:, 2]))

    exact: Any = Exact(difference)
    fast: Any = nearby
    found = _corrected(grid, exact, fast, CHART)
    everywhere = grid.with_density(grid.log_density + difference(grid.cells.points))
    assert np.abs(grid.weight - everywhere.weight).sum() / 2 > 0.4
    assert np.abs(found.weight - everywhere.weight).sum() / 2 < 0.05
    assert found.log_integral == pytest.approx(everywhere.log_integral, abs=0.05)
    assert CHECKED < exact.evaluated < len(grid.cells.points) / 2


def test_where_nothing_smooth_fits_every_cell_is_evaluated(grid: Grid) -> None:
    def difference(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.sin(9 * scaled(grid, points)).sum(axis=1))

    exact: Any = Exact(difference)
    fast: Any = nearby
    found = _corrected(grid, exact, fast, CHART)
    np.testing.assert_allclose(found.log_density - grid.log_density, difference(grid.cells.points), atol=1e-8)
    assert exact.evaluated >= CHECKED + len(grid.cells.points)


INCLUSIONS = st.tuples(st.floats(1.0, 15.0), st.floats(4.0, 12.0), st.floats(40.0, 120.0))


@given(inclusion=INCLUSIONS)
def test_points_of_the_chart_are_inclusions_of_equal_signal(inclusion: tuple[float, float, float]) -> None:
    diameter, depth, young = inclusion
    signal = diameter * np.cbrt(contrast_factor(young / 5.0))
    point = np.array([[signal, depth, young]])
    np.testing.assert_allclose(CHART.inclusions(point), [inclusion], rtol=1e-12)
    assert (point >= CHART.low * (1 - 1e-12)).all()
    assert (point <= CHART.high * (1 + 1e-12)).all()


@given(inclusion=INCLUSIONS)
def test_the_chart_keeps_the_prior_uniform(inclusion: tuple[float, float, float]) -> None:
    """The volume factor is the determinant of the map, here by finite differences."""
    diameter, depth, young = inclusion
    point = np.array([diameter * np.cbrt(contrast_factor(young / 5.0)), depth, np.clip(young, 40.01, 119.99)])
    step = 1e-5
    rows = [(CHART.inclusions((point + e)[None]) - CHART.inclusions((point - e)[None]))[0] for e in step * np.eye(3)]
    determinant = np.linalg.det(np.array(rows) / (2 * step))
    assert np.exp(CHART.log_volume(point[None])[0]) == pytest.approx(determinant, rel=1e-5)


@given(inclusion=INCLUSIONS, bend=st.tuples(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0)))
def test_a_bent_chart_is_undone_and_keeps_volumes(
    inclusion: tuple[float, float, float], bend: tuple[float, float]
) -> None:
    straight, bent = (SignalChart(prior=PRIOR, bend_mm=np.array(each)) for each in (BEND, bend))
    row = np.array([inclusion])
    np.testing.assert_allclose(bent.inclusions(bent.points(row)), row, rtol=1e-12)
    point = bent.points(row)
    assert (point >= bent.low - 1e-9).all()
    assert (point <= bent.high + 1e-9).all()
    assert bent.allows(point).all()
    assert bent.log_volume(point)[0] == pytest.approx(straight.log_volume(straight.points(row))[0], rel=1e-12)


def test_a_chart_straightens_a_parabola() -> None:
    """Points on a known parabola along the modulus come out on a line."""
    rng = np.random.default_rng(1)
    bent = SignalChart(prior=PRIOR, bend_mm=np.array([0.6, -0.4]))
    young = rng.uniform(40.0, 120.0, 200)
    line = np.column_stack([8.0 + 0.01 * young, 6.0 - 0.005 * young, young])
    found = CHART.straightened(bent.inclusions(line), np.full(200, 1 / 200))
    np.testing.assert_allclose(found.bend_mm, bent.bend_mm, atol=1e-9)


def test_the_chart_knows_where_the_prior_ends() -> None:
    stretch = np.cbrt(contrast_factor(80.0 / 5.0))
    points = np.array(
        [[10 * stretch, 5.0, 80.0], [16 * stretch, 5.0, 80.0], [10 * stretch, 3.9, 80.0], [9.0, 5.0, 121.0]]
    )
    assert CHART.allows(points).tolist() == [True, False, False, False]
