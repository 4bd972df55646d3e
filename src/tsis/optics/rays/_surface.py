"""Intersections of rays with the pressed face and the interfaces above it; heights are a quadratic spline."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import scipy

from tsis.compiled import fused, inlined

if TYPE_CHECKING:
    from tsis.optics._inputs import Floats


SMALLEST_STEP_MM = 0.1  # a ray that cuts a surface over a shorter distance misses it
AFTER_BOUNCE_MM = 1e-7
ROUNDING_MM = 1e-11
POLISHES = 60


class Heights(NamedTuple):
    """The face's height above its undeformed apex, and the fraction of real contact, over a square grid."""

    start: float
    spacing: float
    coefficients: Floats  # of the quadratic spline through the heights
    contact_fraction: Floats
    lowest: float
    highest: float
    steepest: float
    touched: bool


def heights(side_mm: Floats, height_mm: Floats, fraction: Floats) -> Heights:
    """The smooth surface through heights on an even square grid."""
    spacing = float(side_mm[1] - side_mm[0])
    coefficients = np.ascontiguousarray(scipy.ndimage.spline_filter(height_mm, order=2, mode="mirror"))
    along_x = np.abs(np.diff(coefficients, axis=1)).max() / spacing
    along_y = np.abs(np.diff(coefficients, axis=0)).max() / spacing
    return Heights(
        start=float(side_mm[0]),
        spacing=spacing,
        coefficients=coefficients,
        contact_fraction=np.ascontiguousarray(fraction),
        lowest=float(coefficients.min()),
        highest=float(coefficients.max()),
        steepest=float(np.hypot(along_x, along_y)),
        touched=bool((fraction > 0).any()),
    )


@inlined
def height_and_slopes(face: Heights, x: float, y: float) -> tuple[float, float, float]:
    """Height of the face and its derivatives by x and y."""
    u, v = (x - face.start) / face.spacing, (y - face.start) / face.spacing
    column, row = int(u + 0.5), int(v + 0.5)
    s, t = u - column, v - row
    value = along_x = along_y = 0.0
    for j in range(-1, 2):
        weight, change = _spline(j, t)
        line = slope = 0.0
        for i in range(-1, 2):
            here, here_change = _spline(i, s)
            coefficient = face.coefficients[row + j, column + i]
            line += here * coefficient
            slope += here_change * coefficient
        value += weight * line
        along_x += weight * slope
        along_y += change * line
    return value, along_x / face.spacing, along_y / face.spacing


@inlined
def _spline(part: int, s: float) -> tuple[float, float]:
    """One of the three pieces of the quadratic B-spline that cover a point, and its derivative."""
    if part < 0:
        return 0.5 * (0.5 - s) ** 2, s - 0.5
    if part > 0:
        return 0.5 * (0.5 + s) ** 2, s + 0.5
    return 0.75 - s * s, -2.0 * s


@inlined
def contact_fraction(face: Heights, x: float, y: float) -> float:
    """Fraction of real contact, linear between grid points."""
    u, v = (x - face.start) / face.spacing, (y - face.start) / face.spacing
    column, row = int(u), int(v)
    s, t = u - column, v - row
    lower = (1 - s) * face.contact_fraction[row, column] + s * face.contact_fraction[row, column + 1]
    upper = (1 - s) * face.contact_fraction[row + 1, column] + s * face.contact_fraction[row + 1, column + 1]
    return float((1 - t) * lower + t * upper)


@inlined
def way_to_surface(
    face: Heights,
    level: float,
    pull: float,
    side: float,
    position: tuple[float, float, float],
    direction: tuple[float, float, float],
    limit: float,
    leaving: bool,
) -> float:
    """Distance along a ray to the surface ``level + pull * height``, infinite beyond ``limit``.

    ``side`` is 1 for a ray above the surface and -1 below it; ``leaving`` is True when the ray starts on it.
    """
    if pull != 0.0 and face.highest > face.lowest:
        return _way_to_curved(face, level, pull, side, position, direction, limit, leaving)
    closing = -side * direction[2]
    if closing <= 0.0 or leaving:
        return np.inf
    way = max(side * (position[2] - level - pull * face.lowest), 0.0) / closing
    return way if way < limit else np.inf


@fused
def _way_to_curved(
    face: Heights,
    level: float,
    pull: float,
    side: float,
    position: tuple[float, float, float],
    direction: tuple[float, float, float],
    limit: float,
    leaving: bool,
) -> float:
    """Distance to a curved surface: steps limited by the steepest slope, then a bracketed search."""
    x, y, z = position
    dx, dy, dz = direction
    closing = -side * dz
    nearest = level + pull * (face.highest if side > 0 else face.lowest)
    way = AFTER_BOUNCE_MM if leaving else 0.0
    free = side * (z - nearest)
    if free > 0.0:
        if closing <= 0.0:
            return np.inf
        way = max(way, free / closing)
    fastest = pull * face.steepest * np.sqrt(dx * dx + dy * dy) + closing
    if fastest <= 0.0:
        return np.inf
    before, gap_before, started = way, 0.0, False
    while before < limit:
        way = min(way, limit)
        height, _, _ = height_and_slopes(face, x + dx * way, y + dy * way)
        gap = side * (z + dz * way - level - pull * height)
        if gap <= 0.0:
            if not started:
                return way
            return _crossing(face, level, pull, side, position, direction, before, gap_before, way, gap)
        if closing <= 0.0 and side * (z + dz * way - nearest) > 0.0:
            return np.inf
        before, gap_before, started = way, gap, True
        way += max(gap / fastest, SMALLEST_STEP_MM)
    return np.inf


@fused
def _crossing(
    face: Heights,
    level: float,
    pull: float,
    side: float,
    position: tuple[float, float, float],
    direction: tuple[float, float, float],
    above: float,
    gap_above: float,
    below: float,
    gap_below: float,
) -> float:
    """The intersection between two distances, by regula falsi (Illinois)."""
    x, y, z = position
    dx, dy, dz = direction
    last = 0
    way = above
    for _ in range(POLISHES):
        way = (above * gap_below - below * gap_above) / (gap_below - gap_above)
        height, _, _ = height_and_slopes(face, x + dx * way, y + dy * way)
        gap = side * (z + dz * way - level - pull * height)
        if abs(gap) < ROUNDING_MM:
            break
        if gap > 0.0:
            above, gap_above = way, gap
            if last == 1:
                gap_below *= 0.5
            last = 1
        else:
            below, gap_below = way, gap
            if last == -1:
                gap_above *= 0.5
            last = -1
    return way
