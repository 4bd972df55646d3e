"""What displacing and tilting the face does to the light that rings of it see."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingShading:
    """Factor ``exp(growth u) (1 + flux u')`` of each ring's light, for a round press with displacement u.

    Attributes
    ----------
    growth_per_mm
        Growth of the light with the displacement, weighted by the light, shape (rings,).

    flux
        Power travelling outwards over the power travelling into the face, weighted by the light, shape (rings,).
    """

    growth_per_mm: NDArray[np.float64]
    flux: NDArray[np.float64]

    def __call__(
        self, displacement_mm: NDArray[np.float64], slope: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """The factor and its derivatives by displacement and by slope, each of the arguments' shape (n, rings)."""
        grown = np.exp(self.growth_per_mm * displacement_mm)
        factor = grown * (1 + self.flux * slope)
        return factor, self.growth_per_mm * factor, grown * self.flux
