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
import scipy

from tsis.compiled import fused
from tsis.matching.methods import ALIGNED, UNMATCHED, normal_matrix, ridge_map
from tsis.matching.spline import spread_out

if TYPE_CHECKING:
    from tsis.matching.methods import Floats, Integers


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
    return np.asarray(np.exp(-0.5 * scipy.spatial.distance.cdist(points, control, "sqeuclidean") / width**2))


def soft_evidence(field: SmoothField, target: Floats, pairs: Floats) -> PoseEvidence | None:
    """Evidence of soft pairs, shape (n, m), with the Bethe entropy of what they leave open; None with too few."""
    matches, partners, scatter, entropy = _soft_partners(pairs, target)
    rows = np.flatnonzero(matches != UNMATCHED)
    if len(rows) <= field.points.shape[1] + 1:
        return None
    return paired_evidence(field, rows, partners[rows], target, matches, scatter=max(scatter, 0.0), entropy=entropy)


@fused
def _soft_partners(pairs: Floats, target: Floats) -> tuple[Integers, Floats, float, float]:
    """Heaviest partner of each point, or -1, mean partners, shape (n, d), their scatter about it, and the entropy."""
    matches, partners = np.full(len(pairs), -1), np.zeros((len(pairs), target.shape[1]))
    scatter, entropy = 0.0, 0.0
    for i in range(len(pairs)):
        total = pairs[i].sum()
        if total <= PAIRED:
            continue
        matches[i] = pairs[i].argmax()
        for j in range(len(target)):
            share = pairs[i, j] / total
            if share == 0.0:
                continue
            for axis in range(target.shape[1]):
                partners[i, axis] += share * target[j, axis]
                scatter += share * target[j, axis] ** 2
            if share > 1e-9:
                rest = max(1 - share, 1e-300)
                entropy += rest * np.log(rest) - share * np.log(share)
        for axis in range(target.shape[1]):
            scatter -= partners[i, axis] ** 2
    return matches, partners, scatter, entropy


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
        known = target, paired_evidence(field, rows, partners, target, matches, scatter=0.0, entropy=0.0, width=width)
        field.known[key] = known
    return known[1]


def paired_evidence(
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
    """Evidence of the points ``rows`` with a partner each, over all widths of the kernel, or one.

    ``partners`` has shape (pairs, d); ``scatter`` is the sum of squares of soft partners about their mean, ``entropy``
    that of what they leave open; ``matches`` is kept for the answer.
    """
    count, dimension = partners.shape
    chosen = [number for number, value in enumerate(WIDTHS) if width in (None, value)]
    size, stretch, rest, systems, logs = 0.0, 0.0, 0.0, [], []
    for number in chosen:
        found, normal, right, size, stretch, rest = _width_logs(
            field.designs[number], rows, partners, scatter, size, stretch, rest, VARIANCES, SQUARES
        )
        systems.append((normal, right))
        logs.append(found)
    top, share, place = _total(logs[0] if len(logs) == 1 else np.concatenate(logs))
    best, number, level = place // logs[0].size, place // len(SIGMAS) % len(AMPLITUDES), place % len(SIGMAS)
    of, ridge = chosen[best], (SIGMAS[level] / AMPLITUDES[number]) ** 2
    affine, kernel_weights, moved = _best_map(*systems[best], ridge, field.designs[of], field.weights[of])
    freedom = (count - dimension - 1) * dimension
    log_density = top + share - math.log(len(WIDTHS) * logs[0].size)
    log_density -= freedom * (0.5 * math.log(2 * math.pi) + math.log(size))
    return PoseEvidence(
        log=log_density
        + entropy
        + _affine_prior(size, stretch, count, dimension)
        + _count_prior(count, len(field.points), target),
        affine=affine,
        kernel_weights=kernel_weights,
        width=WIDTHS[of],
        amplitude=AMPLITUDES[number] * size,
        sigma=SIGMAS[level] * size,
        paired=count,
        moved=moved,
        matches=matches,
    )


@fused
def _width_logs(
    design: Floats,
    rows: Integers,
    partners: Floats,
    scatter: float,
    size: float,
    stretch: float,
    rest: float,
    variances: Floats,
    squares: Floats,
) -> tuple[Floats, Floats, Floats, float, float, float]:
    """`_levels` of one width, the normal matrix and its right side; also size, stretch and rest, which 0 asks for."""
    normal, right = normal_matrix(design, rows, partners)
    inner, pull, affine, explained = _without_affine(normal, right)
    if size == 0:
        size, stretch = size_and_stretch(affine[1:])
        rest = max((partners**2).sum() - explained, 0.0)
    logs = _levels(inner, pull, rest, scatter, size, len(rows), variances, squares)
    return logs, normal, right, size, stretch, rest


@fused
def _total(logs: Floats) -> tuple[float, float, int]:
    """Largest of the logs, log of the sum of all over it, and its place in the flattened array."""
    flat = logs.ravel()
    place = int(flat.argmax())
    return flat[place], np.log(np.exp(flat - flat[place]).sum()), place


@fused
def _best_map(
    normal: Floats, right: Floats, ridge: float, design: Floats, weights: Floats
) -> tuple[Floats, Floats, Floats]:
    """Affine part, weights of the kernels and moved points of the map of a normal system."""
    solution = ridge_map(normal, right, ridge)
    affine = right.shape[1] + 1
    return solution[:affine].copy(), weights @ solution[affine:], design @ solution


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
    flat, levels = count - dimension - 1 - rank, len(amplitudes) * len(sigmas)
    ridge = np.empty(levels)
    for number in range(len(amplitudes)):
        ridge[number * len(sigmas) : (number + 1) * len(sigmas)] = sigmas / amplitudes[number]
    # all levels at once, so that the divisions of several run together
    explained, volume, product = np.zeros(levels), np.zeros(levels), np.ones(levels)
    pivot, before = np.ones(levels), np.zeros((dimension, levels))
    for k in range(rank):
        link = beside[k - 1] if k else 0.0
        for level in range(levels):
            pivot[level], ridge_share = diagonal[k] + ridge[level] - link * link / pivot[level], link / pivot[level]
            product[level] *= pivot[level]
            for axis in range(dimension):
                before[axis, level] = along[k, axis] - ridge_share * before[axis, level]
                explained[level] += before[axis, level] ** 2 / pivot[level]
        if k % 8 == 7 or k == rank - 1:
            volume += np.log(product)
            product[:] = 1.0
    logs = np.empty((len(amplitudes), len(sigmas)))
    for number in range(len(amplitudes)):
        for level in range(len(sigmas)):
            at = number * len(sigmas) + level
            away = (max(rest - explained[at], 0.0) + scatter) / (size * size * sigmas[level])
            space = volume[at] + rank * np.log(amplitudes[number]) + flat * np.log(sigmas[level])
            logs[number, level] = -0.5 * (away + dimension * space)
    return logs


@fused
def _tridiagonal(inner: Floats, pull: Floats) -> tuple[Floats, Floats, Floats]:
    """Diagonal and secondary diagonal of a symmetric matrix under reflections (Householder), and the right side."""
    along = pull.copy()
    rank, dimension = along.shape
    wide = -(-rank // ALIGNED) * ALIGNED
    matrix = np.zeros((rank, wide))
    matrix[:, :rank] = inner
    beside = np.zeros(max(rank - 1, 0))
    mirror, image = np.zeros(wide), np.zeros(wide)
    for k in range(rank - 1):
        norm = 0.0
        for i in range(k + 1, rank):
            mirror[i] = matrix[k, i]
            norm += mirror[i] ** 2
        norm = np.sqrt(norm)
        mirror[k] = 0.0
        if norm == 0.0:
            continue
        beside[k] = -norm if mirror[k + 1] > 0 else norm
        scale = 1 / (norm * (norm + abs(mirror[k + 1])))
        mirror[k + 1] -= beside[k]
        # what is left of column k + 1 is not used again
        left = (k + 1) // ALIGNED * ALIGNED
        mirror_left, image_left = mirror[left:], image[left:]
        image_left[:] = 0.0
        for i in range(k + 1, rank):
            share, row = scale * mirror[i], matrix[i, left:]
            for j in range(len(row)):
                image_left[j] += share * row[j]
        overlap = 0.0
        for i in range(k + 1, rank):
            overlap += image[i] * mirror[i]
        for i in range(k + 1, rank):
            image[i] -= 0.5 * scale * overlap * mirror[i]
        for i in range(k + 1, rank):
            mirrored, imaged, row = mirror[i], image[i], matrix[i, left:]
            for j in range(len(row)):
                row[j] -= mirrored * image_left[j] + imaged * mirror_left[j]
        for axis in range(dimension):
            overlap = 0.0
            for i in range(k + 1, rank):
                overlap += mirror[i] * along[i, axis]
            for i in range(k + 1, rank):
                along[i, axis] -= scale * overlap * mirror[i]
    return np.diag(matrix[:, :rank]).copy(), beside, along


def unrelated_evidence(target: Floats) -> float:
    """Log probability of the target without any partner: uniform in its box, or one normal cloud."""
    count, dimension = target.shape
    box = float(np.log(np.ptp(target, axis=0)).sum())
    _, volume = np.linalg.slogdet(np.cov(target, rowvar=False, bias=True))
    cloud = 0.5 * (dimension * math.log(2 * math.pi * math.e) + float(volume))
    return float(scipy.special.betaln(1, count + 1) - count * min(box, cloud))


@fused
def size_and_stretch(matrix: Floats) -> tuple[float, float]:
    """Geometric mean of a matrix's singular values, and the log of their largest ratio."""
    if len(matrix) == 2:
        same = np.hypot(matrix[0, 0] + matrix[1, 1], matrix[1, 0] - matrix[0, 1])
        opposite = np.hypot(matrix[0, 0] - matrix[1, 1], matrix[1, 0] + matrix[0, 1])
        most, least = max((same + opposite) / 2, 1e-6), max(abs(same - opposite) / 2, 1e-6)
        return np.sqrt(most * least), np.log(most / least)
    value = np.maximum(np.linalg.svd(matrix)[1], 1e-6)
    return np.exp(np.log(value).mean()), np.log(value[0] / value[-1])


def _affine_prior(size: float, stretch: float, count: int, dimension: int) -> float:
    log = -0.5 * (math.log(size) / SCALE) ** 2
    log -= (dimension + 1) * math.log1p((stretch / STRETCH) ** 2)
    return log - 0.5 * dimension * (dimension + 1) * math.log(count)


@fused
def _count_prior(count: int, source: int, target: Floats) -> float:
    """Log probability of which points have partners, and of the targets without one, uniform in their box."""
    stray = max(len(target) - count, 0)
    log = math.lgamma(count + 1) + math.lgamma(stray + 1) - math.lgamma(count + stray + 2)
    log += math.lgamma(source - count + 1) - math.lgamma(source + 1)
    for axis in range(target.shape[1]):
        log -= stray * np.log(target[:, axis].max() - target[:, axis].min())
    return log
