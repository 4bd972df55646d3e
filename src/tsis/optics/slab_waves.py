"""A solution in a stack as two waves a region, one that starts at the lower end and one at the upper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.optics.slab_layers import SlabLayers

FLATTEST = 1e-5  # least rate times length: the two waves become one, and errors of 1e-10 either way are balanced


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waves:
    """``u = a exp(-g s) + b exp(-g (l - s))`` at s from the lower end of a region of length l, in units of 1 / k0.

    Where the mode fades, g is real and each wave dies away from its own end, so none is ever a difference of two large
    ones; where it oscillates, g is imaginary and the waves travel up and down.

    Attributes
    ----------
    layers
        The stack.
    rate
        g of each region, complex, (layers + 2,).
    from_lower, from_upper
        a and b of each region, complex; a is 0 in the half-space below and b in that above.
    """

    layers: SlabLayers
    rate: NDArray[np.complex128]
    from_lower: NDArray[np.complex128]
    from_upper: NDArray[np.complex128]

    @classmethod
    def between(
        cls, layers: SlabLayers, q: NDArray[np.float64], lower: NDArray[np.float64], upper: NDArray[np.float64]
    ) -> Self:
        """The waves that have given u and v at the ends of regions, (layers + 2, 2) each, where u'' = -q u."""
        length = layers.thickness_um * layers.per_um
        floor = np.divide(FLATTEST**2, length**2, out=np.zeros_like(length), where=length > 0)
        rate = np.sqrt(-np.where(q < 0, np.minimum(q, -floor), np.maximum(q, floor)) + 0j)
        through = _through(layers, rate)
        # Oscillating: from u and u' at the lower end. Fading: from u at both, as u' there is a difference.
        slope = layers.weight * lower[:, 1] / rate
        travels = q > 0
        from_lower = np.where(
            travels, (lower[:, 0] - slope) / 2, (lower[:, 0] - upper[:, 0] * through) / (1 - through**2)
        )
        back = np.where(travels, np.conj(through), 0)
        from_upper = np.where(
            travels, (lower[:, 0] + slope) / 2 * back, (upper[:, 0] - lower[:, 0] * through) / (1 - through**2)
        )
        return cls(layers=layers, rate=rate, from_lower=from_lower, from_upper=from_upper)

    def wave(self, x_um: NDArray[np.float64]) -> NDArray[np.float64]:
        """U at heights above the lowest face, µm."""
        _, up, down = self._parts(x_um)
        return (up + down).real

    def slope(self, x_um: NDArray[np.float64]) -> NDArray[np.float64]:
        """V, which is du/dx over k0 p."""
        region, up, down = self._parts(x_um)
        return (self.rate[region] / self.layers.weight[region] * (down - up)).real

    def _parts(
        self, x_um: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.complex128], NDArray[np.complex128]]:
        faces = self.layers.faces_um
        region = np.searchsorted(faces, x_um, side="right")
        above = np.maximum(x_um - np.concatenate([faces[:1], faces])[region], 0.0)
        below = np.maximum(np.concatenate([faces, faces[-1:]])[region] - x_um, 0.0)
        g = self.rate[region] * self.layers.per_um
        return region, self.from_lower[region] * np.exp(-g * above), self.from_upper[region] * np.exp(-g * below)


def overlap_um(one: Waves, other: Waves) -> float:
    """Integral of the product of two solutions over p, in µm, in closed form."""
    layers, sum_of_rates = one.layers, one.rate + other.rate
    length = layers.thickness_um * layers.per_um
    alike = one.from_lower * other.from_lower + one.from_upper * other.from_upper
    opposed = one.from_lower * other.from_upper + one.from_upper * other.from_lower
    fading = (1 - _through(layers, one.rate) * _through(layers, other.rate)) / sum_of_rates
    beating = length * np.exp(-sum_of_rates * length / 2) * _sinhc((one.rate - other.rate) * length / 2)
    return float(np.sum((alike * fading + opposed * beating) / layers.weight).real) / layers.per_um


def _through(layers: SlabLayers, rate: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """What is left of a wave at the other end of its region; a half-space has none."""
    length = layers.thickness_um * layers.per_um
    return np.where(length > 0, np.exp(-rate * length), 0)


def _sinhc(z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    small = np.abs(z) < 1e-4
    safe = np.where(small, 1, z)
    return np.where(small, 1 + z**2 / 6, np.sinh(safe) / safe)
