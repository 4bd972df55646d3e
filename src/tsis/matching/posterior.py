"""Probabilities of the poses that the data allow, and trust in an answer.

The posterior over poses is a model's; it does not know of the poses that a search missed, nor of deformations that its
prior does not hold. A logistic regression on its log odds turns it into a frequency.
`benchmarks.matching.trust --calibrate` fits the weights and the thresholds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import fused
from tsis.matching.methods import UNMATCHED, MatchFit, assign, nearest_pairs
from tsis.matching.pose_evidence import PoseEvidence, gaussian_kernel, size_and_stretch, unrelated_evidence
from tsis.matching.pose_search import PoseSearch, distinct, search_poses, settled
from tsis.matching.refinement import MANY_PAIRS
from tsis.matching.spline import spline_basis

if TYPE_CHECKING:
    from tsis.matching.methods import Booleans, Floats, Move
    from tsis.matching.spline import ThinPlateSpline


TOLERANCE = 0.245  # 0.1 of the unit box, in root-mean-square radii of the transformed source
DUPLICATE = 0.02  # root-mean-square radii within which two maps are one
MOST_ALTERNATIVES = 12
LEAST_PROBABILITY = 1e-4
LARGEST_ODDS = 400.0
UPRIGHT, UPRIGHT_SD_DEG = 0.8, 20.0  # default: this fraction of all pairs is the same way up, within so many degrees
# Noise in spacings from which evidence is summed over pairs, and how fast it divides the differences of that of pairs
LEAST_SPACINGS, SOFTENING = 0.1, 8.0
NEGLIGIBLE_LOG = 5.0  # log probability by which a map may lie behind the most probable and be the best of a pose
# Shares of the evidence of soft pairs and of best pairs in that evidence, fitted to 425 noisy shapes by their poses'
# probabilities: either errs where the other does not, and noise and bending are not of the model's kind.
SOFT_SHARE, HARD_SHARE = 0.19, 0.12
WORST_SOFT = 200.0  # log evidence by which soft pairs at most count less than best pairs
POSE_DISTANCE = 0.12  # root-mean-square radii within which maps are of one pose
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
class LikelyPose:
    """One of the poses that the data allow, in normalised coordinates."""

    move: FieldMap
    rotation_deg: float
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PosePosterior:
    """Maps with their log probabilities, and that of no relation between the sets."""

    search: PoseSearch
    maps: tuple[PoseEvidence, ...]  # by falling probability, but first the best of the most probable pose
    logs: Floats  # log probability of each map, shape (k,)
    unrelated: float  # log probability

    @property
    def best(self) -> PoseEvidence | None:
        """The most probable map of the most probable pose; None where no map has enough partners."""
        return self.maps[0] if self.maps else None

    def move(self, evidence: PoseEvidence) -> FieldMap:
        """The map of normalised points."""
        return FieldMap(
            affine=evidence.affine,
            control=self.search.field.control,
            weights=evidence.kernel_weights,
            width=evidence.width,
        )

    def log_odds(self, moved: Floats) -> float:
        """Log odds of the maps within the tolerance of moved points, shape (n, d), against all others."""
        if not self.maps:
            return -LARGEST_ODDS
        near = self._near(moved)
        here = scipy.special.logsumexp(self.logs[near]) if near.any() else -math.inf
        others = scipy.special.logsumexp(np.append(self.logs[~near], self.unrelated))
        return float(np.clip(here - others, -LARGEST_ODDS, LARGEST_ODDS))

    def _near(self, moved: Floats) -> Booleans:
        """Mask of the maps within the tolerance of moved points, shape (k,)."""
        tolerance = TOLERANCE * _radius(moved)
        return np.array([_is_near(pose.moved, moved, tolerance**2 * len(moved)) for pose in self.maps])

    def alternatives(self) -> tuple[LikelyPose, ...]:
        """Poses that differ by more than the tolerance, by falling probability; the first is the best."""
        left = np.ones(len(self.maps), dtype=bool)
        poses: list[LikelyPose] = []
        while left.any() and len(poses) < MOST_ALTERNATIVES:
            first = self.maps[left.argmax()]
            near = left & self._near(first.moved)
            probability = float(np.exp(scipy.special.logsumexp(self.logs[near])))
            if poses and probability < LEAST_PROBABILITY:
                break
            poses.append(
                LikelyPose(
                    move=self.move(first),
                    rotation_deg=rotation_deg(first.affine[1:]),
                    probability=min(probability, 1.0),
                )
            )
            left &= ~near
        return tuple(sorted(poses, key=lambda pose: -pose.probability))


def pose_posterior(
    source: Floats,
    target: Floats,
    *,
    rng: np.random.Generator,
    rotation_sd_deg: float | None = None,
    also: Floats | None = None,
    searched: PosePosterior | None = None,
) -> PosePosterior:
    """Posterior over the maps that a search finds, and over that of a given answer ``also``, shape (n, d).

    Sets are normalised, shapes (n, d) and (m, d). Without ``rotation_sd_deg`` the prior of `log_rotation_prior` holds.
    A posterior of the same sets, ``searched``, saves the search.
    """
    search = PoseSearch.of(source, target) if searched is None else searched.search
    maps = search_poses(search, rng=rng) if searched is None else list(searched.maps)
    if also is not None and (given := settled(search, also)) is not None:
        maps.append(given)
    upright = distinct((pose for pose in maps if np.linalg.det(pose.affine[1:]) > 0), DUPLICATE)
    priors = np.array([log_rotation_prior(pose.affine[1:], rotation_sd_deg) for pose in upright])
    logs = priors + _judged(search, upright)
    order = np.argsort(-logs, kind="stable")
    logs, chosen = logs[order], [upright[k] for k in order]
    unrelated = unrelated_evidence(target)
    total = scipy.special.logsumexp(np.append(logs, unrelated))
    found = PosePosterior(
        search=search,
        maps=tuple(chosen),
        logs=logs - total,
        unrelated=float(unrelated - total),
    )
    if not chosen:
        return found
    likely = [number for number in range(len(chosen)) if logs[number] > logs[0] - NEGLIGIBLE_LOG]
    pose = max(likely, key=lambda number: found.log_odds(chosen[number].moved))
    first = int(found._near(chosen[pose].moved).argmax())
    ranked = [first, *(number for number in range(len(chosen)) if number != first)]
    return replace(found, maps=tuple(chosen[number] for number in ranked), logs=found.logs[ranked])


def _judged(search: PoseSearch, maps: list[PoseEvidence]) -> Floats:
    """Log evidence of maps by falling evidence, shape (k,), under noise beyond the spacing summed over pairs.

    The evidence of a map is that of its best pairs. Under noise these fit almost any pose, some by chance better than
    others, and a neighbour is as good a partner. There each pose has shares of the evidence of soft pairs and of its
    best pairs; that of the best pairs, with its differences divided, shares it among the maps of the pose. In tables
    too large for soft pairs the differences are divided between poses too.
    """
    logs = np.array([pose.log for pose in maps])
    noise = maps[0].sigma / search.step if maps else 0.0
    if noise <= LEAST_SPACINGS:
        return logs
    divisor = 1 + SOFTENING * (noise - LEAST_SPACINGS)
    if len(search.source) * len(search.target) > MANY_PAIRS:
        return np.asarray(logs[0] + (logs - logs[0]) / divisor)
    judged = np.full(len(maps), -math.inf)
    level = None
    for first in distinct(maps, POSE_DISTANCE):
        most = POSE_DISTANCE**2 * len(first.moved)
        near = np.isneginf(judged) & np.array([_is_near(pose.moved, first.moved, most) for pose in maps])
        soft = settled(search, first.moved)
        other = first.log if soft is None else max(soft.log, first.log - WORST_SOFT)
        own = SOFT_SHARE * other + HARD_SHARE * first.log
        if level is None:
            level = max(other, first.log) - own
        within = logs[near] / divisor
        judged[near] = level + own + within - scipy.special.logsumexp(within)
    return judged


@fused
def _is_near(moved: Floats, other: Floats, most: float) -> bool:
    """Whether two maps' points, shape (n, d), have at most a sum of squared distances."""
    total = 0.0
    for i in range(len(moved)):
        for axis in range(moved.shape[1]):
            total += (moved[i, axis] - other[i, axis]) ** 2
        if total > most:
            return False
    return True


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


def log_prior_of_side(sd_deg: float | None, *, over: bool) -> float:
    """Log probability, before the comparison, that a flat set in space is turned over, or that it is not.

    Half of all rotations turn a plane over. With ``sd_deg`` the angle to its other side has the density of
    `log_rotation_prior` at half a turn.

    Examples
    --------
    >>> round(math.exp(log_prior_of_side(None, over=True)), 3)
    0.1
    """
    if sd_deg is None:
        chance = (1 - UPRIGHT) / 2
    else:
        odds = log_rotation_prior(np.diag([1.0, -1.0, -1.0]), sd_deg) - log_rotation_prior(np.eye(3), sd_deg)
        chance = 1 / (1 + math.exp(-odds))
    return math.log(max(chance if over else 1 - chance, 1e-300))


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
        return math.log(float(scipy.special.i0e(concentration)))
    angle = np.linspace(0, np.pi, 20_001)
    density = np.exp(concentration * (np.cos(angle) - 1)) * (1 - np.cos(angle)) / np.pi
    return math.log(float(np.trapezoid(density, angle)))


MOSTLY = 0.9  # of the paired points of the most probable map, that soft pairs must hold to replace it
LAST_ROUNDS = 8  # of soft pairs and fields, after which the answer no longer moves much
NEAREST = 1.5  # largest distance of a pair, in spacings
CERTAIN_DISTANCE = 0.2  # root-mean-square distance of partners, of the spacing, below which pairs are unambiguous
INTERPOLATING = 1e-7  # bending ridge of a spline through unambiguous partners


def fit(
    source: Floats, target: Floats, /, *, rng: np.random.Generator, posterior: PosePosterior | None = None
) -> MatchFit:
    """Match normalised points, shapes (n, d) and (m, d); ``rng`` draws the samples of the pose consensus.

    A ``posterior`` of the same sets saves the search.
    """
    posterior = pose_posterior(source, target, rng=rng) if posterior is None else posterior
    best = posterior.best
    if best is None:
        return MatchFit(move=np.copy, matches=np.full(len(source), UNMATCHED), trust=np.zeros(len(source)))
    if best.sigma > LEAST_SPACINGS * posterior.search.step:
        # Pairs that noise brought near each other follow it: all soft pairs hold the map.
        soft = settled(posterior.search, best.moved, rounds=LAST_ROUNDS)
        least = MOSTLY * best.paired if len(source) * len(target) <= MANY_PAIRS else best.paired + 1
        best = soft if soft is not None and soft.paired >= least else best
    move = _interpolated(source, best.moved, target, posterior.search.step) or posterior.move(best)
    matches, trust = nearest_pairs(move(source), target, tolerance=posterior.search.step)
    return MatchFit(move=move, matches=matches, trust=trust)


def _interpolated(source: Floats, moved: Floats, target: Floats, spacing: float) -> ThinPlateSpline | None:
    """The spline through the partners of moved points where these are unambiguous.

    A residual is noise or fine deformation, which the points do not distinguish. Where it is small against the spacing,
    the partner is the better estimate of the position.
    """
    squared = scipy.spatial.distance.cdist(moved, target, "sqeuclidean")
    pairs = assign(squared, dummy=(NEAREST * spacing) ** 2)
    rows = np.flatnonzero(pairs != UNMATCHED)
    away = squared[rows, pairs[rows]]
    if len(rows) <= source.shape[1] or np.mean(away) > (CERTAIN_DISTANCE * spacing) ** 2:
        return None
    basis = spline_basis(source)
    return basis.spline(basis.at(rows).coordinates(target[pairs[rows]], bending=INTERPOLATING))


STEP = 1e-3  # of the numerical gradient of a map
MOST_FOLDED, MOST_STRETCH = 0.2, 1.4  # fraction of folded points, and log ratio of singular values, of a sound map
MOST_NOISE = 0.5  # log of the standard deviation in spacings, of an answer without a map
COLLAPSED = -0.05  # unpaired fraction below which points of one set share partners
# Log odds are divided by 1 + BOTH min(h, s), where h and s are the fractions of source and target without partners: a
# search misses more poses there.
BOTH = 10.0
CONTRADICTED = 3.0  # log odds against an answer beyond which more say no more
MOST_UNSOUND = 0.5
WIDEST, MOST_SHEARED = 0.9, 0.9  # log ratio of singular values from which an answer has at most this confidence
WEIGHTS = (-0.17, 2.82, 1.13)
# Accepted share of wrong answers among reliable ones, and the least confidence of these: stricter than calibrated
# (0.978 for one in a thousand), because more answers to shapes not calibrated on were wrong, and few lie below
THRESHOLDS = ((0.001, 0.985), (0.003, 0.96), (0.01, 0.87), (0.03, 0.7))


def trust_measures(posterior: PosePosterior, moved: Floats, *, sound: bool, related: bool = True) -> Floats:
    """What the trust in an answer's points, shape (n, d), depends on, shape (8,).

    Log odds of the answer; fractions of source and target without partner; log of the noise in spacings; distance from
    the best map, in tolerances; log ratio of the best affine map's singular values; log probability of unrelated sets,
    0 where nothing shows that they are ``related``; 1 where the answer's map is ``sound``, else 0.
    """
    odds, best, search = posterior.log_odds(moved), posterior.best, posterior.search
    unrelated = posterior.unrelated if related else 0.0
    if best is None:
        return np.array([odds, 1.0, 1.0, MOST_NOISE, 1.0, 0.0, unrelated, 0.0])
    far = distance(best.moved, moved) / (TOLERANCE * _radius(moved))
    hidden, stray = 1 - best.paired / len(moved), 1 - best.paired / len(search.target)
    noise, stretch = math.log(best.sigma / search.step), size_and_stretch(best.affine[1:])[1]
    return np.array([odds, hidden, stray, noise, far, stretch, unrelated, float(sound)])


def trust_features(measures: Floats) -> Floats:
    """Columns of the regression, shape (..., 3), from `trust_measures`, shape (..., 8)."""
    odds, hidden, stray, *_ = np.moveaxis(np.asarray(measures), -1, 0)
    support = np.maximum(odds, 0.0) / (1 + BOTH * np.maximum(np.minimum(hidden, stray), 0.0))
    return np.stack([np.ones_like(odds), np.log1p(support), np.clip(odds, -CONTRADICTED, 0.0)], axis=-1)


def trust_log_odds(measures: Floats) -> Floats:
    """Log odds of being right, shape (...), that the regression gives `trust_measures`, shape (..., 8)."""
    return np.asarray(trust_features(measures) @ np.array(WEIGHTS))


def is_collapsed(posterior: PosePosterior) -> bool:
    """Whether points of one set share partners in the best map."""
    best = posterior.best
    return best is None or best.paired > (1 - COLLAPSED) * min(len(best.moved), len(posterior.search.target))


def is_sound(move: Move, source: Floats) -> bool:
    """Whether a map of normalised points, shape (n, d), neither folds nor mirrors nor flattens the set."""
    dimension = source.shape[1]
    centred = source - source.mean(axis=0)
    matrix = np.linalg.lstsq(centred, move(source), rcond=None)[0]
    if np.linalg.det(matrix) <= 0 or size_and_stretch(matrix)[1] > MOST_STRETCH:
        return False
    steps = STEP * np.eye(dimension)
    gradient = np.stack([(move(source + step) - move(source - step)) / (2 * STEP) for step in steps], axis=1)
    return bool(np.mean(np.linalg.det(gradient) <= 0) <= MOST_FOLDED)


def probability_right(measures: Floats) -> float:
    """Probability that an answer with `trust_measures`, shape (8,), is right: its error is at most 0.1 of the unit box.

    It is at most the probability that the sets are related, and small for maps that are not sound or sheared widely.
    """
    logit = float(np.clip(trust_log_odds(measures), -50.0, 50.0))
    stretch, unrelated, sound = measures[5:]
    chance = 1 / (1 + math.exp(-logit))
    chance = chance if sound else min(chance, MOST_UNSOUND)
    chance = chance if stretch <= WIDEST else min(chance, MOST_SHEARED)
    return float(chance * (1 - math.exp(min(float(unrelated), 0.0))))


def least_confidence(most_wrong: float) -> float:
    """The least confidence of a reliable answer where a share of wrong ones among these is accepted.

    Examples
    --------
    >>> least_confidence(0.001) > least_confidence(0.01)
    True
    """
    shares, levels = np.array(THRESHOLDS).T
    return float(np.interp(np.log(most_wrong), np.log(shares), levels))
