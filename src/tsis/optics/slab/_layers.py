"""A stack between two half-spaces, in units of the wavelength."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from tsis.errors import InputError
from tsis.optics import _inputs as inputs
from tsis.optics.slab import _phase as slab_phase

if TYPE_CHECKING:
    from tsis.optics._inputs import Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlabLayers:
    """Regions from below up: the half-space below, the layers, the half-space above.

    Attributes
    ----------
    index
        Refractive index of each region, (layers + 2,).
    thickness_um
        Thickness of each in µm, 0 for the half-spaces.
    wavelength_um
        Wavelength in vacuum, µm.
    polarization
        ``"TE"`` or ``"TM"``.
    """

    index: Floats
    thickness_um: Floats
    wavelength_um: float
    polarization: str

    @classmethod
    def checked(
        cls, index: Any, thickness_um: Any, wavelength_um: Any, index_below: Any, index_above: Any, polarization: Any
    ) -> Self:
        """Check the arguments; see `tsis.optics.guided_modes` for the ranges."""
        indices, thicknesses = inputs.require_stack(index, thickness_um)
        outside = [
            inputs.require_refractive_index(name, value)
            for name, value in (("index_below", index_below), ("index_above", index_above))
        ]
        if polarization not in ("TE", "TM"):
            raise InputError(f"polarization must be 'TE' or 'TM'; got {polarization!r}")
        return cls(
            index=np.concatenate([outside[:1], indices, outside[1:]]),
            thickness_um=np.concatenate([[0.0], thicknesses, [0.0]]),
            wavelength_um=inputs.require_wavelength(wavelength_um),
            polarization=str(polarization),
        )

    @property
    def per_um(self) -> float:
        """Wavenumber of vacuum, 1/µm."""
        return 2 * np.pi / self.wavelength_um

    @property
    def surroundings(self) -> float:
        """The larger index of the two half-spaces; guided modes lie above it."""
        return float(max(self.index[0], self.index[-1]))

    @property
    def core(self) -> int:
        """Region of highest index, where all guided modes oscillate."""
        return int(np.argmax(self.index))

    @property
    def weight(self) -> Floats:
        """Divisor that makes the field's slope continuous: 1 of TE, the squared index of TM."""
        return np.ones_like(self.index) if self.polarization == "TE" else self.index**2

    def weight_at(self, x_um: Floats) -> Floats:
        """The weight at heights above the lower face of the first layer; an interface has that of the layer above."""
        return np.asarray(self.weight[np.searchsorted(self.faces_um, x_um, side="right")])

    @property
    def faces_um(self) -> Floats:
        """Heights of the interfaces, (layers + 1,), the first at 0."""
        return np.cumsum(self.thickness_um[:-1])

    def at(self, anchor: float) -> tuple[Floats, Floats, Floats]:
        """Input of the phase: squares of the indices less ``anchor**2``, weights, thicknesses times k0."""
        return (self.index - anchor) * (self.index + anchor), self.weight, self.thickness_um * self.per_um

    def modes_above(self, anchor: float, offset: float) -> int:
        """Number of modes with a squared effective index above ``anchor**2 + offset``."""
        return slab_phase.modes_above(*self.at(anchor), offset, self.core)


def thickness_factor(layers: SlabLayers) -> float:
    """Least factor on all thicknesses at which the stack guides a mode, to six digits; at most 1 for a guiding stack.

    Between unequal surroundings a thin stack is below cut-off. A layer's index must exceed the surroundings.
    """
    high = 1.0
    while not _guides(layers, high):
        high *= 2
    low = 0.0
    while high - low > 1e-6 * high:
        middle = (low + high) / 2
        low, high = (low, middle) if _guides(layers, middle) else (middle, high)
    return high


def _guides(layers: SlabLayers, factor: float) -> bool:
    thicker = replace(layers, thickness_um=factor * layers.thickness_um)
    return thicker.modes_above(layers.surroundings, 0.0) > 0
