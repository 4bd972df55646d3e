"""The axisymmetric press on plain tissue with CalculiX: quadratic elements, normal displacements tied on the face."""

from __future__ import annotations

import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.mesh import face_lines, graded, outer_lines, two_sided_lines

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

OUTER_MM = 120.0


@dataclass(frozen=True, kw_only=True)
class Body:
    """Nodes (n, 2), elements of eight nodes (m, 8), and the layer of each element."""

    nodes: NDArray[np.float64]
    elements: NDArray[np.int64]
    layer: NDArray[np.int64]


def stiffness_n_per_mm(probe: Probe, phantom: Phantom, *, finest_mm: float) -> tuple[float, int]:
    """Force by 1 mm of travel, and the number of unknowns."""
    face = face_lines(probe.radius_mm, finest=finest_mm, growth=1.5, largest=0.8)
    heights, layers = [np.zeros(1)], []
    for index, layer in enumerate(probe.layers):
        lines = two_sided_lines(layer.thickness_mm, finest=finest_mm, growth=1.5, largest=0.8)
        heights.append(heights[-1][-1] + lines[1:])
        layers += [index] * (len(lines) - 1)
    above = _body(face, np.concatenate(heights), np.array(layers))
    beyond = outer_lines(probe.radius_mm, OUTER_MM, finest=finest_mm, growth=1.5)
    depth = graded(phantom.thickness_mm, finest_mm, 1.5, 3.0)
    wide = np.concatenate([face, beyond[1:]])
    below = _body(wide, -depth[::-1], np.full(len(depth) - 1, len(probe.layers)))
    with tempfile.TemporaryDirectory() as folder:
        deck = Path(folder) / "press.inp"
        deck.write_text(_deck(above, below, probe, phantom), encoding="ascii")
        subprocess.run(["ccx", "press"], cwd=folder, check=True, capture_output=True)
        printed = (Path(folder) / "press.dat").read_text(encoding="ascii")
    total = [line for line in printed.splitlines() if line.strip()][-1]
    # mm and kPa give mN; CalculiX turns axisymmetric elements into a wedge of two degrees.
    return abs(float(total.split()[1])) * 180.0 / 1000.0, 2 * (len(above.nodes) + len(below.nodes))


def _body(radii: NDArray[np.float64], heights: NDArray[np.float64], layer: NDArray[np.int64]) -> Body:
    r, z = (np.insert(lines, slice(1, None), (lines[1:] + lines[:-1]) / 2) for lines in (radii, heights))
    grid = np.stack(np.meshgrid(r, z, indexing="ij"), axis=-1)
    number = np.arange(grid[..., 0].size).reshape(len(r), len(z))
    i, j = (
        2 * index.ravel()
        for index in np.meshgrid(np.arange(len(radii) - 1), np.arange(len(heights) - 1), indexing="ij")
    )
    around = [(0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1)]
    elements = np.stack([number[i + di, j + dj] for di, dj in around], axis=1)
    return Body(nodes=grid.reshape(-1, 2), elements=elements, layer=layer[j // 2])


def _deck(above: Body, below: Body, probe: Probe, phantom: Phantom) -> str:
    shift = len(above.nodes)
    nodes = np.concatenate([above.nodes, below.nodes])
    elements = np.concatenate([above.elements, below.elements + shift])
    layer = np.concatenate([above.layer, below.layer])
    used = np.unique(elements)
    lines = ["*NODE,NSET=ALL", *(f"{n + 1},{nodes[n, 0]:.12g},{nodes[n, 1]:.12g}" for n in used)]
    materials = [*((one.young_kpa, one.poisson) for one in probe.layers), (phantom.young_kpa, phantom.poisson)]
    for index, (young, poisson) in enumerate(materials):
        chosen = np.flatnonzero(layer == index)
        lines.append(f"*ELEMENT,TYPE=CAX8,ELSET=E{index}")
        lines += [f"{e + 1}," + ",".join(str(n + 1) for n in elements[e]) for e in chosen]
        lines += [
            f"*MATERIAL,NAME=M{index}",
            "*ELASTIC",
            f"{young},{poisson}",
            f"*SOLID SECTION,ELSET=E{index},MATERIAL=M{index}",
        ]
    top = above.nodes[:, 1].max()
    glass = [n for n in used if n < shift and abs(nodes[n, 1] - top) < 1e-9]
    wall = [n for n in used if n >= shift and abs(nodes[n, 1] + phantom.thickness_mm) < 1e-9]
    axis = [n for n in used if nodes[n, 0] < 1e-9]
    lines += ["*NSET,NSET=GLASS", *(f"{n + 1}," for n in glass)]
    tied = {round(nodes[n, 0], 9): n for n in used if n >= shift and abs(nodes[n, 1]) < 1e-9}
    for n in used:
        if n < shift and abs(nodes[n, 1]) < 1e-9:
            lines += ["*EQUATION", "2", f"{n + 1},2,1.,{tied[round(nodes[n, 0], 9)] + 1},2,-1."]
    lines += ["*BOUNDARY", *(f"{n + 1},1,2" for n in wall), *(f"{n + 1},1,1" for n in {*glass, *axis} - {*wall})]
    lines += ["*STEP", "*STATIC", "*BOUNDARY", "GLASS,2,2,-1.", "*NODE PRINT,NSET=GLASS,TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join(lines) + "\n"
