"""A third generator of trials for `benchmarks.matching.trust`, written apart from the other two.

Curves are drawn by turtles, springs, blended discs, strokes with round ends and rolling circles; they are bent along an
arc, by a quadratic map or by the pull of a few handles; noise is Laplace, uniform, growing along the shape or common to
neighbours. No shape, deformation or noise is of the other generators.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import skimage
from benchmarks.matching.distort import Trial

from tsis.matching.methods import UNMATCHED

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

Floats: TypeAlias = "NDArray[np.float64]"

EXTENT = 0.8  # of the longest side, in unit boxes
GRID = 160  # pixels across of the pictures whose contours are traced
NOISES = ("laplace", "uniform", "growing", "common")


def fresh_trial(family: str, degradation: str, number: int, *, seed: int) -> Trial:
    """Trial ``number`` of a family of `SHAPES` and a degradation; it does not depend on other trials."""
    rng = np.random.default_rng([seed, 31, list(SHAPES).index(family), list(AMOUNTS).index(degradation), number])
    source = _scaled(SHAPES[family](int(rng.integers(70, 131)), rng))
    amount = AMOUNTS[degradation](rng)
    moved = _turned(_bent(source, amount.get("bend", 0.5), rng), amount.get("degrees", rng.normal(0, 6)))
    moved += rng.uniform(-0.2, 0.2, 2)
    lost = int(amount.get("lost", 0.0) * len(source))
    seen = np.sort(_remaining(moved, lost, rng))
    low, high = moved.min(axis=0), moved.max(axis=0)
    stray = rng.uniform(low - 0.08, high + 0.08, (int(amount.get("stray", 0.0) * len(source)), 2))
    clean = np.vstack([moved[seen], stray])
    noisy = clean + np.vstack([_noise(moved, amount.get("noise", 0.0), rng)[seen], np.zeros_like(stray)])
    order = rng.permutation(len(clean))
    truth = np.full(len(source), UNMATCHED)
    truth[seen] = np.argsort(order)[: len(seen)]
    return Trial(
        source=source,
        target=noisy[order],
        target_clean=clean[order],
        truth=truth,
        name=f"fresh/{family}/{degradation}/{number}",
    )


AMOUNTS: dict[str, Callable[[np.random.Generator], dict[str, float]]] = {
    "deformation": lambda rng: {"bend": rng.uniform(0.4, 1.2)},
    "noise": lambda rng: {"bend": rng.uniform(0.0, 0.6), "noise": rng.uniform(0.01, 0.04)},
    "outliers": lambda rng: {"stray": rng.uniform(0.1, 1.5)},
    "occlusion": lambda rng: {"lost": rng.uniform(0.1, 0.4)},
    "rotation": lambda rng: {"degrees": rng.uniform(-180.0, 180.0)},
    "mixed": lambda rng: {
        "noise": rng.uniform(0.0, 0.02),
        "stray": rng.uniform(0.0, 0.4),
        "lost": rng.uniform(0.0, 0.2),
        "degrees": rng.uniform(-60.0, 60.0),
    },
}


def _scaled(points: Floats) -> Floats:
    low, high = points.min(axis=0), points.max(axis=0)
    return np.asarray((points - (low + high) / 2) * (EXTENT / (high - low).max()))


def _turned(points: Floats, degrees: float) -> Floats:
    angle = np.radians(degrees)
    return np.asarray(points @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]))


def _bent(points: Floats, strength: float, rng: np.random.Generator) -> Floats:
    """Points bent along an arc, by a quadratic map or by handles, then stretched a little."""
    kind = rng.integers(3)
    if kind == 0:  # the axis becomes an arc, of up to a quarter of a circle
        heading = rng.uniform(0, 360)
        along, across = _turned(points, heading).T
        curvature = rng.uniform(0.2, 1.0) * strength * rng.choice([-1.0, 1.0])
        radius = 1 / curvature + across
        moved = np.column_stack([radius * np.sin(along * curvature), radius * np.cos(along * curvature)])
        moved = _turned(moved - [0.0, 1 / curvature], -heading)
    elif kind == 1:
        x, y = points.T
        squares = np.column_stack([x * x, x * y, y * y])
        moved = points + squares @ rng.normal(0, 0.25 * strength, (3, 2))
    else:  # inverse distance weights of a few handles
        handles = points[rng.choice(len(points), 5, replace=False)]
        away = ((points[:, None] - handles) ** 2).sum(axis=2) + 0.05
        pull = (1 / away) @ rng.normal(0, 0.1 * strength, (5, 2)) / (1 / away).sum(axis=1, keepdims=True)
        moved = points + pull
    return np.asarray(moved * np.exp(rng.normal(0, 0.08 * strength, 2)) * rng.uniform(0.8, 1.25))


def _noise(moved: Floats, sd: float, rng: np.random.Generator) -> Floats:
    """Displacements of a standard deviation a coordinate, of one of four kinds."""
    kind = rng.choice(NOISES)
    if kind == "laplace":
        return np.asarray(rng.laplace(0, sd / np.sqrt(2), moved.shape))
    if kind == "uniform":
        return np.asarray(rng.uniform(-np.sqrt(3) * sd, np.sqrt(3) * sd, moved.shape))
    if kind == "growing":  # from half of it to one and a half, from one side to the other
        rank = np.argsort(np.argsort(moved[:, 0])) / max(len(moved) - 1, 1)
        return np.asarray(rng.normal(0, sd, moved.shape) * (0.5 + rank)[:, None])
    near = np.exp(-0.5 * ((moved[:, None] - moved) ** 2).sum(axis=2) / 0.03**2)
    common = near @ rng.normal(0, 1, moved.shape) / np.sqrt((near**2).sum(axis=1, keepdims=True))
    return np.asarray(sd * (0.6 * common + 0.8 * rng.normal(0, 1, moved.shape)))


def _remaining(moved: Floats, lost: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices left after a half plane, or points at random, are hidden."""
    if rng.integers(2):
        return np.asarray(rng.permutation(len(moved))[lost:])
    heading = rng.uniform(0, 2 * np.pi)
    return np.asarray(np.argsort(moved @ [np.cos(heading), np.sin(heading)])[lost:])


def _along(line: Floats, count: int, *, closed: bool) -> Floats:
    """Points at equal arc lengths."""
    if closed:
        line = np.vstack([line, line[:1]])
    length = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    step = length[-1] / (count if closed else count - 1)
    at = np.arange(count) * step
    return np.column_stack([np.interp(at, length, line[:, axis]) for axis in range(2)])


def _traced(inside: Floats, count: int) -> Floats:
    """The longest contour at zero of a picture."""
    lines = skimage.measure.find_contours(np.pad(inside, 1, constant_values=inside.min()), 0.0)  # type: ignore[no-untyped-call]
    return _along(max(lines, key=len)[:-1, ::-1], count, closed=True)


def _grid() -> tuple[Floats, Floats]:
    row, column = np.mgrid[:GRID, :GRID] / (GRID - 1) * 2 - 1
    return column, row


def _blended_discs(count: int, rng: np.random.Generator) -> Floats:
    """A contour of the sum of inverse squares of distances from a chain of centres."""
    x, y = _grid()
    at, field = np.zeros(2), np.zeros_like(x)
    for _ in range(int(rng.integers(2, 6))):
        field += rng.uniform(0.5, 1.5) / ((x - at[0]) ** 2 + (y - at[1]) ** 2 + 1e-3)
        at = np.clip(at + rng.normal(0, 0.25, 2), -0.55, 0.55)
    return _traced(field - np.quantile(field, rng.uniform(0.78, 0.88)), count)


def _hand(count: int, rng: np.random.Generator) -> Floats:
    """Round fingers of about equal length about a palm: nearly symmetric where they stand all around."""
    x, y = _grid()
    fingers, spread = int(rng.integers(3, 8)), rng.choice([np.pi, 2 * np.pi])
    distance = np.hypot(x, y) - rng.uniform(0.25, 0.35)
    for number in range(fingers):
        angle = spread * number / fingers + rng.normal(0, 0.04)
        length, width = 0.75 * (1 + rng.normal(0, 0.08)), 0.09 * (1 + rng.normal(0, 0.1))
        share = np.clip((x * np.cos(angle) + y * np.sin(angle)) / length, 0, 1)
        distance = np.minimum(
            distance, np.hypot(x - share * length * np.cos(angle), y - share * length * np.sin(angle)) - width
        )
    return _traced(-distance, count)


def _rolling(count: int, rng: np.random.Generator) -> Floats:
    """An epitrochoid, whose cusps differ by a slow wave: nearly symmetric."""
    cusps, arm = int(rng.integers(3, 9)), rng.uniform(0.15, 0.5)
    angle = np.linspace(0, 2 * np.pi, 1200, endpoint=False)
    swell = 1 + rng.uniform(0.0, 0.15) * np.sin(angle + rng.uniform(0, 7))
    radius = (cusps + 1) / cusps
    line = radius * np.column_stack([np.cos(angle), np.sin(angle)])
    line -= arm / cusps * np.column_stack([np.cos((cusps + 1) * angle), np.sin((cusps + 1) * angle)])
    return _along(line * swell[:, None] * [1.0, rng.uniform(0.75, 1.0)], count, closed=True)


def _turtle(count: int, rng: np.random.Generator) -> Floats:
    """An open path of straight legs and turns."""
    legs = int(rng.integers(5, 12))
    heading = np.cumsum(rng.choice([-1.0, 1.0], legs) * rng.uniform(0.4, 2.0, legs))
    steps = rng.uniform(0.3, 1.0, (legs, 1)) * np.column_stack([np.cos(heading), np.sin(heading)])
    return _along(np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)]), count, closed=False)


def _spring(count: int, rng: np.random.Generator) -> Floats:
    """A spiral that opens, or a wave whose height and length grow."""
    at = np.linspace(0, 1, 900)
    if rng.integers(2):
        angle, radius = rng.uniform(1.5, 3.0) * 2 * np.pi * at, 0.15 + at ** rng.uniform(0.7, 1.5)
        return _along(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), count, closed=False)
    phase = rng.uniform(2, 5) * 2 * np.pi * at ** rng.uniform(0.6, 1.6)
    return _along(np.column_stack([2 * at, (0.1 + 0.4 * at) * np.sin(phase)]), count, closed=False)


def _glyph(count: int, rng: np.random.Generator) -> Floats:
    """Two to four strokes between points of a coarse raster."""
    raster = np.stack(np.meshgrid(np.arange(3.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
    strokes, lengths = [], []
    for _ in range(int(rng.integers(2, 5))):
        start, middle, end = raster[rng.choice(12, 3, replace=False)] + rng.normal(0, 0.1, (3, 2))
        share = np.linspace(0, 1, 200)[:, None]
        line = (1 - share) ** 2 * start + 2 * share * (1 - share) * middle + share**2 * end
        strokes.append(line)
        lengths.append(np.hypot(*np.diff(line, axis=0).T).sum())
    counts = np.maximum((count * np.array(lengths) / sum(lengths)).astype(int), 5)
    return np.vstack([_along(line, number, closed=False) for line, number in zip(strokes, counts, strict=True)])


def _heap(count: int, rng: np.random.Generator) -> Floats:
    """Grains that keep their distance, in a random half plane of a disc."""
    tried = rng.uniform(-1, 1, (40 * count, 2))
    tried = tried[np.hypot(*tried.T) < 1]
    tried = tried[tried @ rng.normal(0, 1, 2) > rng.uniform(-0.8, 0.0)]
    kept, least = [tried[0]], 0.5 / np.sqrt(count)
    for point in tried[1:]:
        if len(kept) < count and np.min(np.hypot(*(np.array(kept) - point).T)) > least:
            kept.append(point)
    return np.array(kept)


SHAPES: dict[str, Callable[[int, np.random.Generator], Floats]] = {
    "discs": _blended_discs,
    "hand": _hand,
    "rolling": _rolling,
    "turtle": _turtle,
    "spring": _spring,
    "glyph": _glyph,
    "heap": _heap,
}
NEARLY_SYMMETRIC = ("hand", "rolling")  # closed
