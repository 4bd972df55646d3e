"""Thin-plate splines in two and three dimensions: regularised, weighted, with any number of control points.

A spline is an affine map plus ``sum_c w_c U(|x - c|)`` over its control points c, with the kernel ``U(r) = r**2 log r``
in the plane and ``-r`` in space (the dissertation prints ``r**3 log r**3``, which is the kernel of neither). It
minimises ``sum_i v_i |y_i - f(x_i)|**2 + bending * J(f)``, where the bending energy J is a quadratic form of the w_c.

`SplineBasis` computes once what depends only on the points: the bending energy is the sum of squares of its
coordinates, so that a fit is a ridge regression, invariant to rotation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import fused
from tsis.errors import InputError
from tsis.matching.methods import Floats, Integers, NormalFrame, require_points, ridge_solution
from tsis.model.require import require_array, require_number

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


CONTROL_POINTS = 300  # more only cost time for a smooth deformation
JITTER = 1e-12  # of the largest eigenvalue: rounding must not make the bending energy negative
ABSENT = 1e-12  # of the largest weight: pairs of less weight are ignored
ANCHOR = 1e-12  # ridge on the affine part, of the total weight: zero weight gives the identity


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThinPlateSpline:
    """A smooth map of the plane or of space."""

    control: Floats  #: control points c, shape (k, d), d being 2 or 3
    weights: Floats  #: their weights w, shape (k, d); orthogonal to 1 and to the coordinates of the control points
    affine: Floats  #: shape (d + 1, d): row 0 is the translation, the others the matrix that multiplies points as rows

    def __call__(self, points: ArrayLike) -> Floats:
        """Transform ``points``, shape (n, d)."""
        at = require_points("points", points, self.control.shape[1])
        return np.asarray(kernel(at, self.control) @ self.weights + self.affine[0] + at @ self.affine[1:])

    def gradient(self, points: ArrayLike) -> Floats:
        """Derivatives ``[n, i, j] = d f_i / d x_j`` at ``points``, shape (n, d, d)."""
        at = require_points("points", points, self.control.shape[1])
        away = at[:, None, :] - self.control[None, :, :]
        rate = _kernel_rate(np.linalg.norm(away, axis=2), at.shape[1])
        return np.asarray(self.affine[1:].T + np.einsum("ck,nc,ncj->nkj", self.weights, rate, away))

    @property
    def bending_energy(self) -> float:
        """Quadratic form of the weights that a fit penalises."""
        return float(np.einsum("ck,cd,dk->", self.weights, kernel(self.control, self.control), self.weights))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplineBasis:
    """Basis of the splines over given control points, whose bending energy is a sum of squares of coordinates."""

    points: Floats  # the points of the fits, shape (n, d)
    control: Floats  # control points, shape (k, d)
    # Values at the points of the basis functions, shape (n, k): the first k - d - 1 bend, the last d + 1 are affine
    design: Floats
    weights_of: Floats  # kernel weights of the bending coordinates, shape (k, k - d - 1)

    @property
    def bent(self) -> int:
        """Number of bending coordinates."""
        return int(self.weights_of.shape[1])

    @property
    def rest(self) -> Floats:
        """Coordinates of the identity, shape (k, d)."""
        return np.eye(self.design.shape[1], self.points.shape[1], -(self.bent + 1))

    def at(self, rows: Integers) -> SplineBasis:
        """The basis for fits at some of the points."""
        return replace(self, points=self.points[rows], design=self.design[rows])

    def coordinates(self, targets: Floats, *, bending: float, weights: Floats | None = None) -> Floats:
        """Coordinates of the spline from the points to ``targets``, shape (k, d); inputs are not checked."""
        weighted = self.design if weights is None else self.design * weights[:, None]
        normal = weighted.T @ self.design
        ridge = np.full(len(normal), bending)
        ridge[self.bent :] = ANCHOR * max(float(np.trace(normal)), 1e-300)
        return ridge_solution(normal, weighted.T @ targets + ridge[:, None] * self.rest, ridge)

    def spline(self, coordinates: Floats) -> ThinPlateSpline:
        """The spline of ``coordinates``, shape (k, d)."""
        return ThinPlateSpline(
            control=self.control,
            weights=self.weights_of @ coordinates[: self.bent],
            affine=coordinates[self.bent :],
        )


def spline_basis(points: ArrayLike, *, control: ArrayLike | None = None) -> SplineBasis:
    """Basis of the splines that are fitted at ``points``, shape (n, d), n > d, not all in a line or plane.

    The points are normalised as by `NormalFrame`: the bounds on rounding assume numbers near 1. The ``control`` points,
    shape (k, d), are the points by default, or `CONTROL_POINTS` spread ones of them. Raises `InputError` when the
    shapes do not fit or the control points lie in a line or plane.
    """
    points = require_points("points", points)
    dimension = points.shape[1]
    chosen = spread_out(points, CONTROL_POINTS) if control is None else require_points("control", control, dimension)
    affine = np.column_stack([np.ones(len(chosen)), chosen])
    span, _, _ = np.linalg.svd(affine, full_matrices=True)
    if len(chosen) <= dimension or np.linalg.cond(affine - [0.0, *chosen.mean(axis=0)]) > 1e8:
        raise InputError(
            f"control points must span {'a plane' if dimension == 2 else 'space'}, that is at least {dimension + 1} of "
            f"them not in a {'line' if dimension == 2 else 'plane'}; got {len(chosen)} that do not"
        )
    null = span[:, dimension + 1 :]
    energy = null.T @ kernel(chosen, chosen) @ null
    value, vector = np.linalg.eigh((energy + energy.T) / 2)
    value = np.maximum(value, JITTER * value[-1]) if len(value) else value
    weights_of = null @ (vector / np.sqrt(value))
    return SplineBasis(
        points=points,
        control=chosen,
        design=np.column_stack([kernel(points, chosen) @ weights_of, np.ones(len(points)), points]),
        weights_of=weights_of,
    )


def fit_spline(
    points: ArrayLike,
    targets: ArrayLike,
    *,
    bending: float = 0.0,
    weights: ArrayLike | None = None,
    control: ArrayLike | None = None,
) -> ThinPlateSpline:
    """Fit the thin-plate spline from ``points`` to ``targets``.

    It has the form of the source's (5.15) and penalises the bending energy (5.14). With ``bending`` 0 it solves (5.16).
    Kernel and energy are corrected.

    Raises `InputError` when the shapes do not fit, a value is out of range, the points lie in a line or plane, or they
    do not determine the spline.

    Parameters
    ----------
    points, targets
        Shape (n, d) each with d = 2 or 3, in any unit.
    bending
        Factor of the bending energy, in [0, 1e12], in units of the points, in the plane squared; 0 interpolates if
        every point is a control point.
    weights
        Weight of each pair, shape (n,), not negative; 1 by default.
    control
        Control points, shape (k, d); by default the points, or `CONTROL_POINTS` spread ones of them. With bending 0, at
        most as many as distinct points.

    Examples
    --------
    >>> corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    >>> spline = fit_spline(corners, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [2.0, 1.0]])
    >>> spline([[0.5, 0.5]]).round(6).tolist()
    [[1.0, 0.5]]
    """
    at = require_points("points", points)
    to = require_points("targets", targets, at.shape[1])
    if len(to) != len(at):
        raise InputError(f"targets must be as many as the points, {len(at)}; got {len(to)}")
    require_number("bending", bending, 0.0, 1e12)
    trust = np.ones(len(at)) if weights is None else require_array("weights", weights, ndim=1)
    if len(trust) != len(at) or trust.min() < 0 or trust.max() == 0:
        raise InputError(f"weights must be {len(at)} numbers that are not negative, one of them positive")
    selected = trust > ABSENT * trust.max()
    at, to, trust = at[selected], to[selected], trust[selected]
    here = NormalFrame.of(at)
    if here.size == 0:
        raise InputError(f"at least {at.shape[1] + 1} points must be distinct; got {len(at)} equal ones")
    there = NormalFrame(centre=to.mean(axis=0), size=here.size)
    chosen = None if control is None else here.inward(require_points("control", control, at.shape[1]))
    basis = spline_basis(here.inward(at), control=chosen)
    distinct = len(np.unique(at, axis=0))
    if bending == 0 and distinct < len(basis.control):
        raise InputError(
            f"bending must be positive where control points are more than distinct points; got "
            f"{len(basis.control)} and {distinct}"
        )
    stiffness = bending / here.size ** (4 - at.shape[1])
    return _outward(basis.spline(basis.coordinates(there.inward(to), bending=stiffness, weights=trust)), here, there)


def _outward(spline: ThinPlateSpline, here: NormalFrame, there: NormalFrame) -> ThinPlateSpline:
    """The map between the units of two frames of equal size."""
    weights, shift = spline.weights, there.outward(spline.affine[0]) - here.centre @ spline.affine[1:]
    if spline.control.shape[1] == 2:
        # The term r**2 log(size) of (r / size)**2 log(r / size) sums to a constant over all control points.
        shift = shift - here.size * np.log(here.size) * ((spline.control**2).sum(axis=1) @ weights)
        weights = weights / here.size
    affine = np.vstack([shift, spline.affine[1:]])
    return ThinPlateSpline(control=here.outward(spline.control), weights=weights, affine=affine)


def kernel(points: Floats, control: Floats) -> Floats:
    """``r**2 log r`` in the plane, ``-r`` in space, between two sets of points, shape (n, k)."""
    if points.shape[1] == 3:
        return np.asarray(-scipy.spatial.distance.cdist(points, control))
    squared = scipy.spatial.distance.cdist(points, control, "sqeuclidean")
    return np.asarray(0.5 * squared * np.log(np.maximum(squared, 1e-300)))


def _kernel_rate(distance: Floats, dimension: int) -> Floats:
    """``U'(r) / r``; times the vector from the control point, it is the kernel's gradient."""
    if dimension == 3:
        return np.asarray(np.where(distance > 0, -1 / np.maximum(distance, 1e-300), 0.0))
    return np.asarray(2 * np.log(np.maximum(distance, 1e-300)) + 1)


def spread_out(points: Floats, count: int) -> Floats:
    """At most ``count`` distinct points, each the farthest from those before it."""
    return points[spread_indices(points, count)]


def spread_indices(points: Floats, count: int) -> Integers:
    """Indices of at most ``count`` distinct points, each the farthest from those before it."""
    first = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    return _farthest_first(np.ascontiguousarray(points, dtype=float), first, min(count, len(points)))


@fused
def _farthest_first(points: Floats, first: int, count: int) -> Integers:
    chosen = np.empty(count, dtype=np.int64)
    nearest = np.full(len(points), np.inf)
    at, length = first, 0
    while length < count:
        chosen[length] = at
        length += 1
        farthest = 0
        for i in range(len(points)):
            squared = 0.0
            for axis in range(points.shape[1]):
                squared += (points[i, axis] - points[at, axis]) ** 2
            nearest[i] = min(nearest[i], squared)
            if nearest[i] > nearest[farthest]:
                farthest = i
        if nearest[farthest] == 0.0:
            break
        at = farthest
    return chosen[:length]


def spread_order(points: Floats) -> Integers:
    """All indices, each point the farthest from those before it."""
    first = spread_indices(points, len(points))
    return np.concatenate([first, np.setdiff1d(np.arange(len(points)), first)])
