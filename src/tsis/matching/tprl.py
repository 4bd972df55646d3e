"""Topology-preserving relaxation labelling, corrected.

Labelled neighbourhoods give poses (`poses`), from each of which soft pairs harden into one to one (`annealing`) and
become partners (`assignment`); the evidence says which pose was right. The printed method labels with all angles
measured from the mass centre, and alternates that with splines. Here labelling decides what it can: which way round the
shapes belong together. What follows sees distances only, and is not led astray by labels that noise, clutter or missing
parts made.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.matching.annealing import START, Cooling, anneal
from tsis.matching.assignment import assigned, interpolated
from tsis.matching.evidence import log_evidence, upright_prior
from tsis.matching.fit import MatchFit
from tsis.matching.one_to_one import nearest_pairs, spacing
from tsis.matching.poses import MANY, poses, rounded_poses
from tsis.matching.spline import spline_basis

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from tsis.matching.poses import Pose
    from tsis.matching.spline import SplineBasis

POSES = {2: 2, 3: 6}  # of each kind that are followed, the best agreed on, by dimension; of very many points one
SAME = 0.15  # a pose moves points as one before it does, within so many root-mean-square radii
FACTOR, ROUNDS = 0.85, 3
WARM = 0.15  # temperature from which a pose is followed
COLDEST = 0.35  # last standard deviation, of the distance between neighbours
VAGUE = 0.3  # agreement below which no pose at all is tried first
ENOUGH = {2: 2.0, 3: 5.0}  # log evidence a target point that ends the search, by dimension


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseFit:
    """A spline's coordinates, and the evidence for it, with the prior of its pose."""

    coordinates: NDArray[np.float64]
    evidence: float


def fit(source: NDArray[np.float64], target: NDArray[np.float64], /, *, rng: np.random.Generator) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d); ``rng`` draws the pairs that poses are tried on."""
    basis = spline_basis(source)
    step = max(spacing(source), spacing(target))

    def judged(coordinates: NDArray[np.float64]) -> PoseFit:
        prior = upright_prior(coordinates[basis.bent + 1 :], len(target))
        return PoseFit(coordinates=coordinates, evidence=prior + log_evidence(basis, coordinates, target))

    def followed(coordinates: NDArray[np.float64], start: float) -> PoseFit:
        cooling = Cooling(factor=FACTOR, start=start, end=(COLDEST * step) ** 2, rounds=ROUNDS)
        cooled = judged(anneal(basis, coordinates, target, cooling))
        paired = judged(assigned(basis, cooled.coordinates, target, step))
        return max(cooled, paired, key=lambda one: one.evidence)

    found: list[PoseFit] = []
    for coordinates, start in _starts(basis, source, target, rng):
        found.append(followed(coordinates, start))
        if found[-1].evidence >= ENOUGH[source.shape[1]] * len(target):
            break
    best = max(found, key=lambda one: one.evidence).coordinates
    best = interpolated(basis, best, target, step)
    matches, trust = nearest_pairs(basis.design @ best, target, tolerance=step)
    return MatchFit(move=basis.spline(best), matches=matches, trust=trust)


def _starts(
    basis: SplineBasis, source: NDArray[np.float64], target: NDArray[np.float64], rng: np.random.Generator
) -> Iterator[tuple[NDArray[np.float64], float]]:
    """Coordinates to begin with and their temperatures.

    The best poses and no pose at all, the latter first where poses are vague; then the best poses of rounded shapes.
    """
    found = poses(source, target, rng=rng)
    many = len(source) * len(target) >= MANY
    if found[0].agreement < VAGUE:
        yield basis.rest, START
    yield from ((start, WARM) for start in _unlike(basis, found[: 1 if many else POSES[source.shape[1]]]))
    if found[0].agreement >= VAGUE:
        yield basis.rest, START
    if not many:
        rounded = rounded_poses(source, target, rng=rng)
        yield from ((start, WARM) for start in _unlike(basis, rounded[: POSES[source.shape[1]]]))


def _unlike(basis: SplineBasis, found: list[Pose]) -> Iterator[NDArray[np.float64]]:
    """Coordinates of poses, leaving out those much like one before."""
    placed: list[NDArray[np.float64]] = []
    for pose in found:
        start = np.zeros_like(basis.rest)
        start[basis.bent :] = pose.affine
        moved = basis.design @ start
        if all(((moved - other) ** 2).sum(axis=1).mean() > SAME**2 for other in placed):
            placed.append(moved)
            yield start
