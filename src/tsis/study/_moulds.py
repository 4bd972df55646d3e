"""Moulds of phantoms as STL files for a printer: bodies of revolution, closed, with their volumes.

A body is a closed polygon (radius, height) in mm that is turned about the axis; points on the axis meet in one vertex.
"""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

import numpy as np

from tsis.model import require_number

if TYPE_CHECKING:
    from numpy.typing import NDArray

SIDES = 180  # of the circle
ARC = 60  # segments of a quarter of a sphere
WALL_MM, FLOOR_MM, PIN_MM = 3.0, 3.0, 1.0


def sphere_mould(diameter_mm: float) -> NDArray[np.float64]:
    """One half of the mould of a sphere: a block with a hemisphere in its top, as triangles (n, 3, 3) in mm.

    Two halves are clamped face to face and filled through a needle at the seam.
    """
    radius = require_number("diameter_mm", diameter_mm, 1.0, 100.0, hint="millimetres") / 2
    angle = np.linspace(0, np.pi / 2, ARC + 1)
    top = radius + FLOOR_MM
    cavity = np.stack([radius * np.sin(angle), top - radius * np.cos(angle)], axis=1)  # from the axis to the rim
    return revolved([(0.0, 0.0), *map(tuple, cavity[:1]), *map(tuple, cavity[1:]), *_outer(radius + WALL_MM, top)])


def cup(diameter_mm: float, height_mm: float) -> NDArray[np.float64]:
    """A cup for tissue or a test cylinder: inner ``diameter_mm`` and ``height_mm``, as triangles (n, 3, 3) in mm."""
    radius = require_number("diameter_mm", diameter_mm, 1.0, 300.0, hint="millimetres") / 2
    top = require_number("height_mm", height_mm, 1.0, 300.0, hint="millimetres") + FLOOR_MM
    return revolved([(0.0, 0.0), (0.0, FLOOR_MM), (radius, FLOOR_MM), (radius, top), *_outer(radius + WALL_MM, top)])


def _outer(radius: float, top: float) -> list[tuple[float, float]]:
    return [(radius, top), (radius, 0.0)]


def revolved(profile: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Turn a closed profile about the axis: outward triangles, shape (n, 3, 3).

    The profile runs clockwise in (radius, height), seen with the radius to the right.
    """
    turn = 2 * np.pi * np.arange(SIDES) / SIDES
    rings = [
        np.stack([radius * np.cos(turn), radius * np.sin(turn), np.full(SIDES, height)], axis=1)
        for radius, height in profile
    ]
    faces = []
    for at, (low, high) in enumerate(zip(rings, [*rings[1:], rings[0]], strict=True)):
        touching = profile[at][0] == 0, profile[(at + 1) % len(profile)][0] == 0
        after = np.roll(low, -1, axis=0), np.roll(high, -1, axis=0)
        if not touching[0]:
            faces.append(np.stack([low, high, after[0]], axis=1))
        if not touching[1]:
            faces.append(np.stack([after[0], high, after[1]], axis=1))
    return np.concatenate(faces)


def volume_mm3(triangles: NDArray[np.float64]) -> float:
    """Volume inside closed outward triangles, by the divergence theorem; negative where they point inwards."""
    return float(np.linalg.det(triangles).sum() / 6)


def stl_bytes(triangles: NDArray[np.float64], name: str) -> bytes:
    """Binary STL file in mm; ``name`` goes into its header."""
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    record = np.zeros(len(triangles), dtype=np.dtype([("values", "<f4", (12,)), ("attribute", "<u2")]))
    record["values"] = np.concatenate([normal / np.maximum(length, 1e-30), triangles.reshape(-1, 9)], axis=1)
    return name.encode("ascii", "replace")[:80].ljust(80) + struct.pack("<I", len(triangles)) + record.tobytes()
