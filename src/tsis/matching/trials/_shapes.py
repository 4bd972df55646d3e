"""Random shapes, different from the public ones, for tuning and for tests without data.

Each fills the unit square or cube as the public shapes do: the longest side of its box is `LONGEST_SIDE`, its middle
is `MIDDLE` on every axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from tsis.model import require_integer

if TYPE_CHECKING:
    from tsis.matching._fit import Floats


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
