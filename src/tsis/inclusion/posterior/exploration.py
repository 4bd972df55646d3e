"""Explore the posterior of an inclusion on a grid.

Diameter and modulus trade off along a curve of equal signal ``d**3 g(E)``. With ``d g(E)**(1/3)`` in place of the
diameter that curve becomes nearly a straight line, which a sheared grid can follow. A parabola along the modulus, of
signal diameter and depth, fitted to a coarse posterior, removes the remaining curvature.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.inclusion.posterior.grid import Grid, box_around, refine
from tsis.mechanics.surrogate.polynomial import contrast_factor

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.inclusion.posterior.grid import SlantedBox
    from tsis.inclusion.posterior.likelihood import InclusionLikelihood, LikelihoodFit, LinearisedLikelihood
    from tsis.inclusion.posterior.uneven_tissue import SuperficialLayer
    from tsis.inclusion.prior import Booleans, Floats, InclusionPrior


ROUNDING = 1e-9  # of a range: a grid's end at the prior's end counts as inside


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalChart:
    """Points (signal diameter, depth, modulus), each (n, 3), and back to inclusions (diameter, depth, modulus)."""

    prior: InclusionPrior  # ranges of the inclusions
    bend_mm: Floats  # correction of signal diameter and depth at both ends of the modulus's range, shape (2,)

    @property
    def low(self) -> Floats:
        """Lower corner of a box of points that contains the prior."""
        bend = np.append(np.maximum(self.bend_mm, 0.0), 0.0)
        return np.asarray(self.prior.low * np.array([self._stretch(self.prior.low[2]), 1.0, 1.0]) - bend)

    @property
    def high(self) -> Floats:
        """Upper corner of a box of points that contains the prior."""
        bend = np.append(np.minimum(self.bend_mm, 0.0), 0.0)
        return np.asarray(self.prior.high * np.array([self._stretch(self.prior.high[2]), 1.0, 1.0]) - bend)

    def inclusions(self, points: Floats) -> Floats:
        """Inclusions at ``points``."""
        straight = points[:, :2] + self._parabola(points[:, 2]) * self.bend_mm
        return np.column_stack(
            [straight[:, 0] / self._stretch(self._inside(points[:, 2])), straight[:, 1], points[:, 2]]
        )

    def points(self, inclusions: Floats) -> Floats:
        """Points of ``inclusions``."""
        straight = inclusions[:, :2] * np.column_stack([self._stretch(inclusions[:, 2]), np.ones(len(inclusions))])
        return np.column_stack([straight - self._parabola(inclusions[:, 2]) * self.bend_mm, inclusions[:, 2]])

    def straightened(self, inclusions: Floats, weight: Floats) -> SignalChart:
        """The chart with the best parabola along the modulus for weighted inclusions (n, 3)."""
        unbent = replace(self, bend_mm=np.zeros(2)).points(inclusions)
        turn = self._turn(unbent[:, 2])
        root = np.sqrt(weight)[:, None]
        basis = np.column_stack([np.ones_like(turn), turn, turn**2])
        factors, *_ = np.linalg.lstsq(root * basis, root * unbent[:, :2], rcond=None)
        return replace(self, bend_mm=factors[2])

    def allows(self, points: Floats) -> Booleans:
        """Mask of points inside the prior, shape (n,)."""
        inclusions = self.inclusions(points)
        margin = ROUNDING * (self.prior.high - self.prior.low)
        inside = (inclusions >= self.prior.low - margin) & (inclusions <= self.prior.high + margin)
        return np.asarray(inside.all(axis=1))

    def log_volume(self, points: Floats) -> Floats:
        """Log of the volume of inclusions per volume of points: the prior is uniform in inclusions."""
        return np.asarray(-np.log(self._stretch(self._inside(points[:, 2]))))

    def _stretch(self, young_kpa: Floats | float) -> Floats:
        return np.asarray(np.cbrt(contrast_factor(np.asarray(young_kpa) / self.prior.tissue_young_kpa)))

    def _inside(self, young_kpa: Floats) -> Floats:
        """Moduli clipped to the prior: corners of a grid may lie outside."""
        return np.clip(young_kpa, self.prior.low[2], self.prior.high[2])

    def _turn(self, young_kpa: Floats) -> Floats:
        """Position in the modulus's range, from -1 to 1."""
        low, high = self.prior.low[2], self.prior.high[2]
        return np.asarray((2 * young_kpa - low - high) / (high - low))

    def _parabola(self, young_kpa: Floats) -> Floats:
        return np.asarray(self._turn(young_kpa) ** 2)[:, None]


LINEARISATIONS = 3  # at most, before that of the result
CONVERGED = 0.3  # largest change of a nuisance, in its standard deviations, after which the next is quadratically small
CAUTIOUS = 1e-4  # of the most probable hypothesis: the improbable ones are left out of further searches
COARSE, CLOSE, CELLS = 12, 10, 16  # cells along an axis: first search, search near an earlier grid, result
LEFT = 0.1  # largest residual of a correction to the log likelihood
SMOOTHING = 1e-6  # samples may nearly coincide
CHUNK = 256  # inclusions whose likelihood is evaluated at a time
CHECKED, MOST_CHECKED = 64, 1024  # points at which the fast likelihood is compared: at first, before a spline's last
SAMPLES = 8192


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InclusionPosterior:
    """Posterior of an inclusion.

    Attributes
    ----------
    samples
        Equally weighted diameters, depths and moduli, shape (n, 3).
    middle
        The mean in the straight coordinates, shape (3,); the mean of the samples may lie off a curved ridge.
    fit
        The fit at the middle.
    log_bayes_factor
        Log of the evidence of an inclusion of the prior over that of tissue without inclusion.
    presence
        Probability of an inclusion.
    information
        Fisher information of the three parameters at the middle, shape (3, 3).
    layer
        What the frames tell of a superficial layer.
    """

    samples: Floats
    middle: Floats
    fit: LikelihoodFit
    log_bayes_factor: float
    presence: float
    information: Floats
    layer: SuperficialLayer


def explore_inclusion(likelihood: InclusionLikelihood, prior: InclusionPrior) -> InclusionPosterior:
    """Find the posterior."""
    chart, nuisance = SignalChart(prior=prior, bend_mm=np.zeros(2)), likelihood.start
    position, near, searched = (prior.low + prior.high) / 2, None, likelihood
    for _ in range(LINEARISATIONS):
        grid = _search(searched.near(position, nuisance), chart, COARSE, near, finest=1)
        inclusions = chart.inclusions(grid.cells.points)
        position, before = chart.inclusions(grid.mean()[None])[0], nuisance
        nuisance = likelihood.within(searched(position[None], nuisance, about=position).nuisance[0])
        chart = chart.straightened(inclusions, grid.weight)
        near = box_around(chart.points(inclusions), grid.log_density, grid.cells.edges)
        if likelihood.distance(before, nuisance) < CONVERGED:
            break
        searched = searched.narrowed(position, nuisance, least=CAUTIOUS)
    blank = _blank_evidence(likelihood)
    likelihood = likelihood.narrowed(position, nuisance)
    nearby = likelihood.near(position, nuisance)
    grid = _corrected(
        _search(nearby, chart, CELLS, near), partial(likelihood, nuisance=nuisance, about=position), nearby, chart
    )
    middle = chart.inclusions(grid.mean()[None])[0]
    log_volume = float(np.log(prior.high - prior.low).sum())
    log_bayes_factor = grid.log_integral - log_volume - blank
    fit, information = likelihood.with_information(middle, nuisance)
    return InclusionPosterior(
        samples=np.clip(chart.inclusions(grid.samples(SAMPLES)), prior.low, prior.high),
        middle=middle,
        fit=fit,
        log_bayes_factor=log_bayes_factor,
        presence=float(scipy.special.expit(scipy.special.logit(prior.presence) + log_bayes_factor)),
        information=information,
        layer=likelihood.layer(middle, nuisance),
    )


def _search(
    nearby: LinearisedLikelihood, chart: SignalChart, cells: int, near: SlantedBox | None, *, finest: int = 2
) -> Grid:
    """The grid of a fast likelihood, searched first ``near`` an earlier grid."""

    def density(points: Floats) -> Floats:
        return nearby(chart.inclusions(points)) + chart.log_volume(points)

    finder = COARSE if near is None else CLOSE
    return refine(
        density, chart.low, chart.high, support=chart.allows, per_axis=cells, finder=finder, near=near, finest=finest
    )


def _corrected(
    grid: Grid, likelihood: Callable[[Floats], LikelihoodFit], nearby: LinearisedLikelihood, chart: SignalChart
) -> Grid:
    """The grid with the difference to the exact likelihood, a parabola through comparisons at samples."""

    def missing(points: Floats) -> Floats:
        inclusions = chart.inclusions(points)
        parts = np.array_split(inclusions, max(1, len(inclusions) // CHUNK))
        return np.concatenate([likelihood(part).log_evidence for part in parts]) - nearby(inclusions)

    points = grid.samples(CHECKED)
    at_points = missing(points)
    middle, spread = points.mean(axis=0), points.std(axis=0)

    def parabola(at: Floats) -> Floats:
        x = (at - middle) / spread
        products = [x[:, i] * x[:, j] for i in range(3) for j in range(i, 3)]
        return np.column_stack([np.ones(len(x)), x, *products])

    factors, *_ = np.linalg.lstsq(parabola(points), at_points, rcond=None)
    if np.std(at_points - parabola(points) @ factors) > LEFT:
        return _interpolated(grid, missing, points, at_points)
    # Extrapolation beyond the samples is limited to the largest correction among them.
    correction = np.clip(parabola(grid.cells.points) @ factors, at_points.min(), at_points.max())
    return grid.with_density(grid.log_density + correction)


def _interpolated(grid: Grid, missing: Callable[[Floats], Floats], points: Floats, at_points: Floats) -> Grid:
    """The grid corrected by a spline, for wide posteriors that no parabola fits.

    The spline goes through samples of the grid that it corrected before, until it predicts those still to come. Where
    it never does, all cells are evaluated.
    """
    middle, spread = points.mean(axis=0), points.std(axis=0)
    while len(points) <= min(MOST_CHECKED, len(grid.cells.points) // 4):
        spline = scipy.interpolate.RBFInterpolator(
            (points - middle) / spread, at_points, kernel="cubic", degree=1, smoothing=SMOOTHING
        )
        correction = np.minimum(spline((grid.cells.points - middle) / spread), at_points.max())
        corrected = grid.with_density(grid.log_density + correction)
        further = corrected.samples(2 * len(points))[len(points) :]
        at_further = missing(further)
        wrong = at_further - spline((further - middle) / spread)
        if np.std(wrong) < LEFT:
            return corrected
        points, at_points = np.concatenate([points, further]), np.concatenate([at_points, at_further])
    return grid.with_density(grid.log_density + missing(grid.cells.points))


def _blank_evidence(likelihood: InclusionLikelihood) -> float:
    """Log evidence of tissue without inclusion."""
    fit = likelihood(None, likelihood.start)
    nuisance = likelihood.start
    for _ in range(LINEARISATIONS):
        before, nuisance = nuisance, likelihood.within(fit.nuisance[0])
        fit = likelihood(None, nuisance)
        if likelihood.distance(before, nuisance) < CONVERGED:
            break
    return float(fit.log_evidence[0])
