"""Coordinates in which the posterior of an inclusion is nearly straight.

Diameter and modulus trade off along a curve of equal signal ``d**3 g(E)``. With ``d g(E)**(1/3)`` in place of the
diameter that curve becomes a straight line, which a sheared grid can follow.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics import contrast_factor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.prior import InclusionPrior


ROUNDING = 1e-9  # of a range: ends of a grid that are those of the prior lie inside


class SignalChart:
    """Points (signal diameter, depth, modulus), each (n, 3), and back to inclusions (diameter, depth, modulus)."""

    def __init__(self, prior: InclusionPrior) -> None:
        self._prior = prior
        soft, stiff = self._stretch(prior.low[2]), self._stretch(prior.high[2])
        self.low = prior.low * np.array([soft, 1.0, 1.0])
        self.high = prior.high * np.array([stiff, 1.0, 1.0])

    def _stretch(self, young_kpa: NDArray[np.float64] | float) -> NDArray[np.float64]:
        return np.asarray(np.cbrt(contrast_factor(np.asarray(young_kpa) / self._prior.tissue_young_kpa)))

    def inclusions(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Inclusions at ``points``."""
        young = np.clip(points[:, 2], self._prior.low[2], self._prior.high[2])
        return np.column_stack([points[:, 0] / self._stretch(young), points[:, 1], points[:, 2]])

    def allows(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the prior is not zero, shape (n,)."""
        inclusions = self.inclusions(points)
        margin = ROUNDING * (self._prior.high - self._prior.low)
        inside = (inclusions >= self._prior.low - margin) & (inclusions <= self._prior.high + margin)
        return np.asarray(inside.all(axis=1))

    def log_volume(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log of the volume of inclusions per volume of points, which keeps the prior uniform in inclusions."""
        young = np.clip(points[:, 2], self._prior.low[2], self._prior.high[2])
        return -np.log(self._stretch(young))
