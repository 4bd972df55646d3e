"""The kit for a first physical validation: its phantoms, their moulds as STL files for a printer, its empty tables.

A mould is a closed polygon (radius, height) in mm that is turned about the axis; points on the axis meet in one vertex.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.files import table_bytes
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


TISSUE_KPA, THICKNESS_MM, WIDTH_MM = 5.0, 30.0, 90.0
BALL_MM, PAD_MM, CYLINDER_MM, TALL_MM = 5.0, 60.0, 20.0, 15.0  # radius of the ball; widths; height of pad and cylinder
MODULUS_COLUMNS = ("phantom", "specimen", "kind", "size_mm", "thickness_mm", "force_n", "displacement_mm")


@dataclass(frozen=True, slots=True, kw_only=True)
class KitPhantom:
    """A phantom of the kit as its recipe says; a blank one has no ``batch`` of stiff material and no sizes."""

    label: str
    batch: str = ""
    diameter_mm: float | None = None
    depth_mm: float | None = None
    young_kpa: float | None = None


def _stiff(label: int, diameter: float, depth: float, batch: str, young: float) -> KitPhantom:
    return KitPhantom(label=str(label), batch=batch, diameter_mm=diameter, depth_mm=depth, young_kpa=young)


# Well inside the default prior, casting errors included: an interval holds no value at the end of what is believed.
KIT = (
    *(_stiff(1 + number, diameter, 6.0, "A", 90.0) for number, diameter in enumerate((7.0, 10.0, 13.0))),
    *(_stiff(4 + number, 10.0, depth, "A", 90.0) for number, depth in enumerate((5.0, 9.0))),
    *(_stiff(6 + number, 10.0, 6.0, "B", 55.0) for number in range(2)),
    *(KitPhantom(label=str(8 + number)) for number in range(3)),
)


def kit_moulds() -> dict[str, tuple[NDArray[np.float64], str]]:
    """Mould and what to do with it, by the name of its STL file."""
    halves = {
        f"sphere-{size:g}.stl": (sphere_mould(size), f"half a mould of a sphere of {size:g} mm: print two, clamp")
        for size in sorted({item.diameter_mm for item in KIT if item.diameter_mm is not None})
    }
    return halves | {
        "tissue.stl": (cup(WIDTH_MM, THICKNESS_MM), "cup for tissue: print one a phantom"),
        "cylinder.stl": (cup(CYLINDER_MM, TALL_MM), "test cylinder: print three a batch"),
        "pad.stl": (cup(PAD_MM, TALL_MM), "test pad: print three a batch"),
    }


def kit_files() -> dict[str, bytes]:
    """Content of the kit's moulds and tables, by the name of the file.

    Examples
    --------
    >>> [name for name in kit_files() if not name.endswith(".stl")]
    ['phantoms.csv', 'modulus.csv']
    """
    columns = ("label", "diameter_mm", "depth_mm", "young_kpa")
    rows = [[*(getattr(item, name) for name in columns), TISSUE_KPA, THICKNESS_MM] for item in KIT]
    return {
        **{name: stl_bytes(body, what) for name, (body, what) in kit_moulds().items()},
        "phantoms.csv": table_bytes([[*columns, "tissue_kpa", "thickness_mm"], *rows]),
        "modulus.csv": table_bytes([MODULUS_COLUMNS]),
    }
