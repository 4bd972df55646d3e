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
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import betaln, gammaln

from tsis.matching._fit import UNMATCHED
from tsis.matching._spline import spread_out

if TYPE_CHECKING:
    from tsis.matching._fit import Floats, Integers

WIDTHS = (0.5, 0.9, 1.6)  # of the displacement field, in root-mean-square radii
AMPLITUDES = (0.02, 0.05, 0.1, 0.2, 0.4)  # standard deviations of the displacement
SIGMAS = (0.004, 0.008, 0.016, 0.03, 0.06, 0.11, 0.18)  # standard deviations of a measured coordinate
RANK, NEGLIGIBLE = 70, 1e-7  # of the kernels' factors
CONTROL_POINTS = 200
STRETCH = 0.3  # log ratio of the affine map's singular values
SCALE = 0.5  # log ratio of the normalised sets' sizes
PAIRED = 0.5  # sum of a point's soft pairs above which it has a partner


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothField:
    """Factors of the displacement field's covariance at the source's points, one for each width."""

    points: Floats  # shape (n, d)
    control: Floats  # points of the kernels, shape (c, d)
    factors: tuple[Floats, ...]  # shape (n, r) each; a factor times its transpose is the covariance
    weights: tuple[Floats, ...]  # kernel columns to factor, shape (c, r) each

    @classmethod
    def of(cls, points: Floats) -> SmoothField:
        """The factors at normalised points, shape (n, d)."""
        control = points if len(points) <= CONTROL_POINTS else spread_out(points, CONTROL_POINTS)
        factors, weights = [], []
        for width in WIDTHS:
            value, vector = np.linalg.eigh(gaussian_kernel(control, control, width))
            large = np.flatnonzero(value > NEGLIGIBLE * value[-1])[-RANK:]
            weights.append(vector[:, large] / np.sqrt(value[large]))
            factors.append(gaussian_kernel(points, control, width) @ weights[-1])
        return cls(points=points, control=control, factors=tuple(factors), weights=tuple(weights))


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
    return _evidence(field, rows, target[matches[rows]], target, matches, scatter=0.0, entropy=0.0, width=width)


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
    here, (count, dimension) = field.points[rows], partners.shape
    span = np.column_stack([np.ones(count), here])
    basis, triangle = np.linalg.qr(span)
    affine = np.linalg.solve(triangle, basis.T @ partners)
    size, stretch = size_and_stretch(affine[1:])
    rest = partners - span @ affine
    amplitudes, sigmas = np.square(AMPLITUDES)[:, None, None], np.square(SIGMAS)[None, :, None]
    chosen = [number for number, value in enumerate(WIDTHS) if width in (None, value)]
    logs, frees = [], []
    for factor in (field.factors[number] for number in chosen):
        free = factor[rows] - basis @ (basis.T @ factor[rows])
        frees.append((free, free.T @ free, free.T @ rest))
        value, vector = np.linalg.eigh(frees[-1][1])
        value = np.maximum(value, 0.0)
        along = ((vector.T @ frees[-1][2]) ** 2).sum(axis=1) / np.maximum(value, 1e-12) / size**2
        beyond = max(float((rest**2).sum()) / size**2 - float(along.sum()), 0.0) + scatter / size**2
        spread = amplitudes * value + sigmas
        flat = count - dimension - 1 - len(value)
        log = -0.5 * ((along / spread).sum(axis=2) + beyond / sigmas[..., 0])
        logs.append(log - 0.5 * dimension * (np.log(spread).sum(axis=2) + flat * np.log(sigmas[..., 0])))
    stacked = np.array(logs)
    best, number, level = np.unravel_index(int(np.argmax(stacked)), stacked.shape)
    top = float(stacked[best, number, level])
    _, normal, right = frees[best]
    ridge = (SIGMAS[level] / AMPLITUDES[number]) ** 2
    bends = np.linalg.solve(normal + ridge * np.eye(len(normal)), right)
    factor, weights = field.factors[chosen[best]], field.weights[chosen[best]]
    affine = np.linalg.solve(triangle, basis.T @ (partners - factor[rows] @ bends))
    freedom = (count - dimension - 1) * dimension
    log_density = top + math.log(float(np.exp(stacked - top).sum())) - math.log(len(WIDTHS) * stacked[0].size)
    log_density -= freedom * (0.5 * math.log(2 * math.pi) + math.log(size))
    return PoseEvidence(
        log=log_density
        + entropy
        + _affine_prior(size, stretch, count, dimension)
        + _count_prior(count, len(field.points), target),
        affine=affine,
        kernel_weights=weights @ bends,
        width=WIDTHS[chosen[best]],
        amplitude=AMPLITUDES[number] * size,
        sigma=SIGMAS[level] * size,
        paired=count,
        moved=affine[0] + field.points @ affine[1:] + factor @ bends,
        matches=matches,
    )


def unrelated_evidence(target: Floats) -> float:
    """Log probability of the target without any partner: uniform in its box, or one normal cloud."""
    count, dimension = target.shape
    box = float(np.log(np.ptp(target, axis=0)).sum())
    _, volume = np.linalg.slogdet(np.cov(target, rowvar=False, bias=True))
    cloud = 0.5 * (dimension * math.log(2 * math.pi * math.e) + float(volume))
    return float(betaln(1, count + 1) - count * min(box, cloud))


def size_and_stretch(matrix: Floats) -> tuple[float, float]:
    """Geometric mean of a matrix's singular values, and the log of their largest ratio."""
    value = np.maximum(np.linalg.svd(matrix, compute_uv=False), 1e-6)
    return float(np.exp(np.log(value).mean())), float(np.log(value[0] / value[-1]))


def _affine_prior(size: float, stretch: float, count: int, dimension: int) -> float:
    log = -0.5 * (math.log(size) / SCALE) ** 2
    log -= (dimension + 1) * math.log1p((stretch / STRETCH) ** 2)
    return log - 0.5 * dimension * (dimension + 1) * math.log(count)


def _count_prior(count: int, source: int, target: Floats) -> float:
    """Log probability of which points have partners, and of the targets without one, uniform in their box."""
    stray = max(len(target) - count, 0)
    log = float(betaln(count + 1, stray + 1) + gammaln(source - count + 1) - gammaln(source + 1))
    return log - stray * float(np.log(np.ptp(target, axis=0)).sum())
