"""Thin-plate splines in two and three dimensions: regularised, weighted, with as many control points as one likes.

A spline is an affine map plus ``sum_c w_c U(|x - c|)`` over its control points c, with the kernel ``U(r) = r**2 log r``
in the plane and ``-r`` in space (the dissertation prints ``r**3 log r**3``, which bends infinitely at its control
points in no dimension that it is used in). It minimises ``sum_i v_i |y_i - f(x_i)|**2 + bending * J(f)``, J being the
bending energy, a quadratic form of the w_c.

The work that depends on the points alone is done once, in `SplineBasis`: its coordinates make the bending energy the
sum of their squares, so that a fit is a ridge regression, and no rotation of the points changes it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

from tsis.model import check
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

CONTROL_POINTS = 300  # more of them only cost time: between them a smooth deformation has nothing left to tell
JITTER = 1e-12  # of the largest eigenvalue, lest rounding makes the bending energy negative
ANCHOR = 1e-12  # ridge on the affine part, of the whole weight: no weight at all leaves the points where they are


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThinPlateSpline:
    """A smooth map of the plane or of space.

    Attributes
    ----------
    control
        Control points c, shape (k, d), d being 2 or 3.
    weights
        Their weights w, shape (k, d); orthogonal to 1 and to the coordinates of the control points.
    affine
        Row 0 is the translation, the rows below it are the matrix that points, as rows, are multiplied by;
        shape (d + 1, d).
    """

    control: NDArray[np.float64]
    weights: NDArray[np.float64]
    affine: NDArray[np.float64]

    def __call__(self, points: ArrayLike) -> NDArray[np.float64]:
        """Where ``points``, shape (n, d), go."""
        at = _points("points", points, self.control.shape[1])
        return np.asarray(kernel(at, self.control) @ self.weights + self.affine[0] + at @ self.affine[1:])

    def gradient(self, points: ArrayLike) -> NDArray[np.float64]:
        """Derivatives ``[n, i, j] = d f_i / d x_j`` at ``points``, shape (n, d, d)."""
        at = _points("points", points, self.control.shape[1])
        away = at[:, None, :] - self.control[None, :, :]
        rate = _kernel_rate(np.linalg.norm(away, axis=2), at.shape[1])
        return np.asarray(self.affine[1:].T + np.einsum("ck,nc,ncj->nkj", self.weights, rate, away))

    @property
    def bending_energy(self) -> float:
        """The quadratic form of the weights that a fit keeps small."""
        return float(np.einsum("ck,cd,dk->", self.weights, kernel(self.control, self.control), self.weights))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SplineBasis:
    """All splines over the same control points, in coordinates in which bending is a sum of squares.

    Attributes
    ----------
    points
        The points that fits are asked at, shape (n, d).
    control
        Control points, shape (k, d).
    design
        Values at the points of the basis functions, shape (n, k): the first k - d - 1 bend, the last d + 1 are affine.
    weights_of
        Kernel weights of the bending coordinates, shape (k, k - d - 1).
    """

    points: NDArray[np.float64]
    control: NDArray[np.float64]
    design: NDArray[np.float64]
    weights_of: NDArray[np.float64]

    @property
    def bent(self) -> int:
        """How many coordinates bend."""
        return int(self.weights_of.shape[1])

    @property
    def rest(self) -> NDArray[np.float64]:
        """Coordinates of the map that leaves all points where they are, shape (k, d)."""
        return np.eye(self.design.shape[1], self.points.shape[1], -(self.bent + 1))

    def at(self, rows: NDArray[np.int64]) -> SplineBasis:
        """The same splines, fitted at some of the points."""
        return replace(self, points=self.points[rows], design=self.design[rows])

    def coordinates(
        self, targets: NDArray[np.float64], *, bending: float, weights: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Coordinates of the spline that takes the points to ``targets``, shape (k, d); unchecked, for inner loops."""
        weighted = self.design if weights is None else self.design * weights[:, None]
        normal = weighted.T @ self.design
        ridge = np.full(len(normal), bending)
        ridge[self.bent :] = ANCHOR * max(float(np.trace(normal)), 1e-300)
        right = weighted.T @ targets + self._still(ridge)
        normal[np.diag_indices_from(normal)] += ridge
        return np.asarray(
            cho_solve(cho_factor(normal, overwrite_a=True, check_finite=False), right, check_finite=False)
        )

    def _still(self, ridge: NDArray[np.float64]) -> NDArray[np.float64]:
        """Right-hand side of the affine ridge, which draws to the identity."""
        right = np.zeros((len(ridge), self.points.shape[1]))
        right[self.bent + 1 :] = np.diag(ridge[self.bent + 1 :])
        return right

    def spline(self, coordinates: NDArray[np.float64]) -> ThinPlateSpline:
        """The spline of ``coordinates``, shape (k, d)."""
        return ThinPlateSpline(
            control=self.control,
            weights=self.weights_of @ coordinates[: self.bent],
            affine=coordinates[self.bent :],
        )


def spline_basis(points: ArrayLike, *, control: ArrayLike | None = None) -> SplineBasis:
    """Basis of the splines that are fitted at ``points``.

    Parameters
    ----------
    points
        Shape (n, d), d being 2 or 3, n at least d + 1, not all in a line or plane.
    control
        Control points, shape (k, d); by default the points, or `CONTROL_POINTS` of them that lie far apart.

    Raises
    ------
    InputError
        When the shapes do not fit or the control points lie in a line or plane.
    """
    points = _points("points", points)
    dimension = points.shape[1]
    chosen = spread_out(points, CONTROL_POINTS) if control is None else _points("control", control, dimension)
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
    """The thin-plate spline that takes ``points`` near ``targets`` and bends little (5.14-5.16, kernel corrected).

    Parameters
    ----------
    points, targets
        Shape (n, d) each, d being 2 or 3, in any unit.
    bending
        How much bending is held back, in [0, 1e12], in units of the points squared; 0 interpolates, where every point
        is a control point.
    weights
        Trust in each pair, shape (n,), not negative; 1 by default.
    control
        Control points, shape (k, d); by default the points, or `CONTROL_POINTS` of them that lie far apart.

    Raises
    ------
    InputError
        When the shapes do not fit, a value is out of range, or the points lie in a line or plane.

    Examples
    --------
    >>> corners = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    >>> spline = fit_spline(corners, [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [2.0, 1.0]])
    >>> spline([[0.5, 0.5]]).round(6).tolist()
    [[1.0, 0.5]]
    """
    basis = spline_basis(points, control=control)
    targets = _points("targets", targets, basis.points.shape[1])
    if len(targets) != len(basis.points):
        raise InputError(f"targets must be as many as the points, {len(basis.points)}; got {len(targets)}")
    check.number("bending", bending, 0.0, 1e12)
    trust = None if weights is None else check.array("weights", weights, ndim=1)
    if trust is not None and (len(trust) != len(targets) or trust.min() < 0 or trust.max() == 0):
        raise InputError(f"weights must be {len(targets)} numbers that are not negative, one of them positive")
    return basis.spline(basis.coordinates(targets, bending=bending, weights=trust))


def kernel(points: NDArray[np.float64], control: NDArray[np.float64]) -> NDArray[np.float64]:
    """``r**2 log r`` in the plane, ``-r`` in space, between two sets of points, shape (n, k)."""
    if points.shape[1] == 3:
        return np.asarray(-cdist(points, control))
    squared = cdist(points, control, "sqeuclidean")
    return np.asarray(0.5 * squared * np.log(np.maximum(squared, 1e-300)))


def _kernel_rate(distance: NDArray[np.float64], dimension: int) -> NDArray[np.float64]:
    """``U'(r) / r``: it times the vector from the control point is the kernel's gradient."""
    if dimension == 3:
        return np.asarray(np.where(distance > 0, -1 / np.maximum(distance, 1e-300), 0.0))
    return np.asarray(2 * np.log(np.maximum(distance, 1e-300)) + 1)


def spread_out(points: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """At most ``count`` of the points, no two in one place, each the farthest from those before it."""
    return points[far_apart(points, count)]


def far_apart(points: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """Indices of at most ``count`` of the points, no two in one place, each the farthest from those before it."""
    first = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    chosen, nearest = [first], np.linalg.norm(points - points[first], axis=1)
    while len(chosen) < min(count, len(points)):
        farthest = int(np.argmax(nearest))
        if nearest[farthest] == 0:
            break
        chosen.append(farthest)
        nearest = np.minimum(nearest, np.linalg.norm(points - points[farthest], axis=1))
    return np.array(chosen)


def _points(name: str, value: ArrayLike, dimension: int | None = None) -> NDArray[np.float64]:
    points = check.array(name, value, ndim=2)
    if points.shape[1] not in ((2, 3) if dimension is None else (dimension,)):
        wanted = "2 or 3" if dimension is None else str(dimension)
        raise InputError(f"{name} must have {wanted} coordinates each; got shape {points.shape}")
    return points


__all__ = [
    "CONTROL_POINTS",
    "SplineBasis",
    "ThinPlateSpline",
    "far_apart",
    "fit_spline",
    "kernel",
    "spline_basis",
    "spread_out",
]
