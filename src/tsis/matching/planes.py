"""Flat point sets in space: their planes, and the map between these as a map of space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError

if TYPE_CHECKING:
    from tsis.matching.methods import Floats, Move


THIN = 1e-6  # extent across a plane, of the largest along it, that may be rounding
NEARLY_FLAT = 0.1  # the same of a set that a flat one is matched with: noise across the plane


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plane:
    """A plane in space with axes of its own."""

    centre: Floats  # shape (3,)
    axes: Floats  # two orthonormal rows, shape (2, 3); with the normal they are right-handed
    normal: Floats  # shape (3,)

    def inward(self, points: Floats) -> Floats:
        """Coordinates in the plane, shape (n, 2), of points in space."""
        return np.asarray((points - self.centre) @ self.axes.T)

    def outward(self, points: Floats) -> Floats:
        """Points in space, shape (n, 3), of coordinates in the plane."""
        return np.asarray(self.centre + points @ self.axes)

    def turned_over(self) -> Plane:
        """The same plane seen from its other side."""
        return Plane(centre=self.centre, axes=self.axes * [[1.0], [-1.0]], normal=-self.normal)


def flat_planes(source: Floats, target: Floats) -> tuple[Plane, Plane] | None:
    """Planes of two flat sets, whose axes the smallest rotation carries onto each other; None where none is flat.

    Where one is flat and the other nearly so, the other's plane is the nearest. Raises `InputError` where one is flat
    and the other is not.
    """
    if source.shape[1] != 3:
        return None
    (start, thin), (end, other) = _nearest_plane(source), _nearest_plane(target)
    if min(thin, other) > THIN:
        return None
    if max(thin, other) > NEARLY_FLAT:
        flat, solid = ("source", "target") if thin <= THIN else ("target", "source")
        raise InputError(f"{solid} must lie in a plane as {flat} does; got points that fill space")
    # Of the two sides of the target's plane the nearer one is up.
    normal = end.normal if start.normal @ end.normal >= 0 else -end.normal
    axes = start.axes @ _shortest_rotation(start.normal, normal).T
    return start, Plane(centre=end.centre, axes=axes, normal=normal)


def _nearest_plane(points: Floats) -> tuple[Plane, float]:
    """The plane of least squares, and the extent of the points across it, of the largest along it."""
    centre = points.mean(axis=0)
    _, extent, axes = np.linalg.svd(points - centre, full_matrices=False)
    normal = axes[2] if axes[2][np.abs(axes[2]).argmax()] > 0 else -axes[2]
    # The axes do not depend on which directions of the plane the points extend along.
    along = np.eye(3)[np.abs(normal).argmin()]
    first = along - (along @ normal) * normal
    first /= np.linalg.norm(first)
    plane = Plane(centre=centre, axes=np.stack([first, np.cross(normal, first)]), normal=normal)
    return plane, float(extent[2] / extent[0])


def _shortest_rotation(start: Floats, end: Floats) -> Floats:
    """Matrix, shape (3, 3), that rotates a unit vector onto another with ``start @ end >= 0``."""
    axis, cosine = np.cross(start, end), float(start @ end)
    across = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    return np.asarray(np.eye(3) + across + across @ across / (1 + cosine))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlaneMove:
    """A map of space from that of a plane; distances from the plane scale as lengths within it."""

    start: Plane
    end: Plane
    move: Move
    scale: float  # of lengths

    def __call__(self, points: Floats, /) -> Floats:
        """Transform points, shape (k, 3)."""
        height = (points - self.start.centre) @ self.start.normal
        return self.end.outward(self.move(self.start.inward(points))) + self.scale * height[:, None] * self.end.normal


def plane_move(start: Plane, end: Plane, move: Move, points: Floats) -> PlaneMove:
    """The map of space from a ``move`` of points of the plane, shape (n, 2), whose mean change of size it takes."""
    before, after = (item - item.mean(axis=0) for item in (points, move(points)))
    scale = float(np.sqrt((after**2).sum() / (before**2).sum()))
    return PlaneMove(start=start, end=end, move=move, scale=scale)
