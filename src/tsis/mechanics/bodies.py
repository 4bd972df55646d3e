"""The probe, reduced to its compliance on the contact face, and how fine its mesh is."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.condensed import FIXED, condense_layers
from tsis.mechanics.face import Face
from tsis.mechanics.mesh import LayeredMesh, face_lines, mesh_rectangle, two_sided_lines

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Probe

LARGEST_CELL_MM = 4.0  # what lies a centimetre under a large face bends it over a centimetre


@dataclass(frozen=True, slots=True, kw_only=True)
class Resolution:
    """How fine the meshes are.

    Parameters
    ----------
    order
        Polynomial order of the elements.
    edge
        Size of the smallest cell, at the singular edge of the contact, as a share of the face's radius.
    growth
        Ratio of neighbouring cells away from the edge.
    largest
        Size of the largest cell on the face as a share of its radius.
    below_cells
        Cells along the chest wall under the inclusion.
    ray_layers
        Fewest element layers between the inclusion and the block that holds it; small inclusions get more.
    ray_ratio
        Largest ratio of distances from the inclusion's centre across one of these layers.
    sphere_layers
        Element layers inside the inclusion.
    """

    order: int = 5
    edge: float = 0.01
    growth: float = 2.2
    largest: float = 0.2
    below_cells: int = 3
    ray_layers: int = 5
    ray_ratio: float = 2.4
    sphere_layers: int = 1


@lru_cache(maxsize=16)
def face_of(radius_mm: float, resolution: Resolution, central_mm: float = np.inf) -> Face:
    """The contact face of a probe of ``radius_mm``; its cell on the axis is at most ``central_mm`` wide."""
    lines = face_lines(
        radius_mm,
        finest=resolution.edge * radius_mm,
        growth=resolution.growth,
        largest=min(resolution.largest * radius_mm, LARGEST_CELL_MM),
        central=central_mm,
    )
    return Face(lines=lines, order=resolution.order)


@lru_cache(maxsize=16)
def probe_compliance(probe: Probe, face: Face, resolution: Resolution) -> NDArray[np.float64]:
    """Normal displacement of the face's nodes by normal forces on them in mm/mN, shape (n, n).

    The glass is bonded and fixed. Only normal displacements of the face survive the condensation: the contact is
    frictionless, so tangential ones are free. A rim that is bonded to the housing does not move at all.
    """
    depth, young, poisson = [np.zeros(1)], [], []
    finest = resolution.edge * probe.radius_mm
    for layer in probe.layers:
        lines = two_sided_lines(
            layer.thickness_mm, finest=finest, growth=resolution.growth, largest=probe.radius_mm / 3
        )
        depth.append(depth[-1][-1] + lines[1:])
        young += [layer.young_kpa] * (len(lines) - 1)
        poisson += [layer.poisson] * (len(lines) - 1)
    flat = mesh_rectangle(face.lines, np.concatenate(depth)[::-1], resolution.order, a_is_radius=True)
    body = LayeredMesh(nodes=_bulged(flat.nodes, probe), order=flat.order)
    count, layers, _ = body.nodes.shape
    dofs = count + np.arange(count * layers * 2).reshape(count, layers, 2)
    dofs[:, -1, 1] = np.arange(count)
    dofs[:, 0] = FIXED  # bonded to the glass
    dofs[0, :, 0] = FIXED  # the axis
    if probe.sides == "bonded":
        dofs[-1] = FIXED
    keep = np.arange(count)
    swept = condense_layers(
        body, dofs, keep=keep, young_kpa=np.array(young[::-1]), poisson=np.array(poisson[::-1])
    ).keep(keep)
    compliance = np.zeros((count, count))
    compliance[np.ix_(swept.dofs, swept.dofs)] = np.linalg.inv(swept.stiffness)
    compliance.flags.writeable = False  # one array for everybody who asks
    return compliance


def _bulged(nodes: NDArray[np.float64], probe: Probe) -> NDArray[np.float64]:
    """Bend the layers to the dome: every layer keeps its share of the thickness, the glass stays flat."""
    radius, depth = nodes[..., 0], nodes[..., 1]
    share = 1 - probe.sag_mm(radius) / probe.thickness_mm
    return np.stack([radius, probe.thickness_mm - (probe.thickness_mm - depth) * share], axis=-1)
