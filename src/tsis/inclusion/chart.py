"""Coordinates in which the posterior of an inclusion is nearly straight.

Diameter and modulus trade off along a curve of equal signal ``d**3 g(E)``. With ``d g(E)**(1/3)`` in place of the
diameter that curve becomes nearly a straight line, which a sheared grid can follow. What it is still bent is taken from
a first look at the posterior: a parabola along the modulus, of the signal's diameter and of the depth.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics import contrast_factor

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.inclusion.prior import InclusionPrior

ROUNDING = 1e-9  # of a range: ends of a grid that are those of the prior lie inside


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SignalChart:
    """Points (signal diameter, depth, modulus), each (n, 3), and back to inclusions (diameter, depth, modulus).

    Attributes
    ----------
    prior
        Ranges of the inclusions.
    bend_mm
        What is taken off signal diameter and depth at either end of the modulus's range, shape (2,).
    """

    prior: InclusionPrior
    bend_mm: NDArray[np.float64]

    @property
    def low(self) -> NDArray[np.float64]:
        """Lower corner of a box of points that holds the prior."""
        bend = np.append(np.maximum(self.bend_mm, 0.0), 0.0)
        return np.asarray(self.prior.low * np.array([self._stretch(self.prior.low[2]), 1.0, 1.0]) - bend)

    @property
    def high(self) -> NDArray[np.float64]:
        """Upper corner of a box of points that holds the prior."""
        bend = np.append(np.minimum(self.bend_mm, 0.0), 0.0)
        return np.asarray(self.prior.high * np.array([self._stretch(self.prior.high[2]), 1.0, 1.0]) - bend)

    def inclusions(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Inclusions at ``points``."""
        straight = points[:, :2] + self._parabola(points[:, 2]) * self.bend_mm
        return np.column_stack(
            [straight[:, 0] / self._stretch(self._inside(points[:, 2])), straight[:, 1], points[:, 2]]
        )

    def points(self, inclusions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of ``inclusions``."""
        straight = inclusions[:, :2] * np.column_stack([self._stretch(inclusions[:, 2]), np.ones(len(inclusions))])
        return np.column_stack([straight - self._parabola(inclusions[:, 2]) * self.bend_mm, inclusions[:, 2]])

    def straightened(self, inclusions: NDArray[np.float64], weight: NDArray[np.float64]) -> SignalChart:
        """The chart in which weighted inclusions (n, 3) lie as straight along the modulus as a parabola can make it."""
        unbent = replace(self, bend_mm=np.zeros(2)).points(inclusions)
        turn = self._turn(unbent[:, 2])
        root = np.sqrt(weight)[:, None]
        basis = np.column_stack([np.ones_like(turn), turn, turn**2])
        factors, *_ = np.linalg.lstsq(root * basis, root * unbent[:, :2], rcond=None)
        return replace(self, bend_mm=factors[2])

    def allows(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Where the prior is not zero, shape (n,)."""
        inclusions = self.inclusions(points)
        margin = ROUNDING * (self.prior.high - self.prior.low)
        inside = (inclusions >= self.prior.low - margin) & (inclusions <= self.prior.high + margin)
        return np.asarray(inside.all(axis=1))

    def log_volume(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Log of the volume of inclusions per volume of points, which keeps the prior uniform in inclusions."""
        return np.asarray(-np.log(self._stretch(self._inside(points[:, 2]))))

    def _stretch(self, young_kpa: NDArray[np.float64] | float) -> NDArray[np.float64]:
        return np.asarray(np.cbrt(contrast_factor(np.asarray(young_kpa) / self.prior.tissue_young_kpa)))

    def _inside(self, young_kpa: NDArray[np.float64]) -> NDArray[np.float64]:
        """Moduli no further out than the prior: corners of a grid may lie where nothing can be said."""
        return np.clip(young_kpa, self.prior.low[2], self.prior.high[2])

    def _turn(self, young_kpa: NDArray[np.float64]) -> NDArray[np.float64]:
        """Place in the modulus's range, from -1 to 1."""
        low, high = self.prior.low[2], self.prior.high[2]
        return np.asarray((2 * young_kpa - low - high) / (high - low))

    def _parabola(self, young_kpa: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(self._turn(young_kpa) ** 2)[:, None]
