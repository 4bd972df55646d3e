"""The grid's correction by the exact likelihood: a parabola, a spline, or the likelihood itself."""

from __future__ import annotations

from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.inclusion import InclusionPrior
from tsis.inclusion.posterior.exploration import CHECKED, SignalChart, _corrected, _search

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.posterior.grid import Grid

CHART = SignalChart(prior=InclusionPrior(), bend_mm=np.zeros(2))
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
