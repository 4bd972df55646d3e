"""All modes of one section of the grid: guided modes, and the discrete radiation modes between the absorbers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.optics.propagation._grid import MASS, STIFFNESS, times, tridiagonal

if TYPE_CHECKING:
    from tsis.optics._inputs import Booleans, Complexes, Floats
    from tsis.optics.propagation._grid import Axis


CLEAR = 8.0  # a mode is clear of cut-off when it has decayed by exp(-8) at the absorber, its power to 1e-7
LOSSLESS = 0.01  # guided modes near cut-off lose less than this fraction of (k0 n)**2 to the absorbers, others more


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SectionModes:
    """Modes of a section, the guided ones first, each kind with the largest ``beta`` first.

    They are modes of the grid, not of the continuous guide: on the grid they pass the flat guide unchanged.
    """

    separation: Complexes  # ``beta**2`` in 1/µm², shape (modes,)
    profile: Complexes  # columns over the nodes of x with ``profile.T @ mass @ profile = 1``, shape (nodes, modes)
    mass: Complexes  # tridiagonal mass matrix across the layers, shape (2, nodes)
    clear: Booleans  # whether a guided mode is clear of cut-off, shape (guided,)

    @property
    def guided(self) -> int:
        """Number of guided modes."""
        return len(self.clear)

    def amplitudes(self, field: Complexes) -> Complexes:
        """Amplitude of every mode in the columns of a field over x, shape (modes, columns)."""
        return np.asarray(self.profile.T @ times(self.mass, field))

    def onward(self, step_um: float) -> Complexes:
        """Phase factor of each mode from node to node along z, shape (modes,)."""
        fraction = self.separation * step_um**2 / 12
        return np.asarray(np.exp(1j * np.arccos((1 - 5 * fraction) / (1 + fraction))))

    def effective_index(self, wavelength_um: float) -> Floats:
        """Effective index of each guided mode, shape (guided,)."""
        return np.sqrt(self.separation[: self.guided].real) * wavelength_um / (2 * np.pi)

    def flow(self, amplitudes: Complexes, step_um: float, rows: slice) -> Floats:
        """Power of forward waves with these amplitudes, shape (modes, columns), between the nodes ``rows``.

        A wave of amplitude 1 has the power ``beta``; shape (columns,).
        """
        link = self.separation * step_um / 12 + 1 / step_um
        there = self.profile @ ((link * self.onward(step_um))[:, np.newaxis] * amplitudes)
        here = self.profile @ amplitudes
        return np.asarray(np.imag(here.conj() * times(self.mass, there))[rows].sum(axis=0))


def section_modes(layer: Axis, wavenumber_squared: Floats, *, faded_um: float) -> SectionModes:
    """Find all modes of a section.

    ``wavenumber_squared`` is ``(k0 n)**2`` of each cell, 1/µm²; the first cell lies in the medium outside. ``faded_um``
    is the distance from the guide to the absorber over which a mode clear of cut-off decays.
    """
    size = layer.stretch * layer.step_um
    mass = tridiagonal(size, MASS)
    operator = tridiagonal(wavenumber_squared * size, MASS) - tridiagonal(1 / size, STIFFNESS)
    separation, profile = np.linalg.eig(np.linalg.solve(_dense(mass), _dense(operator)))
    outside = float(wavenumber_squared[0])
    is_guided = (separation.real > outside) & (np.abs(separation.imag) < LOSSLESS * outside)
    order = np.lexsort((-separation.real, ~is_guided))
    separation, profile = separation[order], profile[:, order]
    norm = np.sqrt(np.sum(profile * times(mass, profile), axis=0))
    decay = np.sqrt(separation[: np.count_nonzero(is_guided)].real - outside)
    return SectionModes(separation=separation, profile=profile / norm, mass=mass, clear=decay * faded_um > CLEAR)


def _dense(matrix: Complexes) -> Complexes:
    diagonal, off = matrix
    return np.asarray(np.diag(diagonal) + np.diag(off[:-1], 1) + np.diag(off[:-1], -1))
