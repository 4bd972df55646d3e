"""The outline of a probe whose rim is rounded, so that contact at its edge has a direction everywhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Probe


@dataclass(frozen=True, slots=True, kw_only=True)
class RoundedProbe:
    """A probe with a rounded rim.

    Places on the outline are lengths in mm along the face of the flat probe, from the axis over the rim up the side.

    Parameters
    ----------
    probe
        The probe.
    fillet_mm
        Radius of the rim; see `rounded`.
    """

    probe: Probe
    fillet_mm: float

    @property
    def radius_mm(self) -> float:
        """Radius of the face, the rim included, mm."""
        return self.probe.radius_mm

    @property
    def middle_mm(self) -> float:
        """Place of the middle of the rim on the outline, mm."""
        return self.radius_mm - self.fillet_mm * (1 - np.pi / 4)

    def points(self, arc_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points (r, z) of the undeformed outline, z downwards from the apex, mm, shape (k, 2)."""
        return self.bulge(self.flat_points(arc_mm))

    def flat_points(self, arc_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same before the face is domed."""
        flat, fillet = self.radius_mm - self.fillet_mm, self.fillet_mm
        turn = np.clip((arc_mm - flat) / fillet, 0.0, np.pi / 2)
        up = np.maximum(arc_mm - flat - fillet * np.pi / 2, 0.0)
        return np.column_stack([np.minimum(arc_mm, flat) + fillet * np.sin(turn), -fillet * (1 - np.cos(turn)) - up])

    def arc_at(self, radius_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Places of the face's material points at ``radius_mm``, mm."""
        flat = self.radius_mm - self.fillet_mm
        beyond = np.clip((radius_mm - flat) / self.fillet_mm, 0.0, 1.0)
        return np.asarray(np.minimum(radius_mm, flat) + self.fillet_mm * np.arcsin(beyond))

    def radius_at(self, arc_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Material radius of places on the outline, mm."""
        return self.flat_points(arc_mm)[:, 0]

    def bulge(self, nodes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Nodes (r, z) of a flat probe after its layers bulge in proportion, the glass staying flat."""
        thickness = self.probe.thickness_mm
        share = (thickness - self.probe.sag_mm(np.minimum(nodes[:, 0], self.radius_mm))) / thickness
        return np.column_stack([nodes[:, 0], (nodes[:, 1] + thickness) * share - thickness])


def rounded(probe: Probe, fillet_mm: float) -> RoundedProbe:
    """Round the rim with ``fillet_mm``, or less on thin first layers (a quarter) and small faces (a tenth)."""
    return RoundedProbe(probe=probe, fillet_mm=min(fillet_mm, probe.layers[0].thickness_mm / 4, probe.radius_mm / 10))
