"""What a surface slides on: the smoothed face of a soft body, or a rigid plate, by its gaps and their derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.finite_strain.smooth_face import SmoothFace


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gaps:
    """Signed gaps of k points and their derivatives by the m unknown coordinates that they depend on.

    Attributes
    ----------
    gap_mm
        Shape (k,).
    slope
        First derivatives, shape (k, m).
    curvature
        Sum over the points of a weight times the second derivatives, shape (m, m).
    """

    gap_mm: NDArray[np.float64]
    slope: NDArray[np.float64]
    curvature: NDArray[np.float64]


class Obstacle(Protocol):
    """What a surface slides on."""

    nodes: NDArray[np.int64]

    def gap(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed distance of ``points`` (k, 2) in mm, positive outside."""

    def normals(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Outward unit normals at the feet of ``points``, shape (k, 2)."""

    def differentiate(
        self,
        positions: NDArray[np.float64],
        points: NDArray[np.float64],
        shapes: NDArray[np.float64],
        force: NDArray[np.float64],
    ) -> Gaps:
        """Gaps with derivatives by (slave coordinates, own coordinates); ``shapes`` (k, slaves), ``force`` (k,)."""


class SoftFace:
    """The face of a deformable body, smoothed."""

    def __init__(self, face: SmoothFace, nodes: NDArray[np.int64]) -> None:
        self.face, self.nodes = face, nodes

    def gap(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed distance of ``points`` (k, 2) in mm, positive outside."""
        return self.face.closest(positions, points).gap_mm

    def normals(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Outward unit normals at the feet of ``points``, shape (k, 2)."""
        return self.face.closest(positions, points).normal

    def differentiate(
        self,
        positions: NDArray[np.float64],
        points: NDArray[np.float64],
        shapes: NDArray[np.float64],
        force: NDArray[np.float64],
    ) -> Gaps:
        """Exact first and second derivatives of the closest-point gap.

        With the curve ``y(t)``, its normal n, ``m = |y'|^2``, ``k = n y''`` and ``D = m - g k``: the gap changes by
        ``n (dx - dy)``, and twice by ``-(k/m a a + a b + b a + g b b)/D`` with ``a = y' (dx - dy)``, ``b = n dy'``.
        """
        foot = self.face.closest(positions, points)
        here, there = self.face.weights(foot.place), self.face.weights(foot.place, 1)
        count, slaves, own = len(points), shapes.shape[1], len(self.nodes)
        relative = np.zeros((count, slaves + own, 2, 2))  # of the point to its foot: direction, moved coordinate
        turning = np.zeros((count, slaves + own, 2, 2))
        for i in (0, 1):
            relative[:, :slaves, i, i] = shapes
            relative[:, slaves:, i, i] = -here[:, i]
            turning[:, slaves:, i, i] = there[:, i]
        flat = (count, (slaves + own) * 2)
        slope = np.einsum("ksdi,kd->ksi", relative, foot.normal).reshape(flat)
        a = np.einsum("ksdi,kd->ksi", relative, foot.slope).reshape(flat)
        b = np.einsum("ksdi,kd->ksi", turning, foot.normal).reshape(flat)
        metric = (foot.slope**2).sum(axis=1)
        bend = (foot.normal * foot.bend).sum(axis=1)
        share = force / (metric - foot.gap_mm * bend)
        mixed = a.T @ (share[:, None] * b)
        curvature = -(
            a.T @ ((share * bend / metric)[:, None] * a) + mixed + mixed.T + b.T @ ((share * foot.gap_mm)[:, None] * b)
        )
        return Gaps(gap_mm=foot.gap_mm, slope=slope, curvature=curvature)


class Plate:
    """A rigid frictionless plane that faces a body from larger z and moves towards smaller z.

    Parameters
    ----------
    node
        A point of the list of nodes that belongs to no element; its displacement along z is the plate's travel.
    height_mm
        Where the plate is before it travels, mm.
    """

    def __init__(self, node: int, height_mm: float) -> None:
        self.nodes, self._height = np.array([node]), height_mm

    def gap(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Signed distance of ``points`` (k, 2) in mm, positive outside."""
        return np.asarray(self._height - positions[0, 1] - points[:, 1])

    def normals(self, positions: NDArray[np.float64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Outward unit normals at the feet of ``points``, shape (k, 2)."""
        return np.tile([0.0, -1.0], (len(points), 1))

    def differentiate(
        self,
        positions: NDArray[np.float64],
        points: NDArray[np.float64],
        shapes: NDArray[np.float64],
        force: NDArray[np.float64],
    ) -> Gaps:
        """The gap is linear in the coordinates."""
        slope = np.zeros((len(points), shapes.shape[1] + 1, 2))
        slope[:, :-1, 1], slope[:, -1, 1] = -shapes, -1.0
        flat = slope.reshape(len(points), -1)
        size = flat.shape[1]
        return Gaps(gap_mm=self.gap(positions, points), slope=flat, curvature=np.zeros((size, size)))
