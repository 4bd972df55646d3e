"""The slab of tissue, with or without an inclusion, reduced to its compliance on the contact face.

The first ``len(face.radius_mm)`` degrees of freedom of every part are the normal displacements of the face's nodes, in
their order; nothing else survives, as the contact is frictionless.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.condensed import EMPTY, FIXED, Condensate, condense_layers
from tsis.mechanics.mesh import LayeredMesh, graded, mesh_around, mesh_inside, mesh_rectangle, outer_lines, refine

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.bodies import Resolution
    from tsis.mechanics.face import Face
    from tsis.mechanics.mesh import Spheroid


class Slab:
    """Plain tissue of unit modulus around the block that an inclusion may occupy, condensed once.

    Parameters
    ----------
    thickness_mm, poisson
        The slab, bonded to a rigid chest wall below.
    face
        The face that presses it.
    block_mm
        Least radius of the block around the axis in which inclusions are meshed.
    resolution
        Mesh density.
    """

    def __init__(
        self, *, thickness_mm: float, poisson: float, face: Face, block_mm: float, resolution: Resolution
    ) -> None:
        self.thickness_mm, self.poisson, self.face, self.resolution = thickness_mm, poisson, face, resolution
        # Cut off where neither the face nor the thickness is felt any more: 4 thicknesses leave 0.1 %.
        edge = float(face.lines[-1])
        outer, finest = max(10 * edge, 4 * thickness_mm), resolution.edge * edge
        beyond = outer_lines(edge, outer, finest=finest, growth=resolution.growth)
        lines = np.concatenate([face.lines, beyond[1:]])
        split = int(np.searchsorted(lines, block_mm))
        self._block_lines, self._far_lines = lines[: split + 1], lines[split:]
        self._depth = graded(thickness_mm, finest, resolution.growth, thickness_mm / 3)

    @property
    def _contacts(self) -> int:
        return len(self.face.radius_mm)

    @cached_property
    def _far(self) -> tuple[Condensate, NDArray[np.int64]]:
        """Tissue outside the block, and the numbers of the block's side, shape (depths, 2)."""
        body, dofs = self._strip(self._far_lines, self._contacts)
        return self._sweep(body, dofs, np.arange(self._contacts)), dofs[:, -1]

    @cached_property
    def compliance(self) -> NDArray[np.float64]:
        """Compliance of the face in mm/mN, (n, n), of plain tissue of 1 kPa, on a mesh that knows of no inclusion."""
        far, side = self._far
        body, dofs = self._strip(self._block_lines, 1 + max(int(far.dofs.max()), int(side.max())))
        dofs[:, 0] = side
        dofs[:, -1, 0] = FIXED  # the axis
        faces = np.arange(self._contacts)
        return _inverse(self._sweep(body, dofs, faces, start=far).keep(faces))

    def _strip(self, lines: NDArray[np.float64], first: int) -> tuple[LayeredMesh, NDArray[np.int64]]:
        """The whole depth between two radii, swept inwards, its displacements numbered from ``first``."""
        body = mesh_rectangle(self._depth, lines[::-1], self.resolution.order, a_is_radius=False)
        depths, radii, _ = body.nodes.shape
        dofs = first + np.arange(depths * radii * 2).reshape(depths, radii, 2)
        dofs[-1] = FIXED  # bonded to the chest wall
        self._number_contacts(body.nodes[0, :, 0], dofs[0, :, 1])
        return body, dofs

    def _sweep(
        self,
        body: LayeredMesh,
        dofs: NDArray[np.int64],
        keep: NDArray[np.int64],
        *,
        start: Condensate = EMPTY,
        poisson: float | None = None,
    ) -> Condensate:
        """Condense a part of the slab; all of it has unit modulus."""
        ratio = np.full(body.layers, self.poisson if poisson is None else poisson)
        return condense_layers(body, dofs, keep=keep, young_kpa=np.ones(body.layers), poisson=ratio, start=start)

    def _number_contacts(self, radius: NDArray[np.float64], normal: NDArray[np.int64]) -> None:
        """Give the face's nodes among ``radius`` their shared numbers (in place)."""
        distance = np.abs(radius[:, None] - self.face.radius_mm)
        nearest = distance.argmin(axis=1)
        on_face = distance.min(axis=1) < 1e-9 * self.face.lines[-1]
        normal[on_face] = nearest[on_face]

    def _boundary(self) -> NDArray[np.float64]:
        """Outer nodes of the block: along the face, down the side, back along the chest wall."""
        order, edge, bottom = self.resolution.order, self._block_lines[-1], self.thickness_mm
        top = refine(self._block_lines, order)
        side = refine(self._depth, order)
        back = refine(np.linspace(edge, 0.0, self.resolution.below_cells + 1), order)
        return np.concatenate(
            [
                np.column_stack([top, np.zeros_like(top)]),
                np.column_stack([np.full_like(side, edge), side])[1:],
                np.column_stack([back, np.full_like(back, bottom)])[1:],
            ]
        )

    def _ray_layers(self, boundary: NDArray[np.float64], size: float) -> int:
        reach = np.linalg.norm(boundary - [0.0, self.thickness_mm / 2], axis=1).max()
        return max(self.resolution.ray_layers, int(np.ceil(np.log(reach / size) / np.log(self.resolution.ray_ratio))))

    def with_inclusion(self, shape: Spheroid, *, poisson: float) -> SlabWithInclusion:
        """Mesh an inclusion into the block and condense everything onto the face and the inclusion's surface."""
        far, side = self._far
        boundary, order = self._boundary(), self.resolution.order
        outer = mesh_around(boundary, shape, order, layers=self._ray_layers(boundary, shape.size))
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
        inner = mesh_inside(boundary, shape, order, layers=self.resolution.sphere_layers)
        core = int(dofs.max()) + 1 + np.arange(count * inner.nodes.shape[1] * 2).reshape(count, -1, 2)
        core[:, 0, 0], core[:, 0, 1] = FIXED, core[0, 0, 1]  # the centre is one node on the axis
        core[[0, -1], :, 0] = FIXED
        core[:, -1] = dofs[:, -1]
        nothing = np.zeros(0, dtype=np.int64)
        ball = self._sweep(inner, core, nothing, poisson=poisson)
        same = ball if poisson == self.poisson else self._sweep(inner, core, nothing)
        return SlabWithInclusion(around=around, ball=ball, plain_ball=same, faces=faces)


@dataclass(frozen=True, kw_only=True, eq=False)
class SlabWithInclusion:
    """A slab of unit modulus with an inclusion whose modulus is still open."""

    around: Condensate
    ball: Condensate
    plain_ball: Condensate
    faces: NDArray[np.int64]

    def compliance(self, contrast: float) -> NDArray[np.float64]:
        """Compliance of the face in mm/mN, (n, n), with an inclusion ``contrast`` times as stiff as tissue of 1 kPa."""
        return _inverse((self.around + self.ball * contrast).keep(self.faces))

    @cached_property
    def plain_compliance(self) -> NDArray[np.float64]:
        """Compliance of plain tissue on the SAME mesh: the baseline that does not manufacture signal."""
        return _inverse((self.around + self.plain_ball).keep(self.faces))

    def change(self, contrast: float) -> NDArray[np.float64]:
        """What the inclusion changes about the compliance."""
        return self.compliance(contrast) - self.plain_compliance


def _inverse(body: Condensate) -> NDArray[np.float64]:
    return np.asarray(np.linalg.inv(body.stiffness), dtype=float)
