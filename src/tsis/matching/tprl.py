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
from tsis.matching.evidence import log_evidence
from tsis.matching.fit import Fit
from tsis.matching.one_to_one import nearest_pairs, spacing
from tsis.matching.poses import poses, rounded_poses
from tsis.matching.spline import spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.poses import Pose
    from tsis.matching.spline import SplineBasis

POSES = 3  # that are followed, the best agreed on, unless
SAME = 0.15  # a pose moves points as one before it does, within so many root-mean-square radii
FACTOR, ROUNDS = 0.85, 3
WARM = 0.15  # temperature from which a pose is followed
COLDEST = 0.35  # last standard deviation, of the distance between neighbours
PLAIN = 2.0  # log evidence a target point from which neither the unturned start nor rounded shapes are tried besides
ASSIGNED = 2  # of the annealed starts, by evidence, get partners one to one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """A spline's coordinates, and its log evidence."""

    coordinates: NDArray[np.float64]
    evidence: float


def fit(source: NDArray[np.float64], target: NDArray[np.float64], /, *, rng: np.random.Generator) -> Fit:
    """Match normalised points, shapes (n, d) and (m, d); ``rng`` draws the pairs that poses are tried on."""
    basis = spline_basis(source)
    step = max(spacing(source), spacing(target))

    def judged(coordinates: NDArray[np.float64]) -> Found:
        return Found(coordinates=coordinates, evidence=log_evidence(basis, coordinates, target))

    def followed(coordinates: NDArray[np.float64], start: float) -> Found:
        cooling = Cooling(factor=FACTOR, start=start, end=(COLDEST * step) ** 2, rounds=ROUNDS)
        return judged(anneal(basis, coordinates, target, cooling))

    enough = PLAIN * len(target)
    found = [followed(start, WARM) for start in _starts(basis, poses(source, target, rng=rng))]
    if max(one.evidence for one in found) < enough:
        found.append(followed(basis.rest, START))
    if max(one.evidence for one in found) < enough:
        found += [followed(start, WARM) for start in _starts(basis, rounded_poses(source, target, rng=rng))]
    found.sort(key=lambda one: -one.evidence)
    found += [judged(assigned(basis, one.coordinates, target, step)) for one in found[:ASSIGNED]]
    best = max(found, key=lambda one: one.evidence).coordinates
    best = interpolated(basis, best, target, step)
    matches, trust = nearest_pairs(basis.design @ best, target, tolerance=step)
    return Fit(move=basis.spline(best), matches=matches, trust=trust)


def _starts(basis: SplineBasis, found: list[Pose]) -> list[NDArray[np.float64]]:
    """Coordinates of the best poses, none of them much like another."""
    starts: list[NDArray[np.float64]] = []
    placed: list[NDArray[np.float64]] = []
    for pose in found[:POSES]:
        start = np.zeros_like(basis.rest)
        start[basis.bent :] = pose.affine
        moved = basis.design @ start
        if all(((moved - other) ** 2).sum(axis=1).mean() > SAME**2 for other in placed):
            starts.append(start)
            placed.append(moved)
    return starts
