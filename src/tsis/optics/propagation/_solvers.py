"""Beam propagation without reflections, and the frequency-domain solution with waves in all directions.

A forward wave obeys ``du/dz = i sqrt(k**2 + d2/dx2) u``. Padé's (1,1) fraction around a reference wave number replaces
the square root and is accurate to wide angles; a step is then one tridiagonal solve for all modes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.lapack import zgttrf, zgttrs
from scipy.sparse.linalg import splu

from tsis.optics.propagation._grid import MASS, STIFFNESS, helmholtz_matrix, times, tridiagonal

if TYPE_CHECKING:
    from scipy import sparse

    from tsis.optics._inputs import Complexes, Floats
    from tsis.optics.propagation._grid import Axis
    from tsis.optics.propagation._section_modes import SectionModes


def march(layer: Axis, along: Axis, wavenumber_squared: Floats, start: Complexes, reference: float) -> Complexes:
    """March the columns of ``start``, fields on the first node of z, through all sections: shape (z, x, columns).

    With ``X = (k**2 + d2/dx2) / reference**2 - 1`` it uses ``sqrt(1 + X) - 1 = (X / 2) / (1 + X / 4)`` and the
    trapezoidal rule, which preserves ``u.T @ mass @ u`` exactly in a flat guide without absorber.
    ``wavenumber_squared`` is ``(k0 n)**2`` in each cell, 1/µm², shape (cells along z, cells along x); ``reference`` is
    a wave number near those of the waves of interest, 1/µm.
    """
    size = layer.stretch * layer.step_um
    mass, stiffness = tridiagonal(size, MASS), tridiagonal(1 / size, STIFFNESS)
    field = np.empty((along.cells + 1, *start.shape), dtype=complex)
    field[0] = start
    half = 0.25j * reference * along.step_um
    factors: tuple[Complexes, ...] = ()
    passed = None
    explicit = mass
    for number, section in enumerate(wavenumber_squared):
        if passed is None or not np.array_equal(section, passed):
            operator = (tridiagonal(section * size, MASS) - stiffness) / reference**2 - mass
            diagonal, off = mass + (0.25 - half) * operator
            factors = zgttrf(off[:-1], diagonal, off[:-1])[:5]
            explicit = mass + (0.25 + half) * operator
            passed = section
        field[number + 1] = zgttrs(*factors, times(explicit, field[number]))[0]
    phase = np.exp(1j * reference * along.step_um * np.arange(along.cells + 1))
    field *= phase[:, np.newaxis, np.newaxis]
    return field


LAUNCH_NODES = 2  # nodes of z between the absorber and the launched wave
BYTES_A_NODE = 140.0  # of the factors, for each doubling of the nodes; 48 more for a launched mode


def memory_bytes(nodes: int, columns: int) -> float:
    """Estimate the memory of `solve` for a number of nodes and sources."""
    return nodes * (BYTES_A_NODE * math.log2(nodes) + 48.0 * columns)


def solve(matrix: sparse.csc_array[np.complex128], source: Complexes) -> Complexes:
    """Solve for all sources, shape (nodes, sources), with one factorisation; the matrix is symmetric."""
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.asarray(factors.solve(source))


def solve_launched(layer: Axis, along: Axis, wavenumber_squared: Floats, modes: SectionModes, count: int) -> Complexes:
    """Field (z, x, count) of each of the first ``count`` modes, launched at the left end with amplitude 1.

    The launched wave exists right of a line and is absent left of it; the source is the matrix times that jump. The
    field left of the line is the reflected light.
    """
    matrix = helmholtz_matrix(layer, along, wavenumber_squared)
    rows, start = layer.cells + 1, along.inner.start + LAUNCH_NODES - 1
    profile, onward = modes.profile[:, :count], modes.onward(along.step_um)[:count]
    before, behind = slice(start * rows, (start + 1) * rows), slice((start + 1) * rows, (start + 2) * rows)
    link = matrix[before, behind]
    source = np.zeros((matrix.shape[0], count), dtype=complex)
    source[before] = link @ (profile * onward)
    source[behind] = -(link.T @ profile)
    return solve(matrix, source).reshape(along.cells + 1, rows, count)
