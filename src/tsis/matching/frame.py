"""Coordinates in which a point set has its mean in the origin and a root-mean-square distance of 1 from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NormalFrame:
    """Where a point set lies, ``centre`` of shape (d,), and how large it is, in its own unit."""

    centre: NDArray[np.float64]
    size: float

    @classmethod
    def of(cls, points: NDArray[np.float64]) -> NormalFrame:
        """The frame of points, shape (n, d), that are not all in one place."""
        centre = points.mean(axis=0)
        return cls(centre=centre, size=float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean())))

    def inward(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """From the set's own unit to its frame."""
        return np.asarray((points - self.centre) / self.size)

    def outward(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """From the frame to the set's own unit."""
        return np.asarray(points * self.size + self.centre)
