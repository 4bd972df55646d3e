"""Register two point sets by any method, and rate the confidence of the result."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.matching import annealing as tps_rpm
from tsis.matching import bayesian_drift as bcpd
from tsis.matching import drift as cpd
from tsis.matching import neighbourhoods as rpm_lns
from tsis.matching import posterior as tprl
from tsis.matching import shape_context
from tsis.matching.methods import (
    MOST_POINTS,
    UNMATCHED,
    Booleans,
    Floats,
    Integers,
    NormalFrame,
    drawn,
    matched_all,
    require_points,
    transformed_in_blocks,
)
from tsis.matching.posterior import (
    RELIABLE,
    WIDEST_DEG,
    is_collapsed,
    is_sound,
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
    from tsis.matching.posterior import LikelyPose, PosePosterior


FEWEST = 4  # points: three in the plane fit any affine map
FEW = {2: 9, 3: 16}  # points, by dimension, below which a bent map fits unrelated sets
LARGEST = 1e100  # coordinate whose square does not overflow
SHARPEST_DEG = 0.1  # least standard deviation of a rotation
THIN = 1e-6  # extent across a line or plane, of that along it, that may be rounding

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
    rotation_deg: float  #: angle of its rotation, in [0, 180]
    probability: float  #: posterior probability of all maps about this pose, in [0, 1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Registration:
    """Correspondences of two point sets, and the transform of the first to the second."""

    method: str  #: name of the method
    moved: Floats  #: the source's points after the transform, shape (n, d)
    matches: Integers  #: index of each source point's target point, -1 where it has none, shape (n,)
    trust: Floats  #: confidence of each match, in [0, 1], shape (n,); 0 where there is none
    #: calibrated probability that the root-mean-square error is at most 0.1 of a unit box about the shape, in [0, 1]
    confidence: float
    #: Whether the confidence is at least 0.999. Otherwise nothing is matched and the transform is the identity.
    reliable: bool
    notes: tuple[str, ...]  #: warnings, a message each
    move: Move  #: the transform without checks of its points; call `transform`
    #: Poses that the data allow and that differ by more than that error, by falling probability; a symmetric shape has
    #: several. The first is the pose of ``"tprl"``.
    alternatives: tuple[Alternative, ...] = ()

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


def register(
    source: ArrayLike,
    target: ArrayLike,
    *,
    method: str = "tprl",
    rng: np.random.Generator | None = None,
    rotation_sd_deg: float | None = None,
) -> Registration:
    """Match two point sets that differ by a smooth deformation; points of either may be missing in the other.

    Raises `UnknownNameError` when the method is unknown; `InputError` when shapes do not fit, values are not finite, or
    the points are too few, too many, or in a line or plane.

    Parameters
    ----------
    source, target
        Points, shapes (n, d) and (m, d) with d = 2 or 3, in one unit; at least 4 each, not all in a line or plane.
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
    found = match_points(source, target, method=method, rng=rng, rotation_sd_deg=rotation_sd_deg)
    return found if found.reliable else _withheld(found, np.array(source, dtype=float))


def match_points(
    source: ArrayLike,
    target: ArrayLike,
    *,
    method: str = "tprl",
    rng: np.random.Generator | None = None,
    rotation_sd_deg: float | None = None,
) -> Registration:
    """Match two point sets as `register` does, but return unreliable matches too.

    For comparisons with programs that do not rate confidence. Parameters and errors are those of `register`.
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
    with one_blas_thread():
        return _match(method, source, target, rng, rotation_sd_deg)


def _match(
    method: str, source: Floats, target: Floats, rng: np.random.Generator, rotation_sd_deg: float | None
) -> Registration:
    start, end = NormalFrame.of(source), NormalFrame.of(target)
    here, there = start.inward(source), end.inward(target)
    sample = drawn(here, there, rng=rng)
    fit, posterior, measures = fit_and_measures(method, *sample, rng=rng, rotation_sd_deg=rotation_sd_deg)
    confidence = probability_right(measures)
    notes = []
    if min(map(len, sample)) < FEW[source.shape[1]]:
        notes.append("so few points fit almost any others; the confidence means little")
    if len(sample[0]) < len(here) or len(sample[1]) < len(there):
        fit = matched_all(fit, here, there)
        notes.append(
            f"{len(source):,} and {len(target):,} points are too many for tables of all pairs; "
            f"{len(sample[0]):,} and {len(sample[1]):,} drawn from them were matched"
        )

    registration = Registration(
        method=method,
        moved=source,
        matches=fit.matches,
        trust=fit.trust,
        confidence=confidence,
        reliable=confidence >= RELIABLE,
        notes=tuple(notes),
        move=_FramedMove(start=start, end=end, move=fit.move),
        alternatives=tuple(_outward(pose, here, end) for pose in posterior.alternatives()),
    )
    return replace(registration, moved=registration.transform(source))


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
    return fit, pose_posterior(source, target, rng=rng, rotation_sd_deg=rotation_sd_deg, also=also, searched=searched)


def _outward(pose: LikelyPose, source: Floats, end: NormalFrame) -> Alternative:
    """A pose of normalised points in the target's unit."""
    moved = end.outward(transformed_in_blocks(pose.move, source))
    return Alternative(moved=moved, rotation_deg=pose.rotation_deg, probability=pose.probability)


def _withheld(registration: Registration, source: Floats) -> Registration:
    """The registration with the identity as its transform and no matches."""
    note = (
        f"no reliable match: confidence {registration.confidence:.3f} lies below {RELIABLE:g}; no point was transformed"
    )
    return replace(
        registration,
        moved=source,
        matches=np.full(len(source), UNMATCHED),
        trust=np.zeros(len(source)),
        notes=(*registration.notes, note),
        move=_stay,
    )


def _stay(points: Floats, /) -> Floats:
    return points.copy()


def _points(name: str, value: ArrayLike) -> Floats:
    points = require_points(name, value)
    dimension = points.shape[1]
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
    if extent[-1] <= THIN * extent[0]:
        raise InputError(
            f"{name} must not lie in a {'line' if dimension == 2 else 'plane'}; got {len(points)} points that do"
            + ("" if dimension == 2 else " (match them in two dimensions)")
        )
    return points
