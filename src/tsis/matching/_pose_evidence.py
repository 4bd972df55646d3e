"""Evidence of a pose: probability of the target under a smooth random deformation about that pose.

The map of a pose is a similarity, a stretch, and a displacement field drawn from a Gaussian process, whose kernel is a
Gaussian of one of several widths. Measured positions have one standard deviation, at least `SIGMAS[0]`. Points of
either set may lack a partner. All poses are compared under the same widths, amplitudes and standard deviations, which
are summed over. A pose therefore pays for its bending, for its effective degrees of freedom (half the log determinant)
and for points without partner, and gains nothing from residuals below the standard deviation of the measurement.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import betaln

from tsis.compiled import fused
from tsis.matching._fit import UNMATCHED
from tsis.matching._spline import spread_out

if TYPE_CHECKING:
    from tsis.matching._fit import Floats, Integers

WIDTHS = (0.5, 0.9, 1.6)  # of the displacement field, in root-mean-square radii
AMPLITUDES = (0.02, 0.05, 0.1, 0.2, 0.4)  # standard deviations of the displacement
SIGMAS = (0.004, 0.008, 0.016, 0.03, 0.06, 0.11, 0.18)  # standard deviations of a measured coordinate
RANK, NEGLIGIBLE = 70, 1e-7  # of the kernels' factors
CONTROL_POINTS = 200
VARIANCES, SQUARES = np.square(AMPLITUDES), np.square(SIGMAS)
STRETCH = 0.3  # log ratio of the affine map's singular values
SCALE = 0.5  # log ratio of the normalised sets' sizes
PAIRED = 0.5  # sum of a point's soft pairs above which it has a partner


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothField:
    """Factors of the displacement field's covariance at the source's points, one for each width."""

    points: Floats  # shape (n, d)
    control: Floats  # points of the kernels, shape (c, d)
    designs: tuple[Floats, ...]  # one, the coordinates, and the factor; shape (n, 1 + d + r) each
    weights: tuple[Floats, ...]  # kernel columns to factor, shape (c, r) each
    # pairs that were judged before, which a search proposes again and again, with their target and evidence
    known: dict[tuple[bytes, float | None], tuple[Floats, PoseEvidence]] = dataclass_field(default_factory=dict)

    @property
    def factors(self) -> tuple[Floats, ...]:
        """Factors of the covariances, which are a factor times its transpose, shape (n, r) each."""
        return tuple(design[:, 1 + self.points.shape[1] :] for design in self.designs)

    @classmethod
    def of(cls, points: Floats) -> SmoothField:
        """The factors at normalised points, shape (n, d)."""
        control = points if len(points) <= CONTROL_POINTS else spread_out(points, CONTROL_POINTS)
        designs, weights = [], []
        for width in WIDTHS:
            value, vector = np.linalg.eigh(gaussian_kernel(control, control, width))
            large = np.flatnonzero(value > NEGLIGIBLE * value[-1])[-RANK:]
            weights.append(vector[:, large] / np.sqrt(value[large]))
            factor = gaussian_kernel(points, control, width) @ weights[-1]
            designs.append(np.column_stack([np.ones(len(points)), points, factor]))
        return cls(points=points, control=control, designs=tuple(designs), weights=tuple(weights))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PoseEvidence:
    """Log evidence of pairs, and the most probable map under them."""

    log: float
    affine: Floats  # shape (d + 1, d)
    kernel_weights: Floats  # of the field's control points, shape (c, d)
    width: float  # of the kernel
    amplitude: float  # standard deviation of the displacement, in radii of the target
    sigma: float  # standard deviation of a coordinate, in radii of the target
    paired: int  # points with a partner
    moved: Floats  # the source's points, shape (n, d)
    matches: Integers  # index of each point's partner, of soft pairs the heaviest, shape (n,)


def gaussian_kernel(points: Floats, control: Floats, width: float) -> Floats:
    """``exp(-|x - c|**2 / (2 width**2))`` between two sets of points, shape (n, c)."""
    return np.asarray(np.exp(-0.5 * cdist(points, control, "sqeuclidean") / width**2))


def soft_evidence(field: SmoothField, target: Floats, pairs: Floats) -> PoseEvidence | None:
    """Evidence of soft pairs, shape (n, m), with the Bethe entropy of what they leave open; None with too few."""
    sums = pairs.sum(axis=1)
    rows = np.flatnonzero(sums > PAIRED)
    if len(rows) <= field.points.shape[1] + 1:
        return None
    soft = pairs[rows] / sums[rows, None]
    partners = soft @ target
    scatter = float((soft @ (target**2).sum(axis=1)).sum() - (partners**2).sum())
    some = soft[soft > 1e-9]
    entropy = float((np.maximum(1 - some, 1e-300) * np.log(np.maximum(1 - some, 1e-300)) - some * np.log(some)).sum())
    matches = np.where(sums > PAIRED, pairs.argmax(axis=1), UNMATCHED)
    return _evidence(field, rows, partners, target, matches, scatter=max(scatter, 0.0), entropy=entropy)


def hard_evidence(
    field: SmoothField, target: Floats, matches: Integers, *, width: float | None = None
) -> PoseEvidence | None:
    """Evidence of one-to-one pairs; ``matches``, shape (n,), has each point's target or `UNMATCHED`.

    With one ``width`` of `WIDTHS` the others are left out of the sum, which makes it faster and hardly smaller.
    """
    rows = np.flatnonzero(matches != UNMATCHED)
    if len(rows) <= field.points.shape[1] + 1:
        return None
    key = (matches.tobytes(), width)
    known = field.known.get(key)
    if known is None or known[0] is not target:
        partners = target[matches[rows]]
        known = target, _evidence(field, rows, partners, target, matches, scatter=0.0, entropy=0.0, width=width)
        field.known[key] = known
    return known[1]


def _evidence(
    field: SmoothField,
    rows: Integers,
    partners: Floats,
    target: Floats,
    matches: Integers,
    *,
    scatter: float,
    entropy: float,
    width: float | None = None,
) -> PoseEvidence:
    count, dimension = partners.shape
    chosen = [number for number, value in enumerate(WIDTHS) if width in (None, value)]
    size, stretch, systems, logs = 0.0, 0.0, [], []
    for number in chosen:
        here = field.designs[number][rows]
        normal, right = here.T @ here, here.T @ partners
        systems.append((normal, right))
        inner, pull, affine, explained = _without_affine(normal, right)
        if not size:
            size, stretch = size_and_stretch(affine[1:])
            rest = max(float((partners**2).sum()) - explained, 0.0)
        logs.append(_levels(inner, pull, rest, scatter, size, count, VARIANCES, SQUARES))
    stacked = np.array(logs)
    best, number, level = (int(at) for at in np.unravel_index(int(np.argmax(stacked)), stacked.shape))
    top = float(stacked[best, number, level])
    solution = _ridge_solution(*systems[best], (SIGMAS[level] / AMPLITUDES[number]) ** 2)
    freedom = (count - dimension - 1) * dimension
    log_density = top + math.log(float(np.exp(stacked - top).sum())) - math.log(len(WIDTHS) * stacked[0].size)
    log_density -= freedom * (0.5 * math.log(2 * math.pi) + math.log(size))
    return PoseEvidence(
        log=log_density
        + entropy
        + _affine_prior(size, stretch, count, dimension)
        + _count_prior(count, len(field.points), target),
        affine=solution[: dimension + 1],
        kernel_weights=field.weights[chosen[best]] @ solution[dimension + 1 :],
        width=WIDTHS[chosen[best]],
        amplitude=AMPLITUDES[number] * size,
        sigma=SIGMAS[level] * size,
        paired=count,
        moved=field.designs[chosen[best]] @ solution,
        matches=matches,
    )


@fused
def _without_affine(normal: Floats, right: Floats) -> tuple[Floats, Floats, Floats, float]:
    """Normal matrix, shape (r, r), and right side, shape (r, d), of the bending after the affine part is fitted.

    Also the affine map alone, shape (d + 1, d), and the squares that it explains.
    """
    dimension = right.shape[1]
    affine = dimension + 1
    inner, pull = normal[affine:, affine:].copy(), right[affine:].copy()
    first, goal = normal[:affine].copy(), right[:affine].copy()
    explained = 0.0
    for pivot in range(affine):
        for row in range(pivot + 1, affine):
            share = first[row, pivot] / first[pivot, pivot]
            first[row] -= share * first[pivot]
            goal[row] -= share * goal[pivot]
        for row in range(len(inner)):
            share = first[pivot, affine + row] / first[pivot, pivot]
            for column in range(len(inner)):
                inner[row, column] -= share * first[pivot, affine + column]
            for axis in range(dimension):
                pull[row, axis] -= share * goal[pivot, axis]
        for axis in range(dimension):
            explained += goal[pivot, axis] ** 2 / first[pivot, pivot]
    for pivot in range(affine - 1, -1, -1):
        for column in range(pivot + 1, affine):
            goal[pivot] -= first[pivot, column] * goal[column]
        goal[pivot] /= first[pivot, pivot]
    return inner, pull, goal, explained


@fused
def _levels(
    inner: Floats,
    pull: Floats,
    rest: float,
    scatter: float,
    size: float,
    count: int,
    amplitudes: Floats,
    sigmas: Floats,
) -> Floats:
    """Log density of the residuals at each variance of the displacement and of a coordinate, shape (a, s)."""
    rank, dimension = pull.shape
    diagonal, beside, along = _tridiagonal(inner, pull)
    flat = count - dimension - 1 - rank
    logs = np.empty((len(amplitudes), len(sigmas)))
    before = np.empty(dimension)
    for number in range(len(amplitudes)):
        for level in range(len(sigmas)):
            ridge = sigmas[level] / amplitudes[number]
            explained, volume, product, pivot = 0.0, 0.0, 1.0, 1.0
            before[:] = 0.0
            for k in range(rank):
                share = beside[k - 1] / pivot if k else 0.0
                pivot = diagonal[k] + ridge - (share * beside[k - 1] if k else 0.0)
                product *= pivot
                if k % 8 == 7:
                    volume += np.log(product)
                    product = 1.0
                for axis in range(dimension):
                    before[axis] = along[k, axis] - share * before[axis]
                    explained += before[axis] ** 2 / pivot
            volume += np.log(product) + rank * np.log(amplitudes[number])
            away = (max(rest - explained, 0.0) + scatter) / (size * size * sigmas[level])
            logs[number, level] = -0.5 * (away + dimension * (volume + flat * np.log(sigmas[level])))
    return logs


@fused
def _tridiagonal(inner: Floats, pull: Floats) -> tuple[Floats, Floats, Floats]:
    """Diagonal and secondary diagonal of a symmetric matrix under reflections (Householder), and the right side."""
    matrix, along = inner.copy(), pull.copy()
    rank, dimension = along.shape
    beside = np.zeros(max(rank - 1, 0))
    mirror, image = np.zeros(rank), np.zeros(rank)
    for k in range(rank - 1):
        norm = 0.0
        for i in range(k + 1, rank):
            mirror[i] = matrix[k, i]
            norm += mirror[i] ** 2
        norm = np.sqrt(norm)
        if norm == 0.0:
            continue
        beside[k] = -norm if mirror[k + 1] > 0 else norm
        scale = 1 / (norm * (norm + abs(mirror[k + 1])))
        mirror[k + 1] -= beside[k]
        for i in range(k + 1, rank):
            image[i] = 0.0
        for i in range(k + 1, rank):
            share = scale * mirror[i]
            for j in range(k + 1, rank):
                image[j] += share * matrix[i, j]
        overlap = 0.0
        for i in range(k + 1, rank):
            overlap += image[i] * mirror[i]
        for i in range(k + 1, rank):
            image[i] -= 0.5 * scale * overlap * mirror[i]
        for i in range(k + 1, rank):
            for j in range(k + 1, rank):
                matrix[i, j] -= mirror[i] * image[j] + image[i] * mirror[j]
        for axis in range(dimension):
            overlap = 0.0
            for i in range(k + 1, rank):
                overlap += mirror[i] * along[i, axis]
            for i in range(k + 1, rank):
                along[i, axis] -= scale * overlap * mirror[i]
    return np.diag(matrix).copy(), beside, along


@fused
def _ridge_solution(normal: Floats, right: Floats, ridge: float) -> Floats:
    """Coordinates of the map, shape (1 + d + r, d), with a ridge on all but its affine part, by elimination."""
    upper, result = normal.copy(), right.copy()
    rank, dimension = result.shape
    for k in range(dimension + 1, rank):
        upper[k, k] += ridge
    for k in range(rank):
        for i in range(k + 1, rank):
            share = upper[k, i] / upper[k, k]
            for j in range(i, rank):
                upper[i, j] -= share * upper[k, j]
            for axis in range(dimension):
                result[i, axis] -= share * result[k, axis]
    for k in range(rank - 1, -1, -1):
        for axis in range(dimension):
            total = result[k, axis]
            for j in range(k + 1, rank):
                total -= upper[k, j] * result[j, axis]
            result[k, axis] = total / upper[k, k]
    return result


def unrelated_evidence(target: Floats) -> float:
    """Log probability of the target without any partner: uniform in its box, or one normal cloud."""
    count, dimension = target.shape
    box = float(np.log(np.ptp(target, axis=0)).sum())
    _, volume = np.linalg.slogdet(np.cov(target, rowvar=False, bias=True))
    cloud = 0.5 * (dimension * math.log(2 * math.pi * math.e) + float(volume))
    return float(betaln(1, count + 1) - count * min(box, cloud))


def size_and_stretch(matrix: Floats) -> tuple[float, float]:
    """Geometric mean of a matrix's singular values, and the log of their largest ratio."""
    if len(matrix) == 2:
        (a, b), (c, d) = matrix.tolist()
        same, opposite = math.hypot(a + d, c - b), math.hypot(a - d, c + b)
        most, least = max((same + opposite) / 2, 1e-6), max(abs(same - opposite) / 2, 1e-6)
        return math.sqrt(most * least), math.log(most / least)
    value = np.maximum(np.linalg.svd(matrix, compute_uv=False), 1e-6)
    return float(np.exp(np.log(value).mean())), float(np.log(value[0] / value[-1]))


def _affine_prior(size: float, stretch: float, count: int, dimension: int) -> float:
    log = -0.5 * (math.log(size) / SCALE) ** 2
    log -= (dimension + 1) * math.log1p((stretch / STRETCH) ** 2)
    return log - 0.5 * dimension * (dimension + 1) * math.log(count)


def _count_prior(count: int, source: int, target: Floats) -> float:
    """Log probability of which points have partners, and of the targets without one, uniform in their box."""
    stray = max(len(target) - count, 0)
    log = math.lgamma(count + 1) + math.lgamma(stray + 1) - math.lgamma(count + stray + 2)
    log += math.lgamma(source - count + 1) - math.lgamma(source + 1)
    return log - stray * float(np.log(target.max(axis=0) - target.min(axis=0)).sum())
