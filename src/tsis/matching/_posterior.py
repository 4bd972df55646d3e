"""Probabilities of the poses that the data allow, and what they say about any answer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import i0e, logsumexp

from tsis.matching._pose_evidence import PoseEvidence, gaussian_kernel, unrelated_evidence
from tsis.matching._pose_search import PoseSearch, distinct, search_poses, settled

if TYPE_CHECKING:
    from tsis.matching._fit import Floats

TOLERANCE = 0.245  # 0.1 of the unit box, in root-mean-square radii of the transformed source
DUPLICATE = 0.02  # root-mean-square radii within which two maps are one
MOST_ALTERNATIVES = 12
LEAST_PROBABILITY = 1e-4
LARGEST_ODDS = 400.0
UPRIGHT, UPRIGHT_SD_DEG = 0.8, 20.0  # default: this fraction of all pairs is the same way up, within so many degrees
WIDEST_DEG = 1000.0  # a standard deviation from which all rotations are equally likely


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


def log_rotation_prior(matrix: Floats, sd_deg: float | None) -> float:
    """Log density of the nearest rotation to a matrix, shape (d, d), over that of equally likely rotations.

    With ``sd_deg`` the angle has a von Mises distribution (in space: that of its exponent on all rotations) of this
    standard deviation. None is the default mixture: `UPRIGHT` within `UPRIGHT_SD_DEG`, else any rotation.

    Examples
    --------
    >>> round(log_rotation_prior(np.eye(2), 1000.0), 6)
    0.0
    """
    cosine = math.cos(math.radians(rotation_deg(matrix)))
    if sd_deg is None:
        upright = math.exp(_concentrated(cosine, UPRIGHT_SD_DEG, len(matrix)))
        return math.log(UPRIGHT * upright + 1 - UPRIGHT)
    return 0.0 if sd_deg >= WIDEST_DEG else _concentrated(cosine, sd_deg, len(matrix))


def rotation_deg(matrix: Floats) -> float:
    """Angle of the nearest rotation to a matrix, shape (d, d), in [0, 180]."""
    left, _, right = np.linalg.svd(matrix)
    trace = float(np.trace(left @ right))
    return math.degrees(math.acos(float(np.clip(trace / 2 if len(matrix) == 2 else (trace - 1) / 2, -1.0, 1.0))))


def _concentrated(cosine: float, sd_deg: float, dimension: int) -> float:
    concentration = 1 / math.radians(sd_deg) ** 2
    return concentration * (cosine - 1) - _log_normaliser(concentration, dimension)


@lru_cache(maxsize=32)
def _log_normaliser(concentration: float, dimension: int) -> float:
    """Log mean of ``exp(concentration (cos - 1))`` over all rotations."""
    if dimension == 2:
        return math.log(float(i0e(concentration)))
    angle = np.linspace(0, np.pi, 20_001)
    density = np.exp(concentration * (np.cos(angle) - 1)) * (1 - np.cos(angle)) / np.pi
    return math.log(float(np.trapezoid(density, angle)))
