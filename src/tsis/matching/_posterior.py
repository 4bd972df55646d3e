"""Probabilities of the poses that the data allow, and what they say about any answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import logsumexp

from tsis.matching._pose_evidence import PoseEvidence, gaussian_kernel, unrelated_evidence
from tsis.matching._pose_search import PoseSearch, distinct, search_poses, settled
from tsis.matching._rotation import log_rotation_prior, rotation_deg

if TYPE_CHECKING:
    from tsis.matching._fit import Floats

TOLERANCE = 0.245  # 0.1 of the unit box, in root-mean-square radii of the transformed source
DUPLICATE = 0.02  # root-mean-square radii within which two maps are one
MOST_ALTERNATIVES = 12
LEAST_PROBABILITY = 1e-4
LARGEST_ODDS = 400.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FieldMap:
    """An affine map and a smooth displacement field."""

    affine: Floats  # shape (d + 1, d)
    control: Floats  # shape (c, d)
    weights: Floats  # shape (c, d)
    width: float

    def __call__(self, points: Floats, /) -> Floats:
        """Transform ``points``, shape (k, d)."""
        bent = gaussian_kernel(points, self.control, self.width) @ self.weights
        return np.asarray(self.affine[0] + points @ self.affine[1:] + bent)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """One of the poses that the data allow, in normalised coordinates."""

    move: FieldMap
    rotation_deg: float
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePosterior:
    """Maps with their log probabilities, and that of no relation between the sets."""

    search: PoseSearch
    maps: tuple[PoseEvidence, ...]  # by falling probability
    logs: Floats  # log probability of each map, shape (k,)
    unrelated: float  # log probability

    @property
    def best(self) -> PoseEvidence | None:
        """The most probable map; None where no map has enough partners."""
        return self.maps[0] if self.maps else None

    def move(self, found: PoseEvidence) -> FieldMap:
        """The map of normalised points."""
        return FieldMap(
            affine=found.affine, control=self.search.field.control, weights=found.kernel_weights, width=found.width
        )

    def log_odds(self, moved: Floats) -> float:
        """Log odds of the maps within the tolerance of moved points, shape (n, d), against all others."""
        if not self.maps:
            return -LARGEST_ODDS
        near = np.array([distance(item.moved, moved) <= TOLERANCE * _radius(moved) for item in self.maps])
        here = logsumexp(self.logs[near]) if near.any() else -math.inf
        others = logsumexp(np.append(self.logs[~near], self.unrelated))
        return float(np.clip(here - others, -LARGEST_ODDS, LARGEST_ODDS))

    def alternatives(self) -> tuple[Pose, ...]:
        """Poses that differ by more than the tolerance, by falling probability; the first is the best."""
        left = list(range(len(self.maps)))
        result: list[Pose] = []
        while left and len(result) < MOST_ALTERNATIVES:
            first = self.maps[left[0]]
            near = [k for k in left if distance(self.maps[k].moved, first.moved) <= TOLERANCE * _radius(first.moved)]
            probability = float(np.exp(logsumexp(self.logs[near])))
            if result and probability < LEAST_PROBABILITY:
                break
            result.append(
                Pose(
                    move=self.move(first),
                    rotation_deg=rotation_deg(first.affine[1:]),
                    probability=min(probability, 1.0),
                )
            )
            left = [k for k in left if k not in near]
        return tuple(sorted(result, key=lambda pose: -pose.probability))


def pose_posterior(
    source: Floats,
    target: Floats,
    *,
    rng: np.random.Generator,
    rotation_sd_deg: float | None = None,
    also: Floats | None = None,
) -> PosePosterior:
    """Posterior over the maps that a search finds, and over that of a given answer ``also``, shape (n, d).

    Sets are normalised, shapes (n, d) and (m, d). Without ``rotation_sd_deg`` the prior of `log_rotation_prior` holds.
    """
    search = PoseSearch.of(source, target)
    maps = search_poses(search, rng=rng)
    if also is not None and (given := settled(search, also)) is not None:
        maps.append(given)
    upright = [item for item in maps if np.linalg.det(item.affine[1:]) > 0]
    posterior = {
        id(item): item.log + log_rotation_prior(item.affine[1:], rotation_sd_deg)
        for item in distinct(upright, DUPLICATE)
    }
    chosen = sorted((item for item in upright if id(item) in posterior), key=lambda item: -posterior[id(item)])
    logs = np.array([posterior[id(item)] for item in chosen])
    unrelated = unrelated_evidence(target)
    total = logsumexp(np.append(logs, unrelated))
    return PosePosterior(search=search, maps=tuple(chosen), logs=logs - total, unrelated=float(unrelated - total))


def distance(moved: Floats, other: Floats) -> float:
    """Root-mean-square distance of two maps' points, shape (n, d)."""
    return float(np.sqrt(((moved - other) ** 2).sum(axis=1).mean()))


def _radius(points: Floats) -> float:
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
