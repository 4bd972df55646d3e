"""What displacing and tilting the face does to the light that rings of it see."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

TERMS = 3  # of the emphasis along the radius
DARKEST = 1e-3  # light on a flank that the lamps do not reach, over that on the level face


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingShading:
    """Factor ``(exp(growth u + bend u**2) (1 + flux u'))^(1 + emphasis)`` of each ring's light, for a round press.

    The face is displaced by u. The emphasis is the error in what is known of this factor, 0 when that is exact: a
    parabola along the radius, because what is wrong in a map of light is not wrong in the same way everywhere.

    Attributes
    ----------
    growth_per_mm
        Growth of the light with the displacement, weighted by the light, shape (rings,).
    bend_per_mm2
        Second order of its logarithm, weighted by the light, shape (rings,).
    flux
        Power travelling outwards over the power travelling into the face, weighted by the light, shape (rings,).
    """

    growth_per_mm: NDArray[np.float64]
    bend_per_mm2: NDArray[np.float64]
    flux: NDArray[np.float64]

    def __call__(
        self, displacement_mm: NDArray[np.float64], slope: NDArray[np.float64], emphasis: NDArray[np.float64]
    ) -> ShadingFactor:
        """Evaluate displacements and slopes (n, rings) with Legendre coefficients (`TERMS`,) of the emphasis."""
        parabolas, power = self._power(emphasis)
        tilt, logarithm = self._logarithm(displacement_mm, slope)
        factor = np.exp(power * logarithm)
        return ShadingFactor(
            factor=factor,
            by_displacement=power * factor * (self.growth_per_mm + 2 * self.bend_per_mm2 * displacement_mm),
            by_slope=np.where(tilt > DARKEST, power * factor * self.flux / tilt, 0.0),
            by_emphasis=(factor * logarithm)[..., None] * parabolas,
        )

    def factor(
        self, displacement_mm: NDArray[np.float64], slope: NDArray[np.float64], emphasis: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """The factor alone."""
        return np.asarray(np.exp(self._power(emphasis)[1] * self._logarithm(displacement_mm, slope)[1]))

    def _power(self, emphasis: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Parabolas along the radius, (rings, terms), and one plus the emphasis, (rings,)."""
        parabolas = _parabolas(len(self.flux))
        return parabolas, np.asarray(1 + parabolas @ emphasis)

    def _logarithm(
        self, displacement_mm: NDArray[np.float64], slope: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Light on the tilted face over that on the level one, and the log of the factor without emphasis."""
        tilt = np.maximum(1 + self.flux * slope, DARKEST)
        grows = (self.growth_per_mm + self.bend_per_mm2 * displacement_mm) * displacement_mm
        return tilt, grows + np.log(tilt)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShadingFactor:
    """The factor and its derivatives by displacement and slope, (n, rings), and by the emphasis, (n, rings, terms)."""

    factor: NDArray[np.float64]
    by_displacement: NDArray[np.float64]
    by_slope: NDArray[np.float64]
    by_emphasis: NDArray[np.float64]


@cache
def _parabolas(rings: int) -> NDArray[np.float64]:
    """Legendre polynomials along the radius, shape (rings, terms)."""
    parabolas = np.asarray(np.polynomial.legendre.legvander(np.linspace(-1.0, 1.0, rings), TERMS - 1), dtype=float)
    parabolas.flags.writeable = False
    return parabolas
