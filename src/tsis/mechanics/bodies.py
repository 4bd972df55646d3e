"""The probe and the slab, each reduced to its stiffness on the contact face.

Only normal displacements of face nodes survive: the contact is frictionless, so tangential ones are free. The first
``len(face.radius_mm)`` degrees of freedom of every body are those normal displacements, in the order of the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics import mesh
from tsis.mechanics.condensed import EMPTY, FIXED, Condensate, sweep
from tsis.mechanics.face import Face

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Probe


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
        Element layers between the inclusion and the block that holds it.
    sphere_layers
        Element layers inside the inclusion.
    """

    order: int = 5
    edge: float = 0.01
    growth: float = 2.2
    largest: float = 0.2
    below_cells: int = 3
    ray_layers: int = 5
    sphere_layers: int = 1


def face_of(radius_mm: float, resolution: Resolution) -> Face:
    """The contact face of a probe of ``radius_mm``."""
    lines = mesh.face_lines(
        radius_mm,
        finest=resolution.edge * radius_mm,
        growth=resolution.growth,
        largest=resolution.largest * radius_mm,
    )
    return Face(lines=lines, order=resolution.order)


def probe_stiffness(probe: Probe, resolution: Resolution) -> NDArray[np.float64]:
    """Stiffness of the probe's face in mN/mm, shape (n, n); glass bonded and fixed, sides free."""
    face = face_of(probe.radius_mm, resolution)
    depth, young, poisson = [np.zeros(1)], [], []
    finest = resolution.edge * probe.radius_mm
    for layer in probe.layers:
        lines = mesh.both_ends(layer.thickness_mm, finest=finest, growth=resolution.growth, largest=probe.radius_mm / 3)
        depth.append(depth[-1][-1] + lines[1:])
        young += [layer.young_kpa] * (len(lines) - 1)
        poisson += [layer.poisson] * (len(lines) - 1)
    body = mesh.rectangle(face.lines, np.concatenate(depth)[::-1], resolution.order, a_is_radius=True)
    count, layers, _ = body.nodes.shape
    dofs = count + np.arange(count * layers * 2).reshape(count, layers, 2)
    dofs[:, 0] = FIXED  # bonded to the glass
    dofs[0, :, 0] = FIXED  # the axis
    dofs[:, -1, 1] = np.arange(count)
    keep = np.arange(count)
    swept = sweep(body, dofs, keep=keep, young_kpa=np.array(young[::-1]), poisson=np.array(poisson[::-1]))
    return swept.keep(keep).stiffness


class Slab:
    """Plain tissue of unit modulus around the block that an inclusion may occupy, condensed once.

    Parameters
    ----------
    thickness_mm, poisson
        The slab, bonded to a rigid chest wall below.
    probe_radius_mm
        Radius of the face that presses it.
    block_mm
        Least radius of the block around the axis in which inclusions are meshed.
    """

    def __init__(
        self, *, thickness_mm: float, poisson: float, probe_radius_mm: float, block_mm: float, resolution: Resolution
    ) -> None:
        self.thickness_mm, self.poisson, self.resolution = thickness_mm, poisson, resolution
        self.face = face_of(probe_radius_mm, resolution)
        # Cut off where neither the face nor the thickness is felt any more: 4 thicknesses leave 0.1 %.
        outer = max(10 * probe_radius_mm, 4 * thickness_mm)
        finest = resolution.edge * probe_radius_mm
        beyond = mesh.beyond_lines(probe_radius_mm, outer, finest=finest, growth=resolution.growth)
        lines = np.concatenate([self.face.lines, beyond[1:]])
        split = int(np.searchsorted(lines, block_mm))
        self._block_lines, self._far_lines = lines[: split + 1], lines[split:]
        self._depth = mesh.graded(thickness_mm, finest, resolution.growth, thickness_mm / 3)

    @property
    def _contacts(self) -> int:
        return len(self.face.radius_mm)

    @cached_property
    def _far(self) -> tuple[Condensate, NDArray[np.int64]]:
        """Tissue outside the block, and the numbers of the block's side, shape (depths, 2)."""
        body, dofs = self._strip(self._far_lines, self._contacts)
        return self._sweep(body, dofs, np.arange(self._contacts)), dofs[:, -1]

    def plain_stiffness(self) -> NDArray[np.float64]:
        """Face stiffness (n, n) in mm of plain tissue of unit modulus, on a mesh that knows of no inclusion."""
        far, side = self._far
        body, dofs = self._strip(self._block_lines, 1 + max(int(far.dofs.max()), int(side.max())))
        dofs[:, 0] = side
        dofs[:, -1, 0] = FIXED  # the axis
        faces = np.arange(self._contacts)
        return self._sweep(body, dofs, faces, start=far).keep(faces).stiffness

    def _strip(self, lines: NDArray[np.float64], first: int) -> tuple[mesh.LayeredMesh, NDArray[np.int64]]:
        """The whole depth between two radii, swept inwards, its displacements numbered from ``first``."""
        body = mesh.rectangle(self._depth, lines[::-1], self.resolution.order, a_is_radius=False)
        depths, radii, _ = body.nodes.shape
        dofs = first + np.arange(depths * radii * 2).reshape(depths, radii, 2)
        dofs[-1] = FIXED  # bonded to the chest wall
        self._number_contacts(body.nodes[0, :, 0], dofs[0, :, 1])
        return body, dofs

    def _sweep(
        self,
        body: mesh.LayeredMesh,
        dofs: NDArray[np.int64],
        keep: NDArray[np.int64],
        *,
        start: Condensate = EMPTY,
        poisson: float | None = None,
    ) -> Condensate:
        """Condense a part of the slab; all of it has unit modulus."""
        ratio = np.full(body.layers, self.poisson if poisson is None else poisson)
        return sweep(body, dofs, keep=keep, young_kpa=np.ones(body.layers), poisson=ratio, start=start)

    def _number_contacts(self, radius: NDArray[np.float64], normal: NDArray[np.int64]) -> None:
        """Give the face's nodes among ``radius`` their shared numbers (in place)."""
        distance = np.abs(radius[:, None] - self.face.radius_mm)
        nearest = distance.argmin(axis=1)
        on_face = distance.min(axis=1) < 1e-9 * self.face.lines[-1]
        normal[on_face] = nearest[on_face]

    def _boundary(self) -> NDArray[np.float64]:
        """Outer nodes of the block: along the face, down the side, back along the chest wall."""
        order, edge, bottom = self.resolution.order, self._block_lines[-1], self.thickness_mm
        top = mesh.refine(self._block_lines, order)
        side = mesh.refine(self._depth, order)
        back = mesh.refine(np.linspace(edge, 0.0, self.resolution.below_cells + 1), order)
        return np.concatenate(
            [
                np.column_stack([top, np.zeros_like(top)]),
                np.column_stack([np.full_like(side, edge), side])[1:],
                np.column_stack([back, np.full_like(back, bottom)])[1:],
            ]
        )

    def with_sphere(self, *, diameter_mm: float, depth_mm: float, poisson: float) -> SlabWithSphere:
        """Mesh a sphere into the block and condense everything onto the face and the sphere's surface."""
        far, side = self._far
        boundary, order = self._boundary(), self.resolution.order
        centre, radius = depth_mm + diameter_mm / 2, diameter_mm / 2
        outer = mesh.around_sphere(boundary, centre, radius, order, layers=self.resolution.ray_layers)
        count, layers, _ = outer.nodes.shape
        first = 1 + max(int(far.dofs.max()), int(side.max()))
        dofs = first + np.arange(count * layers * 2).reshape(count, layers, 2)
        top = (len(self._block_lines) - 1) * order
        dofs[top : top + len(side), 0] = side
        dofs[top + len(side) - 1 :, 0] = FIXED  # the chest wall
        self._number_contacts(boundary[: top + 1, 0], dofs[: top + 1, 0, 1])
        dofs[[0, -1], :, 0] = FIXED  # the axis
        faces = np.arange(self._contacts)
        around = self._sweep(outer, dofs, faces, start=far)
        inner = mesh.inside_sphere(boundary, centre, radius, order, layers=self.resolution.sphere_layers)
        core = int(dofs.max()) + 1 + np.arange(count * inner.nodes.shape[1] * 2).reshape(count, -1, 2)
        core[:, 0, 0], core[:, 0, 1] = FIXED, core[0, 0, 1]  # the centre is one node on the axis
        core[[0, -1], :, 0] = FIXED
        core[:, -1] = dofs[:, -1]
        nothing = np.zeros(0, dtype=np.int64)
        ball = self._sweep(inner, core, nothing, poisson=poisson)
        same = ball if poisson == self.poisson else self._sweep(inner, core, nothing)
        return SlabWithSphere(around=around, ball=ball, plain_ball=same, faces=faces)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlabWithSphere:
    """A slab of unit modulus with a sphere whose modulus is still open."""

    around: Condensate
    ball: Condensate
    plain_ball: Condensate
    faces: NDArray[np.int64]

    def stiffness(self, contrast: float) -> NDArray[np.float64]:
        """Face stiffness (n, n) in mm when the sphere is ``contrast`` times as stiff as unit tissue."""
        return (self.around + self.ball * contrast).keep(self.faces).stiffness

    def plain_stiffness(self) -> NDArray[np.float64]:
        """Face stiffness of plain tissue on the SAME mesh: the baseline that does not manufacture signal."""
        return (self.around + self.plain_ball).keep(self.faces).stiffness
