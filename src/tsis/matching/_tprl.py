"""Topology-preserving relaxation labelling: poses, annealing, one-to-one pairs and a spline of estimated stiffness."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist

from tsis.matching._annealing import START, Cooling, anneal
from tsis.matching._evidence import log_evidence, upright_prior
from tsis.matching._fit import UNMATCHED, Floats, MatchFit
from tsis.matching._pairing import assign, nearest_pairs, spacing
from tsis.matching._poses import MANY, poses, whitened_poses
from tsis.matching._spline import spline_basis

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.matching._poses import Pose
    from tsis.matching._spline import SplineBasis


SCALES = (0.5, 0.3, 0.18, 0.1, 0.0)  # successive largest distances of a pair, at least NEAREST spacings
NEAREST = 1.5
SPREADS = 4.0  # standard deviations beyond which a pair is rejected
CERTAIN_DISTANCE = 0.2  # root-mean-square distance of partners, of the spacing, below which pairs are unambiguous
BENDINGS = np.logspace(-7, 2, 28)


def assigned(basis: SplineBasis, coordinates: Floats, target: Floats, spacing: float) -> Floats:
    """Coordinates of the spline through one-to-one pairs, from those of an approximate spline.

    One-to-one pairs of the least sum of squares correct points that slid along a line under soft pairs.
    """
    for extent in SCALES:
        transformed = basis.design @ coordinates
        squared = cdist(transformed, target, "sqeuclidean")
        pairs = assign(squared, dummy=max(extent, NEAREST * spacing) ** 2)
        rows = np.flatnonzero(pairs != UNMATCHED)
        if len(rows) <= 2 * basis.points.shape[1] + 2:
            return coordinates
        for _ in range(2):
            bending = likeliest_bending(basis.design[rows], basis.bent, target[pairs[rows]])
            coordinates = basis.at(rows).coordinates(target[pairs[rows]], bending=bending)
            away = ((basis.design[rows] @ coordinates - target[pairs[rows]]) ** 2).sum(axis=1)
            selected = away <= SPREADS**2 * max(float(np.median(away)), 1e-8)
            if selected.all() or selected.sum() <= 2 * basis.points.shape[1] + 2:
                break
            rows = rows[selected]
    return coordinates


def interpolated(basis: SplineBasis, coordinates: Floats, target: Floats, spacing: float) -> Floats:
    """Coordinates of the interpolating spline where the pairs are unambiguous; else the given coordinates.

    A residual is noise or fine deformation, which the points do not distinguish. Where it is small against the spacing,
    the partner is the better estimate of the position.
    """
    squared = cdist(basis.design @ coordinates, target, "sqeuclidean")
    pairs = assign(squared, dummy=(NEAREST * spacing) ** 2)
    rows = np.flatnonzero(pairs != UNMATCHED)
    away = squared[rows, pairs[rows]]
    if len(rows) <= basis.points.shape[1] or np.mean(away) > (CERTAIN_DISTANCE * spacing) ** 2:
        return coordinates
    return basis.at(rows).coordinates(target[pairs[rows]], bending=BENDINGS[0])


def likeliest_bending(design: Floats, bent: int, values: Floats) -> float:
    """Restricted-maximum-likelihood ridge on the bending coordinates for values of shape (n, d).

    Bending coordinates and errors are normal, each with one variance, and the affine part is free; the ridge is the
    ratio of the variances.
    """
    affine, _ = np.linalg.qr(design[:, bent:])
    bends = design[:, :bent] - affine @ (affine.T @ design[:, :bent])
    values = values - affine @ (affine.T @ values)
    # The eigenvalues of the small normal matrix are the squared singular values.
    strength, axes = np.linalg.eigh(bends.T @ bends)
    strength = np.maximum(strength, 1e-14 * strength[-1])
    along = (axes.T @ (bends.T @ values)) ** 2 / strength[:, None]
    beyond = max(float((values**2).sum() - along.sum()), 0.0)
    free = (len(values) - affine.shape[1]) * values.shape[1]
    spread = strength[None, :] / BENDINGS[:, None] + 1
    variance = ((along.sum(axis=1) / spread).sum(axis=1) + beyond) / free + 1e-12
    surprise = values.shape[1] * np.log(spread).sum(axis=1) + free * np.log(variance)
    return float(BENDINGS[int(np.argmin(surprise))])


POSES = {2: 2, 3: 6}  # best poses of each kind that are refined, by dimension; of very many points one
SAME = 0.15  # root-mean-square radii: largest distance of two poses that count as equal
FACTOR, ROUNDS = 0.85, 3
WARM = 0.15  # initial temperature of a pose
COLDEST = 0.35  # last standard deviation, of the distance between neighbours
VAGUE = 0.3  # agreement below which the identity is tried first
ENOUGH = {2: 2.0, 3: 5.0}  # log evidence per target point that ends the search, by dimension


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseFit:
    """A spline's coordinates, and its evidence with the prior of its pose."""

    coordinates: Floats
    evidence: float


def fit(source: Floats, target: Floats, /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d); ``rng`` draws the samples of the pose consensus."""
    basis = spline_basis(source)
    step = max(spacing(source), spacing(target))

    def rated(coordinates: Floats) -> PoseFit:
        prior = upright_prior(coordinates[basis.bent + 1 :], len(target))
        return PoseFit(coordinates=coordinates, evidence=prior + log_evidence(basis, coordinates, target))

    def refined(coordinates: Floats, start: float) -> PoseFit:
        cooling = Cooling(factor=FACTOR, start=start, end=(COLDEST * step) ** 2, rounds=ROUNDS)
        cooled = rated(anneal(basis, coordinates, target, cooling))
        paired = rated(assigned(basis, cooled.coordinates, target, step))
        return max(cooled, paired, key=lambda item: item.evidence)

    fits: list[PoseFit] = []
    for coordinates, start in _starts(basis, source, target, rng):
        fits.append(refined(coordinates, start))
        if fits[-1].evidence >= ENOUGH[source.shape[1]] * len(target):
            break
    best = max(fits, key=lambda item: item.evidence).coordinates
    best = interpolated(basis, best, target, step)
    matches, trust = nearest_pairs(basis.design @ best, target, tolerance=step)
    return MatchFit(move=basis.spline(best), matches=matches, trust=trust)


def _starts(
    basis: SplineBasis, source: Floats, target: Floats, rng: np.random.Generator
) -> Iterator[tuple[Floats, float]]:
    """Initial coordinates and temperatures: the best poses and the identity, then the best poses of whitened sets."""
    result = poses(source, target, rng=rng)
    many = len(source) * len(target) >= MANY
    if result[0].agreement < VAGUE:
        yield basis.rest, START
    yield from ((start, WARM) for start in _distinct(basis, result[: 1 if many else POSES[source.shape[1]]]))
    if result[0].agreement >= VAGUE:
        yield basis.rest, START
    if not many:
        whitened = whitened_poses(source, target, rng=rng)
        yield from ((start, WARM) for start in _distinct(basis, whitened[: POSES[source.shape[1]]]))


def _distinct(basis: SplineBasis, poses: list[Pose]) -> Iterator[Floats]:
    """Coordinates of the poses that differ from those before them."""
    earlier: list[Floats] = []
    for pose in poses:
        start = np.zeros_like(basis.rest)
        start[basis.bent :] = pose.affine
        transformed = basis.design @ start
        if all(((transformed - other) ** 2).sum(axis=1).mean() > SAME**2 for other in earlier):
            earlier.append(transformed)
            yield start
