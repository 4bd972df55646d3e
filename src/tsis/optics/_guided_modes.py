"""Guided modes of a stack of layers: their number, effective indices and fields."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, SupportsIndex

import numpy as np

from tsis.errors import InputError
from tsis.model.require import require_array, require_integer
from tsis.optics.slab import SlabField, SlabLayers, mode_field, mode_roots, nearly_degenerate

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike

    from tsis.optics._inputs import Floats


MOST_MODES = 5_000_000  # three numbers a mode: 120 MB


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GuidedModes:
    """All guided modes of a stack at one wavelength and polarization.

    Fields are functions of x, the height in µm above the lower face of the first layer, and are real. They are
    normalised in power: with e the electric and h the magnetic field across the direction of travel, the integral of
    ``e_a h_b`` over all x is 1 for a mode with itself and 0 for two modes. So e times ``sqrt(2 Z0 P)`` is in V/m for a
    mode that carries P watts a metre of width and metre of unit, and h times ``sqrt(2 P / Z0)`` is in A/m, x then being
    in metres; Z0 is the impedance of vacuum.

    Attributes
    ----------
    layers
        The stack in units of the wavelength, with its surroundings.
    n_eff
        Effective indices, descending: phase index of each mode, (modes,). Mode j has j zeros in its field. A mode at
        cut-off within rounding has the index of the surroundings.
    anchor, offset
        The same in full precision, ``n_eff**2 = anchor**2 + offset``, with the anchor an index of the stack.
    """

    layers: SlabLayers
    n_eff: Floats
    anchor: Floats
    offset: Floats

    def __post_init__(self) -> None:
        for name in ("n_eff", "anchor", "offset"):
            getattr(self, name).flags.writeable = False

    def __len__(self) -> int:
        return len(self.n_eff)

    def profile(self, mode: SupportsIndex, x_um: ArrayLike) -> Floats:
        """Electric field e across the direction of travel: E_y of TE; E_x of TM, which jumps between layers.

        Parameters
        ----------
        mode
            Index of the mode, from 0 for the largest ``n_eff``.
        x_um
            Heights in µm above the lower face of the first layer, any shape; also outside the stack.

        Raises
        ------
        InputError
            When there is no such mode, or ``x_um`` is not finite.
        """
        field, n_eff = self._field(mode), self.n_eff[mode]
        x = self._heights(x_um)
        wave = field.wave(x)
        return wave if self.layers.polarization == "TE" else wave * n_eff / self.layers.weight_at(x)

    def magnetic(self, mode: SupportsIndex, x_um: ArrayLike) -> Floats:
        """Magnetic field h across the direction of travel: -H_x of TE, H_y of TM; parameters as of `profile`."""
        field, n_eff = self._field(mode), self.n_eff[mode]
        wave = field.wave(self._heights(x_um))
        return wave * n_eff if self.layers.polarization == "TE" else wave

    def longitudinal(self, mode: SupportsIndex, x_um: ArrayLike) -> Floats:
        """Field along the direction of travel, H_z of TE and E_z of TM, a quarter of a period behind the others.

        This is the dissertation's h(x), (3.29), (3.30), (3.31), (3.32), (3.33) and (3.34), printed there with wrong
        signs. It is continuous between layers. The printed (3.27) lacks the other part of H, `magnetic`. Parameters as
        of `profile`.
        """
        return self._field(mode).slope(self._heights(x_um))

    def above(self, index: float) -> int:
        """Number of modes with an effective index above ``index``; they decay in layers of that index."""
        return int(np.count_nonzero(self.n_eff > index))

    def _field(self, mode: SupportsIndex) -> SlabField:
        if not len(self):
            raise InputError(f"mode must be a guided mode, and the stack guides none; got {mode!r}")
        number = require_integer("mode", mode, 0, len(self) - 1)
        group = nearly_degenerate(self.anchor, self.offset, self._q(number).max(), number)
        q = np.array([self._q(index) for index in range(group.start, group.stop)])
        return mode_field(self.layers, self.n_eff[group], q, number - group.start)

    def _q(self, mode: int) -> Floats:
        return np.asarray(self.layers.at(self.anchor[mode])[0] - self.offset[mode])

    def _heights(self, x_um: Any) -> Floats:
        heights = np.asarray(x_um, dtype=float)
        require_array("x_um", heights.ravel(), ndim=1)
        return heights


def guided_modes(
    index: ArrayLike,
    thickness_um: ArrayLike,
    *,
    wavelength_um: float,
    index_below: float = 1.0,
    index_above: float = 1.0,
    polarization: Literal["TE", "TM"] = "TE",
) -> GuidedModes:
    """Find all guided modes of a stack: max(n_below, n_above) < n_eff < max(n).

    The phase of a Sturm-Liouville problem counts the modes, then a bracketed search finds each to the last digits; see
    `tsis.optics.slab._phase`. This replaces the dissertation's conditions (3.40), (3.41), (3.42), (3.43) and (3.44)
    with the phases (3.45), (3.46), (3.47) and (3.48). Those are valid where all layers oscillate, and (3.46) must read
    ``-kappa_2 a_1``.

    Parameters
    ----------
    index
        Real refractive indices of the layers from below up, in [1, 5], (layers,).
    thickness_um
        Their thicknesses in µm, in [1e-4, 1e6], (layers,).
    wavelength_um
        Wavelength in vacuum, µm, in [0.1, 20].
    index_below, index_above
        Real refractive indices of the half-spaces below and above, in [1, 5].
    polarization
        ``"TE"``, the electric field along the layers, or ``"TM"``, the magnetic one.

    Returns
    -------
    GuidedModes
        Empty below cut-off: when the surroundings differ and the stack is too thin to guide.

    Raises
    ------
    InputError
        When a value lies outside its range, no layer's index exceeds that of the surroundings, or there are more than
        five million modes.

    Examples
    --------
    >>> modes = guided_modes([1.16, 1.15, 1.14, 1.13], [2.0, 3.0, 4.0, 1.0], wavelength_um=0.55)
    >>> len(modes), float(modes.n_eff[0].round(12))
    (21, 1.155764784371)
    """
    layers = SlabLayers.checked(index, thickness_um, wavelength_um, index_below, index_above, polarization)
    if layers.index.max() <= layers.surroundings:
        raise InputError(
            f"index must exceed the surroundings' {layers.surroundings:g} in at least one layer to guide; "
            f"got at most {layers.index[1:-1].max():g}"
        )
    anchors, offsets = zip(*_intervals_of_modes(layers), strict=True)
    anchor, offset = np.concatenate(anchors), np.concatenate(offsets)
    # The small difference to the anchor avoids rounding in the square root of the sum.
    n_eff = anchor + offset / (anchor + np.sqrt(anchor**2 + offset))
    return GuidedModes(layers=layers, n_eff=n_eff, anchor=anchor, offset=offset)


def _intervals_of_modes(layers: SlabLayers) -> Iterator[tuple[Floats, Floats]]:
    """Anchors and offsets of the modes, descending; each half between two indices has the nearer index as anchor."""
    levels = np.unique(layers.index[layers.index >= layers.surroundings])[::-1].tolist()
    if (count := layers.modes_above(levels[-1], 0.0)) > MOST_MODES:
        raise InputError(
            f"the stack must guide at most {MOST_MODES:,} modes, which fill {24 * MOST_MODES / 1e6:.0f} MB; "
            f"got {count:,} (choose thinner layers or a longer wavelength)"
        )
    first = 0
    for upper, lower in pairwise(levels):
        half = (upper - lower) * (upper + lower) / 2
        for anchor, low, high in ((upper, -half, 0.0), (lower, 0.0, half)):
            last = max(first, layers.modes_above(anchor, low))
            result = np.empty(last - first)
            mode_roots(*layers.at(anchor), low, high, layers.core, first, result)
            yield np.full_like(result, anchor), result
            first = last
