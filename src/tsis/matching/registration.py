"""Register two point sets by any method, and rate the confidence of the result."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, UntrustedError
from tsis.matching import annealing as tps_rpm
from tsis.matching import bayesian_drift as bcpd
from tsis.matching import drift as cpd
from tsis.matching import neighbourhoods as rpm_lns
from tsis.matching import posterior as tprl
from tsis.matching import shape_context
from tsis.matching.flags import FEW, FEW_POINTS, MATCHING_FLAGS, SAMPLED, doubts
from tsis.matching.methods import (
    MOST_POINTS,
    TOLERANCE_SD,
    UNMATCHED,
    Booleans,
    Copies,
    Floats,
    Integers,
    NormalFrame,
    copied_matches,
    drawn,
    matched_all,
    require_points,
    transformed_in_blocks,
)
from tsis.matching.planes import flat_planes, plane_move
from tsis.matching.posterior import (
    LARGEST_ODDS,
    LEAST_PROBABILITY,
    MOST_ALTERNATIVES,
    THRESHOLDS,
    WIDEST_DEG,
    is_collapsed,
    is_sound,
    least_confidence,
    log_prior_of_side,
    pose_posterior,
    probability_right,
    trust_measures,
)
from tsis.matching.spline import spread_out
from tsis.model.require import require_array, require_number, require_one_of, require_type
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from tsis.matching.methods import MatchFit, MatchMethod, Move
    from tsis.matching.planes import Plane
    from tsis.matching.posterior import LikelyPose, PosePosterior
    from tsis.model.flag import Finding


FEWEST = 4  # points: three in the plane fit any affine map
LARGEST = 1e100  # coordinate whose square does not overflow
SHARPEST_DEG = 0.1  # least standard deviation of a rotation
THIN = 1e-6  # extent across a line, of that along it, that may be rounding

METHODS: Mapping[str, MatchMethod] = MappingProxyType(
    {
        "tprl": tprl.fit,
        "cpd": cpd.fit,
        "bcpd": bcpd.fit,
        "tps-rpm": tps_rpm.fit,
        "rpm-lns": rpm_lns.fit,
        "shape-context": shape_context.fit,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alternative:
    """A pose that the data allow."""

    moved: Floats  #: the source's points in this pose, shape (n, d)
    rotation_deg: float  #: angle of its rotation, of flat sets in space within their plane, in [0, 180]
    probability: float  #: posterior probability of all maps about this pose, in [0, 1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointMatch:
    """The most probable transform of a source and its correspondences, whether or not they can be relied on."""

    moved: Floats  #: the source's points after the transform, shape (n, d)
    #: index of each source point's target point, -1 where it has none, shape (n,); only copies of one point share one
    matches: Integers
    trust: Floats  #: confidence of each match, in [0, 1], shape (n,); 0 where there is none
    move: Move  #: the transform without checks of its points; call `transform`

    def transform(self, points: ArrayLike) -> Floats:
        """Transform points of the source's space, shape (k, d).

        Raises `InputError` when the points are not finite or of another dimension.
        """
        checked = require_array("points", points, ndim=2)
        dimension = self.moved.shape[1]
        if checked.shape[1] != dimension:
            raise InputError(f"points must have {dimension} coordinates each, as the source; got shape {checked.shape}")
        return transformed_in_blocks(self.move, checked)

    @property
    def outliers(self) -> Booleans:
        """Mask of source points without a match, shape (n,)."""
        return np.asarray(self.matches == UNMATCHED)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Registration:
    """Correspondences of two point sets, and the transform of the first to the second.

    `moved`, `matches`, `trust`, `outliers` and `transform` raise `UntrustedError` where the registration is not
    reliable; the message gives the reasons and the cures.
    """

    method: str  #: name of the method
    #: calibrated probability that the root-mean-square error is at most 0.1 of a unit box about the shape, in [0, 1]
    confidence: float
    reliable: bool  #: whether the confidence suffices that of such answers at most one in a thousand is wrong
    flags: tuple[str, ...]  #: names of doubts, of `tsis.matching.flags.MATCHING_FLAGS`
    notes: tuple[str, ...]  #: a message for each flag
    untrusted: PointMatch  #: the most probable match, reliable or not
    #: Poses that the data allow and that differ by more than that error, by falling probability; a symmetric shape has
    #: several. The first is the pose of ``"tprl"``.
    alternatives: tuple[Alternative, ...] = ()

    @property
    def moved(self) -> Floats:
        """The source's points after the transform, shape (n, d)."""
        return self._trusted().moved

    @property
    def matches(self) -> Integers:
        """Index of each source point's target point, -1 where it has none, shape (n,)."""
        return self._trusted().matches

    @property
    def trust(self) -> Floats:
        """Confidence of each match, in [0, 1], shape (n,); 0 where there is none."""
        return self._trusted().trust

    @property
    def outliers(self) -> Booleans:
        """Mask of source points without a match, shape (n,)."""
        return self._trusted().outliers

    def transform(self, points: ArrayLike) -> Floats:
        """Transform points of the source's space, shape (k, d).

        Raises `InputError` when the points are not finite or of another dimension.
        """
        return self._trusted().transform(points)

    def _trusted(self) -> PointMatch:
        if self.reliable:
            return self.untrusted
        reasons = " ".join(
            f"{note[:1].upper()}{note[1:]}; {MATCHING_FLAGS[flag].cure}."
            for flag, note in zip(self.flags, self.notes, strict=True)
        )
        raise UntrustedError(
            f"this match must not be used, because it is not reliable: confidence {self.confidence:.3f} "
            f"({', '.join(self.flags) or 'no flag'}). {reasons} Its attribute untrusted gives the most probable "
            f"transform all the same, alternatives the others."
        )

    def __repr__(self) -> str:
        state = "reliable" if self.reliable else "not reliable"
        flags = ", ".join(self.flags) or "none"
        return f"Registration({self.method}, {state}: confidence {self.confidence:.3f}; flags: {flags})"


def register(
    source: ArrayLike,
    target: ArrayLike,
    *,
    method: str = "tprl",
    rng: np.random.Generator | None = None,
    rotation_sd_deg: float | None = None,
    most_wrong: float = 0.001,
) -> Registration:
    """Match two point sets that differ by a smooth deformation; points of either may be missing in the other.

    The numbers of a result that is not reliable raise `UntrustedError`. Raises `UnknownNameError` when the method is
    unknown; `InputError` when shapes do not fit, values are not finite, or the points are too few, too many, or in a
    line, or when only one of two sets in space is flat.

    Parameters
    ----------
    source, target
        Points, shapes (n, d) and (m, d) with d = 2 or 3, in one unit; at least 4 each, not all in a line. Points of a
        plane in space are matched in their plane, copies of one point as one.
        Above some thousands of points samples are matched, with a note; above 200,000 an error is raised.
    method
        ``"tprl"``, ``"cpd"``, ``"bcpd"``, ``"tps-rpm"``, ``"rpm-lns"``, ``"shape-context"`` or the name of a plug-in.
        All but the first expect only a small rotation between the sets.
    rng
        Random generator, for samples of large sets and for methods that need it; seeded with 0 by default.
    rotation_sd_deg
        Standard deviation of the rotation between the sets that is expected before they are compared, in (0, 1000]; at
        1000 all rotations are equally likely. By default four of five pairs of sets are the same way up within 20
        degrees, and the fifth is rotated by any angle.
    most_wrong
        Share of wrong answers among the reliable ones that their cost allows, in [0.001, 0.03]; by default one in a
        thousand. It sets the least confidence of a reliable answer.

    Examples
    --------
    >>> import numpy as np
    >>> angle = np.linspace(0, 5, 40)
    >>> spiral = np.column_stack([angle * np.cos(angle), angle * np.sin(angle)])
    >>> registration = register(spiral, 2 * spiral[::-1] + [3.0, 1.0])
    >>> bool((registration.matches == np.arange(40)[::-1]).all()), registration.reliable
    (True, True)
    >>> registration.transform([[0.0, 0.0]]).round(0).tolist()
    [[3.0, 1.0]]
    """
    if method not in METHODS:
        require_one_of("method", method, (*METHODS, *find_plugins("matching")))
    source, target = _points("source", source), _points("target", target)
    if source.shape[1] != target.shape[1]:
        raise InputError(
            f"source and target must have as many coordinates; got {source.shape[1]} and {target.shape[1]}"
        )
    rng = np.random.default_rng(0) if rng is None else rng
    require_type("rng", rng, np.random.Generator)
    if rotation_sd_deg is not None:
        require_number("rotation_sd_deg", rotation_sd_deg, SHARPEST_DEG, WIDEST_DEG)
    require_number(
        "most_wrong", most_wrong, THRESHOLDS[0][0], THRESHOLDS[-1][0], hint="a share of the reliable answers"
    )
    with one_blas_thread():
        return _match(method, source, target, rng, rotation_sd_deg, least_confidence(most_wrong))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Answer:
    """A method's answer for sets without copies of points."""

    fit: MatchFit  # in the sets' own units
    posterior: PosePosterior
    poses: tuple[Alternative, ...]
    measures: Floats
    flags: tuple[Finding, ...]  # that withhold nothing

    @property
    def weight(self) -> float:
        """Log probability of all its maps over that of unrelated sets."""
        logs = self.posterior.logs
        return float(scipy.special.logsumexp(logs) - self.posterior.unrelated) if len(logs) else -LARGEST_ODDS


def _match(
    method: str, source: Floats, target: Floats, rng: np.random.Generator, rotation_sd_deg: float | None, least: float
) -> Registration:
    here, there = Copies.of(source), Copies.of(target)
    first, second = source[here.first], target[there.first]
    planes = flat_planes(first, second)
    if planes is None:
        answer = _answered(method, first, second, rng, rotation_sd_deg)
    else:
        answer = _answered_in_planes(method, first, second, planes, rng, rotation_sd_deg)
    confidence = probability_right(answer.measures)
    findings = list(answer.flags)
    reliable = confidence >= least
    if not reliable:
        rivals = 1 - answer.poses[0].probability if answer.poses else 1.0
        findings = [*doubts(answer.measures, rivals=rivals, most=1 - least), *findings]
    matches, trust = copied_matches(answer.fit.matches, answer.fit.trust, here, there)
    return Registration(
        method=method,
        confidence=confidence,
        reliable=reliable,
        flags=tuple(name for name, _ in findings),
        notes=tuple(sentence for _, sentence in findings),
        untrusted=PointMatch(
            moved=transformed_in_blocks(answer.fit.move, source), matches=matches, trust=trust, move=answer.fit.move
        ),
        alternatives=tuple(replace(pose, moved=pose.moved[here.place]) for pose in answer.poses),
    )


def _answered(
    method: str, source: Floats, target: Floats, rng: np.random.Generator, rotation_sd_deg: float | None
) -> _Answer:
    start, end = NormalFrame.of(source), NormalFrame.of(target)
    here, there = start.inward(source), end.inward(target)
    sample = drawn(here, there, rng=rng)
    fit, posterior, measures = fit_and_measures(method, *sample, rng=rng, rotation_sd_deg=rotation_sd_deg)
    findings = []
    if min(map(len, sample)) < FEW[source.shape[1]]:
        findings.append(FEW_POINTS.finding())
    if len(sample[0]) < len(here) or len(sample[1]) < len(there):
        fit = matched_all(fit, here, there)
        findings.append(
            SAMPLED.finding(source=len(source), target=len(target), drawn=len(sample[0]), others=len(sample[1]))
        )
    return _Answer(
        fit=replace(fit, move=_FramedMove(start=start, end=end, move=fit.move)),
        posterior=posterior,
        poses=tuple(_outward(pose, here, end) for pose in posterior.alternatives()),
        measures=measures,
        flags=tuple(findings),
    )


def _answered_in_planes(
    method: str,
    source: Floats,
    target: Floats,
    planes: tuple[Plane, Plane],
    rng: np.random.Generator,
    rotation_sd_deg: float | None,
) -> _Answer:
    """The likelier answer of the planes laid on each other with the same side up, and with the other."""
    start, end = planes
    found = []
    for over, side in ((False, end), (True, end.turned_over())):
        answer = _answered(method, start.inward(source), side.inward(target), rng, rotation_sd_deg)
        prior = log_prior_of_side(rotation_sd_deg, over=over)
        found.append((answer.weight + prior, prior, side, answer))
    (weight, prior, side, answer), (other, _, back, rest) = sorted(found, key=lambda item: -item[0])
    measures = answer.measures.copy()
    rivals = np.logaddexp(-np.logaddexp(0, measures[0]), answer.posterior.unrelated + other - prior)
    odds = -np.logaddexp(0, -measures[0]) - rivals  # of the answer against those of both sides
    measures[0] = np.clip(odds, -LARGEST_ODDS, LARGEST_ODDS)
    share = 1 / (1 + math.exp(min(other - weight, 0.0)))
    move = plane_move(start, side, answer.fit.move, start.inward(source))
    poses = [
        replace(pose, moved=plane.outward(pose.moved), probability=pose.probability * part)
        for plane, part, some in ((side, share, answer.poses), (back, 1 - share, rest.poses))
        for pose in some
    ]
    likely = [poses[0], *(pose for pose in poses[1:] if pose.probability >= LEAST_PROBABILITY)]
    ranked = sorted(likely, key=lambda pose: -pose.probability)[:MOST_ALTERNATIVES]
    return replace(answer, fit=replace(answer.fit, move=move), poses=tuple(ranked), measures=measures)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FramedMove:
    """A map of normalised points, between points in the units of the sets."""

    start: NormalFrame
    end: NormalFrame
    move: Move

    def __call__(self, points: Floats, /) -> Floats:
        return self.end.outward(self.move(self.start.inward(points)))


def fit_and_measures(
    method: str,
    source: Floats,
    target: Floats,
    *,
    rng: np.random.Generator | None = None,
    rotation_sd_deg: float | None = None,
    searched: PosePosterior | None = None,
) -> tuple[MatchFit, PosePosterior, Floats]:
    """The method's fit of normalised points, the posterior over poses that judges it, and its `trust_measures`.

    A posterior of the same sets, ``searched``, saves the search.
    """
    rng = np.random.default_rng(0) if rng is None else rng
    fit, posterior = _fitted(method, source, target, rng, rotation_sd_deg, searched)
    # An affine map fits any d + 1 pairs exactly, so that no more than these are no sign of a relation.
    related = np.count_nonzero(fit.matches != UNMATCHED) > source.shape[1] + 1
    sound = related and not is_collapsed(posterior) and is_sound(fit.move, source)
    return fit, posterior, trust_measures(posterior, fit.move(source), sound=sound, related=related)


BLOCK_PAIRS = 1_000_000  # of points, whose distances are held at a time
LEAST_SIGMA = 0.05  # of the target's spacing: noise that exact points are allowed in their trust


def _fitted(
    method: str,
    source: Floats,
    target: Floats,
    rng: np.random.Generator,
    rotation_sd_deg: float | None,
    searched: PosePosterior | None,
) -> tuple[MatchFit, PosePosterior]:
    """The method's fit, and the posterior over poses that judges it."""
    if METHODS.get(method) is tprl.fit:
        posterior = searched or pose_posterior(source, target, rng=rng, rotation_sd_deg=rotation_sd_deg)
        return tprl.fit(source, target, rng=rng, posterior=posterior), posterior
    fit_method: MatchMethod = METHODS[method] if method in METHODS else load_plugin("matching", method)
    fit = fit_method(source, target, rng=rng)
    also = fit.move(source)
    posterior = pose_posterior(source, target, rng=rng, rotation_sd_deg=rotation_sd_deg, also=also, searched=searched)
    return replace(fit, trust=_bounded_trust(fit, posterior, source, target)), posterior


def _bounded_trust(fit: MatchFit, posterior: PosePosterior, source: Floats, target: Floats) -> Floats:
    """A method's trust in each match, at most the match's probability by the poses that the sets allow.

    A method knows its own map alone: along a contour it can slide all points to a neighbour, each of them close to it.
    """
    if posterior.best is None:
        return fit.trust
    sigma = max(posterior.best.sigma, LEAST_SIGMA * posterior.search.step)
    chance, matched = np.zeros(len(source)), np.flatnonzero(fit.matches != UNMATCHED)
    unmatched = np.exp(-0.5 * TOLERANCE_SD**2)
    for pose in posterior.alternatives():
        moved = pose.move(source)
        for rows in np.array_split(matched, 1 + matched.size * len(target) // BLOCK_PAIRS):
            likely = np.exp(-0.5 * scipy.spatial.distance.cdist(moved[rows], target, "sqeuclidean") / sigma**2)
            own = likely[np.arange(rows.size), fit.matches[rows]]
            chance[rows] += pose.probability * own / (likely.sum(axis=1) + unmatched)
    return np.minimum(fit.trust, chance)


def _outward(pose: LikelyPose, source: Floats, end: NormalFrame) -> Alternative:
    """A pose of normalised points in the target's unit."""
    moved = end.outward(transformed_in_blocks(pose.move, source))
    return Alternative(moved=moved, rotation_deg=pose.rotation_deg, probability=pose.probability)


def _points(name: str, value: ArrayLike) -> Floats:
    points = require_points(name, value)
    if len(points) > MOST_POINTS:
        raise InputError(
            f"{name} must hold at most {MOST_POINTS:,} points; got {len(points):,} (match a sample and transform the "
            f"rest with Registration.transform)"
        )
    if np.abs(points).max() > LARGEST:
        raise InputError(f"{name} must lie within {LARGEST:g} of the origin; got {np.abs(points).max():g}")
    distinct = spread_out(points, FEWEST)
    if len(distinct) < FEWEST:
        raise InputError(f"{name} must hold at least {FEWEST} distinct points; got {len(distinct)}")
    extent = np.linalg.svd(points - points.mean(axis=0), full_matrices=False, compute_uv=False)
    if extent[0] < 1 / LARGEST:
        raise InputError(f"{name} must extend over at least {1 / LARGEST:g}; got {extent[0]:g}")
    if extent[1] <= THIN * extent[0]:
        raise InputError(f"{name} must not lie in a line; got {len(points)} points that do")
    return points
