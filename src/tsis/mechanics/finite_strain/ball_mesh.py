"""A ball as a mesh: a square core around its centre and rings of elements between the core and its surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.finite_strain.meshed_solid import MeshPatch, Solid, weld
from tsis.mechanics.mesh import LayeredMesh, refine

if TYPE_CHECKING:
    from numpy.typing import NDArray

CORE = 0.5  # half the core's side as a share of the radius


def mesh_ball(
    *, radius_mm: float, young_kpa: float, poisson: float, order: int, cells: int, rings: int
) -> tuple[Solid, NDArray[np.int64]]:
    """Mesh a ball that rests with its pole (0, 0) on a face, its centre at z = radius.

    Parameters
    ----------
    radius_mm, young_kpa, poisson
        The ball.
    order
        Order of the elements.
    cells
        Elements along an eighth of the circle.
    rings
        Element layers between core and surface.

    Returns
    -------
    The body, and the nodes of its surface from the pole at z = 0 to the other pole.
    """
    side = CORE * radius_mm
    centre = np.array([0.0, radius_mm])
    line = refine(np.linspace(0.0, 1.0, cells + 1), order)
    upright = refine(np.linspace(-1.0, 1.0, cells + 1), order)
    flat = np.zeros_like(line)
    below = np.column_stack([line, flat - 1])
    beside = np.column_stack([np.ones_like(upright), upright])
    above = np.column_stack([line[::-1], flat + 1])
    outline = side * np.concatenate([below, beside[1:], above[1:]])
    angles = np.pi * np.concatenate([line / 4, (1 / 4 + (upright + 1) / 4)[1:], (3 / 4 + line / 4)[1:]])
    circle = radius_mm * np.column_stack([np.sin(angles), -np.cos(angles)])
    circle[[0, -1], 0] = 0.0
    share = refine(np.linspace(0.0, 1.0, rings + 1), order)
    ring = centre + circle[:, None] + share[None, :, None] * (outline - circle)[:, None]
    core = centre + side * np.stack(np.meshgrid(line, upright, indexing="ij"), axis=-1)
    patches = [
        MeshPatch(
            mesh=LayeredMesh(nodes=nodes, order=order),
            young_kpa=np.full(layers, young_kpa),
            poisson=np.full(layers, poisson),
        )
        for nodes, layers in ((ring, rings), (core, cells))
    ]
    solid = weld(patches)
    return solid, solid.patches[0][:, 0]
