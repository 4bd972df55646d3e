"""Two independent generators of trials for `benchmarks.matching.trust`: one to calibrate with, the other to test on.

The calibration generator draws Fourier outlines and bends them by Gaussian bumps; the test generator draws teeth, eggs,
splines and patches and bends them by sines and stretches. They have no shape and no deformation in common.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from benchmarks.matching.distort import SHAPES, Distortion, Trial, distort
from scipy.interpolate import CubicSpline

from tsis.matching.methods import UNMATCHED

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Floats: TypeAlias = "NDArray[np.float64]"

FAMILIES = ("oval", "lobes", "contour", "open", "clusters", "symmetric")
DEGRADATIONS = ("deformation", "noise", "outliers", "occlusion", "rotation")
LONGEST_SIDE, MIDDLE = 0.75, 0.6  # of the unit box, as of the public shapes
ANGLE = np.linspace(0, 2 * np.pi, 1500)


@dataclass(frozen=True, slots=True, kw_only=True)
class Degradation:
    """Strength of one trial's deformation and of what comes on top; lengths in unit boxes."""

    bending: float
    affine: float
    noise: float = 0.0
    outliers: float = 0.0
    occluded: float = 0.0
    patch: bool = False
    rotation_deg: float = 0.0


def trust_trial(generator: str, family: str, degradation: str, number: int, *, seed: int) -> Trial:
    """Trial ``number`` of a family and degradation; it does not depend on other trials."""
    key = [seed, ("calibration", "test").index(generator), FAMILIES.index(family), DEGRADATIONS.index(degradation)]
    rng = np.random.default_rng([*key, number])
    shapes, bend = (_CALIBRATION, _bumps) if generator == "calibration" else (_TEST, _waves)
    shape = _fitted(shapes[family](int(rng.integers(80, 121)), rng))
    name = f"{generator}/{family}/{degradation}/{number}"
    return bend(shape, _drawn(degradation, rng), rng, name)


def _drawn(degradation: str, rng: np.random.Generator) -> Degradation:
    if degradation == "deformation":
        return Degradation(bending=rng.uniform(0.02, 0.07), affine=rng.uniform(0.05, 0.2))
    bending, affine = 0.04, 0.15
    if degradation == "noise":
        return Degradation(bending=bending, affine=affine, noise=rng.uniform(0.01, 0.05))
    if degradation == "outliers":
        return Degradation(bending=bending, affine=affine, outliers=rng.uniform(0.2, 2.0))
    if degradation == "occlusion":
        hidden, patch = rng.uniform(0.1, 0.4), bool(rng.integers(2))
        return Degradation(bending=bending, affine=affine, occluded=hidden, patch=patch)
    return Degradation(bending=bending, affine=affine, rotation_deg=rng.uniform(0.0, 180.0))


def _bumps(shape: Floats, strength: Degradation, rng: np.random.Generator, name: str) -> Trial:
    """Gaussian bumps and a normal affine map, as in the public trials."""
    distortion = Distortion(
        bending=strength.bending,
        affine=strength.affine,
        noise_sd=strength.noise,
        outlier_ratio=strength.outliers,
        rotation_deg=strength.rotation_deg,
        occluded=strength.occluded,
        occlusion="patch" if strength.patch else "scattered",
    )
    return distort(shape, distortion, rng=rng, name=name)


def _waves(shape: Floats, strength: Degradation, rng: np.random.Generator, name: str) -> Trial:
    """Sines of random directions, a stretch along a random axis and a shear; outliers uniform or in clusters."""
    middle = shape.mean(axis=0)
    offset = shape - middle
    direction = rng.uniform(0, 2 * np.pi)
    axis = np.array([np.cos(direction), np.sin(direction)])
    offset = offset + np.expm1(rng.normal(0, strength.affine)) * np.outer(offset @ axis, axis)
    offset[:, 0] += rng.normal(0, 0.7 * strength.affine) * offset[:, 1]
    for _ in range(4):
        heading, wavelength = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.6)
        phase = 2 * np.pi * (offset @ [np.cos(heading), np.sin(heading)] / wavelength + rng.uniform())
        offset = offset + np.sin(phase)[:, None] * rng.normal(0, 0.55 * strength.bending, 2)
    turn = np.radians(strength.rotation_deg) * rng.choice([-1.0, 1.0]) + rng.normal(0, strength.affine / 2)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    moved = offset @ rotation + middle + rng.normal(0, 0.1, 2)
    return _observed(shape, moved, strength, rng, name)


def _observed(source: Floats, moved: Floats, strength: Degradation, rng: np.random.Generator, name: str) -> Trial:
    hidden = int(strength.occluded * len(source))
    order = rng.permutation(len(source))
    if strength.patch:
        order = np.argsort(np.linalg.norm(moved - moved[order[0]], axis=1))
    seen = np.sort(order[hidden:])
    stray = _stray(moved[seen], int(strength.outliers * len(source)), rng)
    clean = np.concatenate([moved[seen], stray])
    target = clean + np.where(np.arange(len(clean))[:, None] < len(seen), rng.normal(0, strength.noise, clean.shape), 0)
    shuffle = rng.permutation(len(clean))
    truth = np.full(len(source), UNMATCHED)
    truth[seen] = np.argsort(shuffle)[: len(seen)]
    return Trial(source=source, target=target[shuffle], target_clean=clean[shuffle], truth=truth, name=name)


def _stray(points: Floats, count: int, rng: np.random.Generator) -> Floats:
    """Outliers over a box about the points, or, every other time, in two to four clusters."""
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
    if rng.integers(2):
        return np.asarray(rng.uniform(low, high, (count, 2)))
    centres = rng.uniform(low, high, (int(rng.integers(2, 5)), 2))
    return np.asarray(centres[rng.integers(len(centres), size=count)] + rng.normal(0, 0.07, (count, 2)))


def clutter_trial(number: int, *, clustered: bool, seed: int, ratio: float = 3.0) -> Trial:
    """A test contour, open curve or cluster with ``ratio`` outliers an inlier, uniform or in clusters."""
    rng = np.random.default_rng([seed, 77, int(clustered), number])
    family = ("contour", "open", "clusters")[number % 3]
    shape = _fitted(_TEST[family](int(rng.integers(80, 121)), rng))
    plain = _waves(shape, Degradation(bending=0.04, affine=0.1), rng, "")
    inliers = plain.target_clean[plain.truth]
    low, high = inliers.min(axis=0) - 0.1, inliers.max(axis=0) + 0.1
    count = int(ratio * len(shape))
    stray = rng.uniform(low, high, (count, 2))
    if clustered:
        centres = rng.uniform(low, high, (5, 2))
        stray = centres[rng.integers(5, size=count)] + rng.normal(0, 0.08, (count, 2))
    clean = np.concatenate([inliers, stray])
    shuffle = rng.permutation(len(clean))
    truth = np.argsort(shuffle)[: len(shape)]
    kind = "clustered" if clustered else "uniform"
    return Trial(
        source=shape,
        target=clean[shuffle],
        target_clean=clean[shuffle],
        truth=truth,
        name=f"test/clutter/{kind}/{number}",
    )


def _fitted(points: Floats) -> Floats:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - (low + high) / 2) * (LONGEST_SIDE / (high - low).max()) + MIDDLE)


def _evenly(line: Floats, count: int, *, closed: bool) -> Floats:
    """Points evenly along a polyline, whose ends coincide where it is closed."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count + closed)[:count]
    return np.column_stack([np.interp(at, length, line[:, axis]) for axis in range(2)])


def _polar(radius: Floats, count: int, rng: np.random.Generator, *, narrowest: float = 0.6) -> Floats:
    """A closed outline from radii at `ANGLE`, narrowed across and turned."""
    turn = rng.uniform(0, 2 * np.pi)
    line = radius[:, None] * np.column_stack([np.cos(ANGLE), np.sin(ANGLE)]) * [1.0, rng.uniform(narrowest, 1.0)]
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    return _evenly(line @ rotation, count, closed=True)


def _harmonics(orders: range, size: float, rng: np.random.Generator) -> Floats:
    order = np.array(orders)
    return np.asarray(
        rng.normal(0, size, len(order)) @ np.cos(order[:, None] * ANGLE + rng.uniform(0, 7, (len(order), 1)))
    )


def _fourier_oval(count: int, rng: np.random.Generator) -> Floats:
    return _polar(1 + _harmonics(range(2, 6), rng.uniform(0.0, 0.06), rng), count, rng, narrowest=0.45)


def _fourier_lobes(count: int, rng: np.random.Generator) -> Floats:
    lobes = 1 + rng.uniform(0.1, 0.35) * np.cos(rng.integers(3, 10) * ANGLE)
    return _polar(lobes + _harmonics(range(1, 5), rng.uniform(0.0, 0.06), rng), count, rng)


def _fourier_symmetric(count: int, rng: np.random.Generator) -> Floats:
    size = rng.uniform(0.1, 0.3) * rng.integers(0, 2)
    return _polar(1 + size * np.cos(rng.integers(2, 8) * ANGLE), count, rng, narrowest=1.0)


def _wandering(count: int, rng: np.random.Generator) -> Floats:
    bends = np.cumsum(rng.normal(0, 1.0, 12))
    heading = CubicSpline(np.linspace(0, 1, 12), bends)(np.linspace(0, 1, 600))
    line = np.cumsum(np.column_stack([np.cos(heading), np.sin(heading)]), axis=0)
    return _evenly(line, count, closed=False)


def _blobs(count: int, rng: np.random.Generator) -> Floats:
    centres = rng.uniform(0, 1, (int(rng.integers(3, 7)), 2))
    return np.asarray(centres[rng.integers(len(centres), size=count)] + rng.normal(0, 0.08, (count, 2)))


def _egg(count: int, rng: np.random.Generator) -> Floats:
    """A superellipse, narrower at one end, with up to three dents."""
    power, taper = rng.uniform(1.7, 3.0), rng.uniform(-0.25, 0.25)
    radius = (np.abs(np.cos(ANGLE)) ** power + np.abs(np.sin(ANGLE)) ** power) ** (-1 / power)
    for _ in range(rng.integers(0, 4)):
        away = np.angle(np.exp(1j * (ANGLE - rng.uniform(0, 2 * np.pi))))
        radius = radius * (1 + rng.normal(0, 0.06) * np.exp(-((away / rng.uniform(0.2, 0.6)) ** 2)))
    line = radius[:, None] * np.column_stack([np.cos(ANGLE), rng.uniform(0.5, 1.0) * np.sin(ANGLE)])
    line[:, 1] *= 1 + taper * line[:, 0]
    return _evenly(line, count, closed=True)


def _gear(count: int, rng: np.random.Generator) -> Floats:
    """Three to nine teeth of about equal height and distance, flat or round, stretched."""
    teeth = int(rng.integers(3, 10))
    varied = rng.uniform(0.0, 0.2)
    position = 2 * np.pi * (np.arange(teeth) + rng.normal(0, varied / 4, teeth)) / teeth
    height = rng.uniform(0.15, 0.5) * (1 + rng.normal(0, varied, teeth))
    width, flat = rng.uniform(0.5, 1.0) * np.pi / teeth, rng.integers(1, 4)
    away = np.angle(np.exp(1j * (ANGLE[:, None] - position)))
    radius = 1 + np.exp(-(np.abs(away / width) ** (2 * flat))) @ height
    return _polar(radius, count, rng, narrowest=0.65)


def _knots(count: int, rng: np.random.Generator) -> Floats:
    """A periodic spline through radii that vary threefold."""
    knots = int(rng.integers(6, 11))
    radii = rng.uniform(0.35, 1.05, knots)
    spline = CubicSpline(np.linspace(0, 2 * np.pi, knots + 1), np.append(radii, radii[0]), bc_type="periodic")
    return _polar(np.maximum(spline(ANGLE), 0.2), count, rng)


def _polygon(count: int, rng: np.random.Generator) -> Floats:
    """A regular polygon or star, a rounded rectangle or a circle."""
    corners, kind = int(rng.integers(3, 9)), rng.integers(3)
    if kind == 2:
        power = rng.choice([2.0, 4.0])
        return _polar((np.abs(np.cos(ANGLE)) ** power + np.abs(np.sin(ANGLE)) ** power) ** (-1 / power), count, rng)
    step = np.pi / corners
    angle = step * np.arange(2 * corners + 1)
    radius = np.where(np.arange(2 * corners + 1) % 2, np.cos(step) if kind else 0.55, 1.0)
    return _evenly(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]), count, closed=True)


def _spline_curve(count: int, rng: np.random.Generator) -> Floats:
    through = rng.uniform(0, 1, (int(rng.integers(4, 8)), 2))
    line = CubicSpline(np.arange(len(through)), through)(np.linspace(0, len(through) - 1, 600))
    return _evenly(line, count, closed=False)


def _patches(count: int, rng: np.random.Generator) -> Floats:
    """Rings and rectangles of points of different size and density."""
    parts = np.sort(rng.integers(0, int(rng.integers(3, 6)), count))
    points = np.empty((count, 2))
    for part in np.unique(parts):
        number = int((parts == part).sum())
        if rng.integers(2):
            angle = rng.uniform(0, 2 * np.pi, number)
            points[parts == part] = rng.uniform(0.08, 0.2) * np.column_stack([np.cos(angle), np.sin(angle)])
        else:
            points[parts == part] = rng.uniform(-1, 1, (number, 2)) * rng.uniform(0.05, 0.2, 2)
        points[parts == part] += rng.uniform(0, 1, 2)
    return points


def _fourier_contour(count: int, rng: np.random.Generator) -> Floats:
    return SHAPES["curve"](count, rng=rng)


_CALIBRATION: dict[str, Callable[[int, np.random.Generator], Floats]] = {
    "oval": _fourier_oval,
    "lobes": _fourier_lobes,
    "contour": _fourier_contour,
    "open": _wandering,
    "clusters": _blobs,
    "symmetric": _fourier_symmetric,
}
_TEST: dict[str, Callable[[int, np.random.Generator], Floats]] = {
    "oval": _egg,
    "lobes": _gear,
    "contour": _knots,
    "open": _spline_curve,
    "clusters": _patches,
    "symmetric": _polygon,
}
