"""The referee: Helmholtz's equation solved at once on the whole grid, waves in all directions."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse.linalg import splu

from tsis.optics.propagation.elements import helmholtz_matrix

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy import sparse

    from tsis.optics.propagation.grid import Axis
    from tsis.optics.propagation.section_modes import SectionModes

LAUNCH_NODES = 2  # nodes of z between the absorber and the launched wave
BYTES_A_NODE = 140.0  # of the factors, for each doubling of the nodes; beside it 48 for a launched mode


def memory_bytes(nodes: int, columns: int) -> float:
    """Estimate the memory that `solve` takes on so many nodes with so many sources."""
    return nodes * (BYTES_A_NODE * math.log2(nodes) + 48.0 * columns)


def solve(matrix: sparse.csc_array[np.complex128], source: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Solve for all sources, shape (nodes, sources), with one factorisation; the matrix is symmetric."""
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return np.asarray(factors.solve(source))


def solve_launched(
    across: Axis, along: Axis, wavenumber_squared: NDArray[np.float64], modes: SectionModes, count: int
) -> NDArray[np.complex128]:
    """Field of each of the first ``count`` modes, launched at the left end with amplitude 1.

    The launched wave is there right of a line and absent left of it: what the matrix makes of that jump is the source.
    Left of the line remains what the guide throws back.

    Returns
    -------
    NDArray[np.complex128]
        Shape (nodes of z, nodes of x, count), absorbers included.
    """
    matrix = helmholtz_matrix(across, along, wavenumber_squared)
    rows, start = across.cells + 1, along.inner.start + LAUNCH_NODES - 1
    profile, onward = modes.profile[:, :count], modes.onward(along.step_um)[:count]
    before, behind = slice(start * rows, (start + 1) * rows), slice((start + 1) * rows, (start + 2) * rows)
    link = matrix[before, behind]
    source = np.zeros((matrix.shape[0], count), dtype=complex)
    source[before] = link @ (profile * onward)
    source[behind] = -(link.T @ profile)
    return solve(matrix, source).reshape(along.cells + 1, rows, count)
