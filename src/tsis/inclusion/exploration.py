"""Where the posterior of an inclusion lies, how much evidence there is for one, and how much there could be.

The search uses a likelihood whose derivatives by the nuisances are those at one place. It is moved to where the
posterior is, and what is left of the difference to the likelihood that is linearised at every inclusion is a parabola.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import expit, logit

from tsis.inclusion.chart import SignalChart
from tsis.inclusion.grid import Grid, box_around, refine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.grid import SlantedBox
    from tsis.inclusion.likelihood import InclusionLikelihood, LikelihoodFit, LinearisedLikelihood
    from tsis.inclusion.prior import InclusionPrior

LINEARISATIONS = 2  # before that of the answer
COARSE, CLOSE, CELLS = 12, 10, 16  # along each axis: anywhere, where a look was before, and in the answer
LEFT = 0.1  # of the log likelihood that a parabola may miss
CHUNK = 256  # inclusions whose likelihood is evaluated at a time
CHECKED = 64  # places at which the fast likelihood is compared
SAMPLES = 8192


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InclusionPosterior:
    """What frames tell about an inclusion.

    Attributes
    ----------
    samples
        Equally weighted diameters, depths and moduli, shape (n, 3).
    middle
        The mean in coordinates in which the posterior is straight, shape (3,); that of the samples may lie beside a
        bent ridge.
    fit
        The fit at the middle.
    log_bayes_factor
        Log of how much better inclusions of the prior explain the frames than plain tissue does.
    presence
        Probability that there is an inclusion at all.
    information
        Fisher information of the three at the middle, shape (3, 3).
    """

    samples: NDArray[np.float64]
    middle: NDArray[np.float64]
    fit: LikelihoodFit
    log_bayes_factor: float
    presence: float
    information: NDArray[np.float64]


def explore_inclusion(likelihood: InclusionLikelihood, prior: InclusionPrior) -> InclusionPosterior:
    """Find the posterior."""
    chart, nuisance = SignalChart(prior=prior, bend_mm=np.zeros(2)), likelihood.start
    place, near = (prior.low + prior.high) / 2, None
    for _ in range(LINEARISATIONS):
        grid = _search(likelihood.near(place, nuisance), chart, COARSE, near, finest=1)
        inclusions = chart.inclusions(grid.cells.points)
        place = chart.inclusions(grid.mean()[None])[0]
        nuisance = likelihood.within(likelihood(place[None], nuisance).nuisance[0])
        chart = chart.straightened(inclusions, grid.weight)
        near = box_around(chart.points(inclusions), grid.log_density, grid.cells.edges)
    nearby = likelihood.near(place, nuisance)
    grid = _corrected(_search(nearby, chart, CELLS, near), likelihood, nearby, chart, nuisance)
    middle = chart.inclusions(grid.mean()[None])[0]
    log_volume = float(np.log(prior.high - prior.low).sum())
    log_bayes_factor = grid.log_integral - log_volume - _plain_evidence(likelihood)
    fit, information = likelihood.with_information(middle, nuisance)
    return InclusionPosterior(
        samples=np.clip(chart.inclusions(grid.samples(SAMPLES)), prior.low, prior.high),
        middle=middle,
        fit=fit,
        log_bayes_factor=log_bayes_factor,
        presence=float(expit(logit(prior.presence) + log_bayes_factor)),
        information=information,
    )


def _search(
    nearby: LinearisedLikelihood, chart: SignalChart, cells: int, near: SlantedBox | None, *, finest: int = 2
) -> Grid:
    """The grid of a fast likelihood, looked for first where it was ``near``."""

    def density(points: NDArray[np.float64]) -> NDArray[np.float64]:
        return nearby(chart.inclusions(points)) + chart.log_volume(points)

    finder = COARSE if near is None else CLOSE
    return refine(
        density, chart.low, chart.high, support=chart.allows, per_axis=cells, finder=finder, near=near, finest=finest
    )


def _corrected(
    grid: Grid,
    likelihood: InclusionLikelihood,
    nearby: LinearisedLikelihood,
    chart: SignalChart,
    nuisance: NDArray[np.float64],
) -> Grid:
    """The grid with the difference to the exact likelihood, a parabola through comparisons at samples."""
    points = grid.samples(CHECKED)
    inclusions = chart.inclusions(points)
    missing = likelihood(inclusions, nuisance).log_evidence - nearby(inclusions)
    middle, spread = points.mean(axis=0), points.std(axis=0)

    def parabola(at: NDArray[np.float64]) -> NDArray[np.float64]:
        x = (at - middle) / spread
        products = [x[:, i] * x[:, j] for i in range(3) for j in range(i, 3)]
        return np.column_stack([np.ones(len(x)), x, *products])

    factors, *_ = np.linalg.lstsq(parabola(points), missing, rcond=None)
    if np.std(missing - parabola(points) @ factors) > LEFT:
        return _exact(grid, likelihood, chart, nuisance)
    # Where no sample fell a parabola is a guess: it must not say more than was met.
    met = np.clip(parabola(grid.cells.points) @ factors, missing.min(), missing.max())
    return grid.with_density(grid.log_density + met)


def _exact(grid: Grid, likelihood: InclusionLikelihood, chart: SignalChart, nuisance: NDArray[np.float64]) -> Grid:
    """The grid under the exact likelihood, for posteriors so wide that no parabola fits; a tenth of a second."""
    points = grid.cells.points
    inclusions = chart.inclusions(points)
    parts = np.array_split(inclusions, max(1, len(inclusions) // CHUNK))
    log_evidence = np.concatenate([likelihood(part, nuisance).log_evidence for part in parts])
    return grid.with_density(log_evidence + chart.log_volume(points))


def _plain_evidence(likelihood: InclusionLikelihood) -> float:
    """Log evidence of plain tissue."""
    fit = likelihood(None, likelihood.start)
    for _ in range(LINEARISATIONS):
        fit = likelihood(None, likelihood.within(fit.nuisance[0]))
    return float(fit.log_evidence[0])
