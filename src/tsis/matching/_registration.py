"""Register two point sets by any method, and rate the confidence of the result."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.matching import _cpd as cpd
from tsis.matching import _rpm_lns as rpm_lns
from tsis.matching import _shape_context as shape_context
from tsis.matching import _tprl as tprl
from tsis.matching import _tps_rpm as tps_rpm
from tsis.matching._evidence import log_evidence
from tsis.matching._fit import UNMATCHED, Booleans, Floats, Integers, NormalFrame, require_points, transformed_in_blocks
from tsis.matching._pairing import MOST_POINTS, drawn, matched_all
from tsis.matching._spline import spline_basis, spread_indices, spread_out
from tsis.model import require_array, require_one_of, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

    from tsis.matching._fit import MatchFit, MatchMethod, Move


RELIABLE = 0.5
SCALE = 3.0  # of log evidence, over which confidence rises from 1/4 to 3/4
MOST = 600  # points of each set that enter the confidence
PASSING = 1e-6  # bending ridge of the spline through the transformed points


def confidence_of(fit: MatchFit, source: Floats, target: Floats) -> float:
    """Confidence in [0, 1] of a fit of normalised points: from its evidence over that of unrelated sets.

    Unrelated points are uniform or one normal cloud, whichever is likelier; Schwarz's criterion penalises the affine
    part of the map. A wrong fit of high evidence, as of a shape on half of another, is not detected.
    """
    dimension = source.shape[1]
    if np.count_nonzero(fit.matches != UNMATCHED) < dimension + 2:
        return 0.0
    here = source[spread_indices(source, MOST)] if len(source) > MOST else source
    there = target[spread_indices(target, MOST)] if len(target) > MOST else target
    basis = spline_basis(here)
    coordinates = basis.coordinates(fit.move(here), bending=PASSING)
    evidence = log_evidence(basis, coordinates, there) - _affine_penalty(there) - _normal_over_uniform(there)
    return float(1 / (1 + np.exp(np.clip(-evidence / SCALE, -50, 50))))


def _affine_penalty(target: Floats) -> float:
    """Expected gain of an affine map fitted to unrelated points (Schwarz's criterion)."""
    dimension = target.shape[1]
    return float(0.5 * dimension * (dimension + 1) * np.log(target.size))


def _normal_over_uniform(target: Floats) -> float:
    """Log probability of the points as one normal cloud over that of uniform points in their box; at least 0."""
    count, dimension = target.shape
    _, volume = np.linalg.slogdet(np.cov(target, rowvar=False, bias=True))
    box = float(np.log(np.ptp(target, axis=0)).sum())
    return float(max(0.0, count * (box - 0.5 * (dimension * math.log(2 * math.pi * math.e) + volume))))


FEWEST = 4  # points: three in the plane fit any affine map
FEW = {2: 9, 3: 16}  # points, by dimension, below which a bent map fits unrelated sets
LARGEST = 1e100  # coordinate whose square does not overflow
THIN = 1e-6  # extent across a line or plane, of that along it, that may be rounding

METHODS: Mapping[str, MatchMethod] = MappingProxyType(
    {
        "tprl": tprl.fit,
        "cpd": cpd.fit,
        "tps-rpm": tps_rpm.fit,
        "rpm-lns": rpm_lns.fit,
        "shape-context": shape_context.fit,
    }
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Registration:
    """Correspondences of two point sets, and the transform of the first to the second.

    Attributes
    ----------
    method
        Name of the method.
    moved
        The source's points after the transform, shape (n, d).
    matches
        Index of each source point's target point, -1 where it has none, shape (n,).
    trust
        Confidence of each match, in [0, 1], shape (n,); 0 where there is none.
    confidence
        Confidence of the registration, in [0, 1].
    reliable
        Whether the confidence suffices. Otherwise nothing is matched and the transform is the identity.
    notes
        Warnings, a message each.
    move
        The transform without checks of its points; call `transform`.
    """

    method: str
    moved: Floats
    matches: Integers
    trust: Floats
    confidence: float
    reliable: bool
    notes: tuple[str, ...]
    move: Move

    def transform(self, points: ArrayLike) -> Floats:
        """Transform points of the source's space, shape (k, d).

        Raises
        ------
        InputError
            When the points are not finite or of another dimension.
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
    source: ArrayLike, target: ArrayLike, *, method: str = "tprl", rng: np.random.Generator | None = None
) -> Registration:
    """Match two point sets that differ by a smooth deformation; points of either may be missing in the other.

    Parameters
    ----------
    source, target
        Points, shapes (n, d) and (m, d) with d = 2 or 3, in one unit; at least 4 each, not all in a line or plane.
        Above some thousands of points samples are matched, with a note; above two millions an error is raised.
    method
        ``"tprl"``, ``"cpd"``, ``"tps-rpm"``, ``"rpm-lns"`` or ``"shape-context"``. All but the first expect only a
        small rotation between the sets.
    rng
        Random generator, for samples of large sets and for methods that need it; seeded with 0 by default.

    Raises
    ------
    UnknownNameError
        When the method is unknown.
    InputError
        When shapes do not fit, values are not finite, or the points are too few, too many, or in a line or plane.

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
    result = match_points(source, target, method=method, rng=rng)
    return result if result.reliable else _withheld(result, np.array(source, dtype=float))


def match_points(
    source: ArrayLike, target: ArrayLike, *, method: str = "tprl", rng: np.random.Generator | None = None
) -> Registration:
    """Match two point sets as `register` does, but return unreliable matches too.

    For comparisons with programs that do not rate confidence. Parameters and errors are those of `register`.
    """
    require_one_of("method", method, METHODS)
    source, target = _points("source", source), _points("target", target)
    if source.shape[1] != target.shape[1]:
        raise InputError(
            f"source and target must have as many coordinates; got {source.shape[1]} and {target.shape[1]}"
        )
    rng = np.random.default_rng(0) if rng is None else rng
    require_type("rng", rng, np.random.Generator)
    with one_blas_thread():
        return _match(method, source, target, rng)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _FramedMove:
    """A map of normalised points, between points in the units of the sets."""

    start: NormalFrame
    end: NormalFrame
    move: Move

    def __call__(self, points: Floats, /) -> Floats:
        return self.end.outward(self.move(self.start.inward(points)))


def _match(method: str, source: Floats, target: Floats, rng: np.random.Generator) -> Registration:
    start, end = NormalFrame.of(source), NormalFrame.of(target)
    here, there = start.inward(source), end.inward(target)
    source_sample, target_sample = drawn(here, there, rng=rng)
    fit = METHODS[method](source_sample, target_sample, rng=rng)
    confidence = confidence_of(fit, source_sample, target_sample)
    notes = []
    if min(len(source_sample), len(target_sample)) < FEW[source.shape[1]]:
        notes.append("so few points fit almost any others; the confidence means little")
    if len(source_sample) < len(here) or len(target_sample) < len(there):
        fit = matched_all(fit, here, there)
        notes.append(
            f"{len(source):,} and {len(target):,} points are too many for tables of all pairs; "
            f"{len(source_sample):,} and {len(target_sample):,} drawn from them were matched"
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
    )
    return replace(registration, moved=registration.transform(source))


def _withheld(registration: Registration, source: Floats) -> Registration:
    """The registration with the identity as its transform and no matches."""
    note = (
        f"no reliable match: confidence {registration.confidence:.2f} lies below {RELIABLE:g}; no point was transformed"
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
            f"{name} must hold at most {MOST_POINTS:,} points; got {len(points):,}, which would take about "
            f"{len(points) * 1e-6:.0f} GB (match a sample and transform the rest with Registration.transform)"
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
