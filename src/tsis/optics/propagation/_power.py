"""Balance of the launched power, exact on the discrete grid.

The power between two nodes with the real matrix element ``a`` is ``-a Im(u* v)``. Its sum over any border without
sources inside is exactly zero. Light at the end of the grid continues in a flat guide as a sum of the section's modes,
so the power that leaves up to infinity is a geometric series.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.optics.propagation._grid import links

if TYPE_CHECKING:
    from tsis.optics._inputs import Complexes, Floats
    from tsis.optics.propagation._grid import Axis
    from tsis.optics.propagation._section_modes import SectionModes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Powers:
    """Fractions of the power of each launched mode, shape (launched,) each.

    Attributes
    ----------
    guided, reflected
        In forward and backward guided modes.
    top, bottom
        Out of the pressed side and out of the far side, on the grid or beyond its ends.
    """

    guided: Floats
    reflected: Floats
    top: Floats
    bottom: Floats

    @property
    def balance_error(self) -> Floats:
        """Deviation of the sum of the fractions from 1, shape (launched,)."""
        return np.asarray(np.abs(self.guided + self.reflected + self.top + self.bottom - 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Count:
    """Power through a border between the absorbers of x, on a grid with these modes at its ends."""

    transverse: Axis
    step_um: float
    modes: SectionModes
    outside_squared: float

    def launched(self, count: int) -> Floats:
        """Power of each of the first ``count`` modes at amplitude 1, shape (count,)."""
        return self.modes.flow(np.eye(len(self.modes.separation), count, dtype=complex), self.step_um, self._rows)

    def guided(self, amplitudes: Complexes) -> Floats:
        """Power of the guided modes among outward waves, shape (columns,)."""
        selected = np.where(np.arange(len(amplitudes)) < self.modes.guided, 1.0, 0.0)
        return self.modes.flow(selected[:, np.newaxis] * amplitudes, self.step_um, self._rows)

    def through_sides(self, field: Complexes) -> tuple[Floats, Floats]:
        """Power out of the top and of the bottom at each node of z of a field (z, x, columns), shape (z, columns)."""
        straight, aslant = self._links
        results = []
        for row, beyond in self._sides:
            layer = straight * field[:, beyond]
            layer[:-1] += aslant * field[1:, beyond]
            layer[1:] += aslant * field[:-1, beyond]
            results.append(-np.imag(field[:, row].conj() * layer))
        return results[0], results[1]

    def beyond_end(self, amplitudes: Complexes) -> tuple[Floats, Floats]:
        """Power out of the top and of the bottom of the infinite flat guide after the last node.

        ``amplitudes`` are those of all outward modes on the last node, shape (modes, columns).
        """
        (straight, aslant), onward = self._links, self.modes.onward(self.step_um)
        step = np.outer(onward.conj(), onward)
        guided = slice(self.modes.guided)
        step[guided, guided] = 0.0  # guided light does not leave
        series = step / (1 - step)
        results = []
        for row, beyond in self._sides:
            there = self.modes.profile[beyond]
            pairs = series * there * (straight + aslant * (onward + 1 / onward)) + there * aslant * onward
            pairs[guided, guided] = 0.0
            here = self.modes.profile[row, :, np.newaxis] * amplitudes
            results.append(-np.imag(np.sum(here.conj() * (pairs @ amplitudes), axis=0)))
        return results[0], results[1]

    @property
    def _rows(self) -> slice:
        return self.transverse.inner

    @property
    def _sides(self) -> tuple[tuple[int, int], tuple[int, int]]:
        first, last = self.transverse.inner.start, self.transverse.inner.stop - 1
        return (first, first - 1), (last, last + 1)

    @property
    def _links(self) -> tuple[float, float]:
        return links(self.transverse.step_um, self.step_um, self.outside_squared)


def outward(modes: SectionModes, step_um: float, here: Complexes, there: Complexes) -> Complexes:
    """Amplitudes on the node ``here`` of the waves that run from it towards the next node ``there``."""
    onward = modes.onward(step_um)[:, np.newaxis]
    return np.asarray((modes.amplitudes(here) - onward * modes.amplitudes(there)) / (1 - onward**2))
