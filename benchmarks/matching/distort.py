"""Random shapes, and their distortions with the true matches.

The shapes differ from the public ones, for tuning and for tests without data. Each fills the unit square or cube as
those do: the longest side of its box is `LONGEST_SIDE`, its middle is `MIDDLE` on every axis.

The deformation is that of the public trials of Chui and Rangarajan, to the last digit of their points: the identity,
plus an affine map with normal coefficients of one standard deviation, plus Gaussian bumps ``exp(-|x - c|**2 / 0.09)``
at 12 to 24 points c of the shape, each with a normal coefficient an axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.matching.methods import UNMATCHED
from tsis.model.require import require_array, require_integer, require_number, require_one_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


Floats: TypeAlias = "NDArray[np.float64]"
Integers: TypeAlias = "NDArray[np.int64]"
BUMP_WIDTH = 0.3  # a bump falls to 1/e over it
BUMP_SPACING = 0.12  # least distance of two bumps; gives about as many as in the public shapes, 12 and 18
ROUNDING = 1e-9  # of a fraction times a count, which should be whole
OUTLIER_SIDE = 1.0  # of the box, about the mean of the target, that outliers fill evenly

Occlusion: TypeAlias = Literal["patch", "scattered"]
Family: TypeAlias = Literal["deformation", "noise", "outliers", "rotation", "occlusion"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Distortion:
    """Distortion of a shape that about fills the unit box; lengths are in the unit of its points."""

    bending: float = 0.0  # standard deviation of the bumps' coefficients, in [0, 1]; 0.02 to 0.08 in the public trials
    # standard deviation of the coefficients of the affine part, its translation among them, in [0, 1]
    affine: float = 0.0
    noise_sd: float = 0.0  # standard deviation of each coordinate of each target point, in [0, 1]
    outlier_ratio: float = 0.0  # target points without a partner over the points of the shape, in [0, 100]
    # angle of a rotation about the mean, in [0, 180]; its sense is random, and in space its axis
    rotation_deg: float = 0.0
    occluded: float = 0.0  # fraction of the points without a partner in the target, in [0, 0.9]
    # whether these lie in one ``"patch"``, as in the public trials, or are ``"scattered"``
    occlusion: Occlusion = "patch"

    def __post_init__(self) -> None:
        for name, high in (("bending", 1.0), ("affine", 1.0), ("noise_sd", 1.0), ("outlier_ratio", 100.0)):
            require_number(name, getattr(self, name), 0.0, high)
        require_number("rotation_deg", self.rotation_deg, 0.0, 180.0)
        require_number("occluded", self.occluded, 0.0, 0.9)
        require_one_of("kind of occlusion", self.occlusion, ("patch", "scattered"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """Two point sets with their true matches."""

    source: Floats  # points to be transformed, shape (n, d)
    target: Floats  # their targets in another order, without occluded points, with outliers, shape (m, d)
    target_clean: Floats  # the target before noise, row by row, shape (m, d)
    truth: Integers  # row of each source point's true target, or `UNMATCHED`, shape (n,)
    name: str = ""  # name in tables

    def __post_init__(self) -> None:
        for field in ("source", "target", "target_clean"):
            object.__setattr__(self, field, require_array(field, getattr(self, field), ndim=2))
        object.__setattr__(self, "truth", require_array("truth", self.truth, ndim=1, dtype=np.int64))
        same = {self.source.shape[1], self.target.shape[1]} in ({2}, {3})
        if not same or self.target.shape != self.target_clean.shape:
            raise InputError(
                "source, target and target_clean must have 2 or 3 coordinates each, the last two the same shape; "
                f"got {self.source.shape}, {self.target.shape} and {self.target_clean.shape}"
            )
        partners = self.truth[self.truth != UNMATCHED]
        once = len(np.unique(partners)) == len(partners) > 0
        if len(self.truth) != len(self.source) or not once or partners.min() < 0 or partners.max() >= len(self.target):
            raise InputError(
                f"truth must give each of the {len(self.source)} source points a row of the target of its own or "
                f"{UNMATCHED}, and at least one of them a row"
            )


def public_distortion(family: Family, level: int) -> Distortion:
    """Distortion of the public trials of Chui and Rangarajan; it grows with the level, from 1.

    There are 5 levels of deformation and outliers, 6 of the others; another one raises `InputError`.

    Examples
    --------
    >>> public_distortion("deformation", 1).bending, public_distortion("noise", 6).noise_sd
    (0.02, 0.05)
    """
    require_one_of("family of trials", family, PUBLIC_LEVELS)
    levels = PUBLIC_LEVELS[family]
    return levels[require_integer("level", level, 1, len(levels)) - 1]


def distort(shape: ArrayLike, distortion: Distortion, *, rng: np.random.Generator, name: str = "") -> Trial:
    """Distort a shape at random, with all errors from ``rng``, and shuffle the result.

    The points about fill the unit square or cube, shape (n, d), d being 2 or 3, n at least 5; others raise
    `InputError`. Strong affine parts sometimes mirror a shape, as in the public trials.

    Examples
    --------
    >>> square = [[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9], [0.5, 0.5]]
    >>> trial = distort(square, Distortion(noise_sd=0.01, outlier_ratio=1.0), rng=np.random.default_rng(0))
    >>> trial.target.shape, bool(abs(trial.target_clean[trial.truth] - square).max() < 1e-12)
    ((10, 2), True)
    """
    source = require_array("shape", shape, ndim=2)
    if source.shape[1] not in (2, 3) or len(source) < 5:
        raise InputError(f"shape must hold 5 or more points with 2 or 3 coordinates each; got shape {source.shape}")
    transformed = rotated(deformed(source, distortion, rng=rng), distortion.rotation_deg, rng=rng)
    observed = visible(transformed, distortion.occluded, kind=distortion.occlusion, rng=rng)
    outliers = transformed[observed].mean(axis=0) + OUTLIER_SIDE * rng.uniform(
        -0.5, 0.5, (int(distortion.outlier_ratio * len(source) + ROUNDING), source.shape[1])
    )
    clean = np.concatenate([transformed[observed], outliers])
    noisy = clean.copy()
    noisy[: len(observed)] += rng.normal(0.0, distortion.noise_sd, (len(observed), source.shape[1]))
    truth = np.full(len(source), UNMATCHED)
    truth[observed] = np.arange(len(observed))
    return shuffled(source, noisy, clean, truth, rng=rng, name=name)


def shuffled(
    source: Floats, target: Floats, target_clean: Floats, truth: Integers, *, rng: np.random.Generator, name: str = ""
) -> Trial:
    """A trial with its target rows in random order."""
    order = rng.permutation(len(target))
    position = np.argsort(order)
    return Trial(
        source=source,
        target=target[order],
        target_clean=target_clean[order],
        truth=np.where(truth == UNMATCHED, UNMATCHED, position[truth]),
        name=name,
    )


def deformed(points: Floats, distortion: Distortion, *, rng: np.random.Generator) -> Floats:
    """The points after the affine map and the bumps."""
    dimension = points.shape[1]
    centres = _separated(points, rng=rng)
    bumps = np.exp(-scipy.spatial.distance.cdist(points, centres, "sqeuclidean") / BUMP_WIDTH**2)
    affine = rng.normal(0.0, distortion.affine, (dimension + 1, dimension))
    bent = bumps @ rng.normal(0.0, distortion.bending, (len(centres), dimension))
    return np.asarray(points + affine[0] + points @ affine[1:] + bent)


def rotated(points: Floats, angle_deg: float, *, rng: np.random.Generator) -> Floats:
    """The points rotated by ``angle_deg`` about their mean, in a random sense or about a random axis."""
    middle = points.mean(axis=0)
    angle = np.radians(angle_deg) * rng.choice([-1.0, 1.0])
    if points.shape[1] == 2:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    else:
        axis = rng.normal(size=3)
        x, y, z = axis / np.linalg.norm(axis)
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return np.asarray((points - middle) @ turn.T + middle)


def visible(points: Floats, occluded: float, *, kind: Occlusion, rng: np.random.Generator) -> Integers:
    """Rows of the visible points when a fraction is occluded, at least one, in ascending order."""
    gone = int(occluded * len(points) + ROUNDING)
    if kind == "scattered":
        order = rng.permutation(len(points))
    else:
        start = points[rng.integers(len(points))]
        order = np.argsort(np.linalg.norm(points - start, axis=1), kind="stable")
    return np.sort(order[gone:])


def _separated(points: Floats, *, rng: np.random.Generator) -> Floats:
    """Random points with distances of at least `BUMP_SPACING`."""
    free, centres = rng.permutation(points), []
    while len(free):
        centres.append(free[0])
        free = free[np.linalg.norm(free - free[0], axis=1) >= BUMP_SPACING]
    return np.array(centres)


_USUAL = Distortion(bending=0.05, affine=0.2)  # under all other distortions
PUBLIC_LEVELS: dict[Family, tuple[Distortion, ...]] = {
    "deformation": tuple(
        Distortion(bending=bending, affine=affine)
        for bending, affine in ((0.02, 0.05), (0.035, 0.1125), (0.05, 0.175), (0.065, 0.2375), (0.08, 0.3))
    ),
    "noise": tuple(replace(_USUAL, noise_sd=sd) for sd in (0.0, 0.01, 0.02, 0.03, 0.04, 0.05)),
    "outliers": tuple(replace(_USUAL, outlier_ratio=ratio) for ratio in (0.0, 0.5, 1.0, 1.5, 2.0)),
    "rotation": tuple(replace(_USUAL, rotation_deg=angle) for angle in (0.0, 30.0, 60.0, 90.0, 120.0, 180.0)),
    "occlusion": tuple(replace(_USUAL, occluded=fraction) for fraction in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
}


LONGEST_SIDE = 0.75
MIDDLE = 0.6
FEWEST, MOST = 10, 100_000
TRIES = 20  # candidates for each point of an even texture
DOME_HEIGHT = 0.35  # of the width of the surface


class Shape(Protocol):
    """Creates ``count`` points, shape (count, 2) or (count, 3)."""

    def __call__(self, count: int, *, rng: np.random.Generator) -> Floats:
        """Create them."""


def fourier_curve(count: int, *, rng: np.random.Generator) -> Floats:
    """Points evenly along a closed curve, a circle with random harmonics 2 to 6.

    Examples
    --------
    >>> fourier_curve(100, rng=np.random.default_rng(0)).shape
    (100, 2)
    """
    require_integer("count", count, FEWEST, MOST)
    angle = np.linspace(0, 2 * np.pi, 2000)
    order = np.arange(2, 7)[:, None]
    size = rng.normal(0.0, 0.35, (4, 5)) / np.arange(2, 7) ** 0.5
    waves = np.stack([np.cos(order * angle), np.sin(order * angle)])
    x = np.cos(angle) + size[0] @ waves[0] + size[1] @ waves[1]
    y = np.sin(angle) + size[2] @ waves[0] + size[3] @ waves[1]
    return _fitted(_along(np.column_stack([x, y]), count + 1)[:-1])


def strokes(count: int, *, rng: np.random.Generator) -> Floats:
    """Points along 4 to 7 strokes of 2 to 4 straight pieces each, as in a written character."""
    require_integer("count", count, FEWEST, MOST)
    lines = [_stroke(rng) for _ in range(rng.integers(4, 8))]
    length = np.array([np.linalg.norm(np.diff(line, axis=0), axis=1).sum() for line in lines])
    fraction = np.maximum(np.floor(count * length / length.sum()).astype(int), 1)
    fraction[np.argmax(length)] += count - fraction.sum()
    return _fitted(np.concatenate([_along(line, number) for line, number in zip(lines, fraction, strict=True)]))


def _stroke(rng: np.random.Generator) -> Floats:
    """A polyline that turns by up to a right angle at each corner."""
    pieces = int(rng.integers(2, 5))
    heading = rng.uniform(0, 2 * np.pi) + np.cumsum(rng.uniform(-np.pi / 2, np.pi / 2, pieces))
    steps = rng.uniform(0.15, 0.4, pieces)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    start = rng.uniform(0.0, 1.0, 2)
    return np.concatenate([start[None], start + np.cumsum(steps, axis=0)])


def spiral(count: int, *, rng: np.random.Generator) -> Floats:
    """Points evenly along a spiral of 1.5 to 3 turns, which is similar after many rotations."""
    require_integer("count", count, FEWEST, MOST)
    angle = np.linspace(0.5 * np.pi, 2 * np.pi * rng.uniform(1.5, 3.0), 2000)
    radius = angle ** rng.uniform(0.8, 1.3)
    rotated = angle + rng.uniform(0, 2 * np.pi)
    return _fitted(_along(np.column_stack([radius * np.cos(rotated), radius * np.sin(rotated)]), count))


def scattered_texture(count: int, *, rng: np.random.Generator) -> Floats:
    """Points anywhere in a square, as corners of a random pattern."""
    require_integer("count", count, FEWEST, MOST)
    return _fitted(rng.uniform(0.0, 1.0, (count, 2)))


def even_texture(count: int, *, rng: np.random.Generator) -> Floats:
    """Evenly scattered points in a square: of `TRIES` candidates the one farthest from all before it."""
    require_integer("count", count, FEWEST, MOST)
    points = np.empty((count, 2))
    points[0] = rng.uniform(0.0, 1.0, 2)
    for done in range(1, count):
        candidate = rng.uniform(0.0, 1.0, (TRIES, 2))
        away = ((candidate[:, None, :] - points[None, :done, :]) ** 2).sum(axis=2).min(axis=1)
        points[done] = candidate[np.argmax(away)]
    return _fitted(points)


def tactile_surface(count: int, *, rng: np.random.Generator) -> Floats:
    """Points (x, y, z) of a pressed dome: a broad one over a disc, with one to three smaller bumps on it."""
    require_integer("count", count, FEWEST, MOST)
    # Sunflower seeds cover a disc evenly at any count; small random shifts avoid a lattice.
    radius = np.sqrt((np.arange(count) + 0.5) / count)
    angle = np.arange(count) * np.pi * (3 - np.sqrt(5)) + rng.uniform(0, 2 * np.pi)
    flat = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    flat += rng.normal(0.0, 0.2 / np.sqrt(count), flat.shape)
    height = DOME_HEIGHT * (1 - (flat**2).sum(axis=1))
    for _ in range(rng.integers(1, 4)):
        position = rng.uniform(-0.6, 0.6, 2)
        width = rng.uniform(0.15, 0.35)
        height += rng.uniform(0.1, 0.3) * np.exp(-((flat - position) ** 2).sum(axis=1) / (2 * width**2))
    return _fitted(np.column_stack([flat, height]))


def _along(line: Floats, count: int) -> Floats:
    """Points evenly spaced by arc length along a polyline, its two ends among them."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], count) if count > 1 else length[-1:] / 2
    return np.column_stack([np.interp(at, length, line[:, axis]) for axis in range(line.shape[1])])


def _fitted(points: Floats) -> Floats:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - (low + high) / 2) * (LONGEST_SIDE / (high - low).max()) + MIDDLE)


SHAPES: dict[str, Shape] = {
    "curve": fourier_curve,
    "strokes": strokes,
    "spiral": spiral,
    "scattered": scattered_texture,
    "even": even_texture,
    "surface": tactile_surface,
}
