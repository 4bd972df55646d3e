"""The grid of cells for waves: its nodes, absorbers, permittivities and matrices."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.optics.propagation._guide import interfaces_um

if TYPE_CHECKING:
    from tsis.optics._inputs import Complexes, Floats
    from tsis.optics.propagation._guide import Dent, ThinGuide


SAMPLES = 4  # sections along a cell for the mean over the interfaces
STRENGTH = 4.0  # of the absorber at its end; half of it reflects less along z, but absorbs grazing light less


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """Equal cells along one direction with an absorber at both ends.

    The absorber is a perfectly matched layer: lengths in it are stretched by ``1 + i s``, with ``s`` growing as the
    fourth power of the depth, so waves decay there with little reflection.
    """

    low_um: float  # start of the first cell, µm
    step_um: float  # size of a cell, µm
    cells: int  # number of cells, absorbers included
    absorber_cells: int  # number of absorbing cells at each end

    @property
    def nodes_um(self) -> Floats:
        """Ends of the cells, µm, shape (cells + 1,)."""
        return np.asarray(self.low_um + self.step_um * np.arange(self.cells + 1), dtype=float)

    @property
    def inner(self) -> slice:
        """The nodes between the absorbers, without border nodes."""
        border = min(self.absorber_cells, 1)
        return slice(self.absorber_cells + border, self.cells + 1 - self.absorber_cells - border)

    @property
    def stretch(self) -> Complexes:
        """Complex stretch of each cell, shape (cells,)."""
        middle = np.arange(self.cells) + 0.5
        into = np.maximum(self.absorber_cells - np.minimum(middle, self.cells - middle), 0.0)
        return np.asarray(1 + 1j * STRENGTH * (into / max(self.absorber_cells, 1)) ** 4)


def axis(low_um: float, high_um: float, *, step_um: float, absorber_um: float) -> Axis:
    """Divide ``[low, high]`` into cells of about ``step_um``, and add absorbers outside it."""
    cells = max(round((high_um - low_um) / step_um), 1)
    step = (high_um - low_um) / cells
    beyond = round(absorber_um / step)
    return Axis(low_um=low_um - beyond * step, step_um=step, cells=cells + 2 * beyond, absorber_cells=beyond)


def permittivity(guide: ThinGuide, dent: Dent, x_um: Floats, z_um: Floats) -> Floats:
    """Mean square of the index in each cell, shape (cells along z, cells along x), around a dent at ``z_um = 0``.

    For a field along y the mean over the cell is effective, so results do not jump when an interface passes a node. The
    mean is exact across the layers, and over a few sections of a cell along them.
    """
    outside = guide.index_outside**2
    jumps = np.diff(np.concatenate(([outside], guide.index**2, [outside])))
    step = np.diff(z_um)
    touched = np.flatnonzero((z_um[1:] > -dent.half_width_um) & (z_um[:-1] < dent.half_width_um))
    sections = z_um[touched, np.newaxis] + step[touched, np.newaxis] * (np.arange(SAMPLES) + 0.5) / SAMPLES
    flat = _cell_means(interfaces_um(guide, dent, [np.inf]), jumps, x_um)
    result = np.tile(outside + flat, (len(step), 1))
    if len(touched):
        means = _cell_means(interfaces_um(guide, dent, sections.ravel()), jumps, x_um)
        result[touched] = outside + means.reshape(len(touched), SAMPLES, -1).mean(axis=1)
    return result


def _cell_means(at_um: Floats, jumps: Floats, x_um: Floats) -> Floats:
    """Means of ``jumps`` at the interfaces over the cells of x, shape (sections, cells)."""
    total = sum(
        jump * np.maximum(x_um - position[:, np.newaxis], 0.0) for jump, position in zip(jumps, at_um.T, strict=True)
    )
    return np.asarray(np.diff(total, axis=1) / np.diff(x_um))


STIFFNESS = np.array([[1.0, -1.0], [-1.0, 1.0]])
MASS = np.array([[5.0, 1.0], [1.0, 5.0]]) / 12
ENDS = (0, 1)  # of a cell


def tridiagonal(of_cells: Complexes, element: Floats) -> Complexes:
    """Assemble ``element`` times a value of each cell along one axis: a symmetric tridiagonal matrix.

    Its two rows, shape (2, cells + 1), are the diagonal and the off-diagonal, which ends with a zero.
    """
    none = np.zeros_like(of_cells[:1])
    along = np.concatenate((of_cells, none))
    return np.array([element[0, 0] * (along + np.concatenate((none, of_cells))), element[0, 1] * along])


def times(matrix: Complexes, vectors: Complexes) -> Complexes:
    """Multiply a `tridiagonal` matrix with columns, shape (cells + 1, columns)."""
    diagonal, off = matrix[..., np.newaxis]
    result = np.asarray(diagonal * vectors)
    result[:-1] += off[:-1] * vectors[1:]
    result[1:] += off[:-1] * vectors[:-1]
    return result


def links(step_x_um: float, step_z_um: float, wavenumber_squared: float) -> tuple[float, float]:
    """Elements of `helmholtz_matrix` from a node to its neighbour across the layers, straight and diagonal.

    They are valid in a uniform medium; each node has two diagonal neighbours on that side.
    """
    ratio, area = step_z_um / step_x_um, wavenumber_squared * step_x_um * step_z_um
    next_stiff, same_mass, next_mass = STIFFNESS[0, 1], MASS[0, 0], MASS[0, 1]
    straight = next_stiff * same_mass * ratio + next_mass * STIFFNESS[0, 0] / ratio - next_mass * same_mass * area
    aslant = next_stiff * next_mass * ratio + next_mass * next_stiff / ratio - next_mass**2 * area
    return 2 * straight, aslant


def helmholtz_matrix(layer: Axis, along: Axis, wavenumber_squared: Floats) -> scipy.sparse.csc_array[np.complex128]:
    """Matrix of ``-laplace - k**2`` on the whole grid, absorbers included.

    ``wavenumber_squared`` is ``(k0 n)**2`` in each cell, 1/µm², shape (cells along z, cells along x). The node of x
    index i and z index j has the number ``j * len(x) + i``.
    """
    columns = layer.cells + 1
    corner = columns * np.arange(along.cells)[:, np.newaxis] + np.arange(layer.cells)
    size_x, size_z = layer.stretch * layer.step_um, along.stretch * along.step_um
    slope_x, slope_z = np.outer(size_z, 1 / size_x), np.outer(1 / size_z, size_x)
    mass = wavenumber_squared * np.outer(size_z, size_x)
    rows, positions, values = [], [], []
    for a, b, c, d in product(ENDS, repeat=4):  # from the corner (a, c) of a cell to (b, d)
        rows.append(corner + columns * c + a)
        positions.append(corner + columns * d + b)
        values.append(
            STIFFNESS[a, b] * MASS[c, d] * slope_x
            + MASS[a, b] * STIFFNESS[c, d] * slope_z
            - MASS[a, b] * MASS[c, d] * mass
        )
    nodes = columns * (along.cells + 1)
    entries = np.ravel(values), (np.ravel(rows), np.ravel(positions))
    return scipy.sparse.csc_array(entries, shape=(nodes, nodes))
