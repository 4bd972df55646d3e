"""The grid of cells on which waves are computed: where its lines are, what it absorbs, what its cells hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.optics.propagation.pressed_guide import interfaces_um

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.optics.propagation.pressed_guide import Dent, ThinGuide

SAMPLES = 4  # places along a cell at which the interfaces are taken
STRENGTH = 4.0  # of the absorber at its end; half of it sends back less along z, and absorbs grazing light less


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """Equal cells along one direction with an absorber at both ends.

    The absorber is a perfectly matched layer: lengths in it are stretched by ``1 + i s``, with ``s`` growing as the
    fourth power of the way into it, so waves fade there and hardly anything is thrown back.

    Attributes
    ----------
    low_um
        Where the first cell begins, µm.
    step_um
        Size of a cell, µm.
    cells
        Number of cells, those of the absorbers included.
    absorber_cells
        How many cells at each end absorb.
    """

    low_um: float
    step_um: float
    cells: int
    absorber_cells: int

    @property
    def nodes_um(self) -> NDArray[np.float64]:
        """Ends of the cells, µm, shape (cells + 1,)."""
        return np.asarray(self.low_um + self.step_um * np.arange(self.cells + 1), dtype=float)

    @property
    def inner(self) -> slice:
        """The nodes between the absorbers, without those on their borders."""
        border = min(self.absorber_cells, 1)
        return slice(self.absorber_cells + border, self.cells + 1 - self.absorber_cells - border)

    @property
    def stretch(self) -> NDArray[np.complex128]:
        """Complex stretch of each cell, shape (cells,)."""
        middle = np.arange(self.cells) + 0.5
        into = np.maximum(self.absorber_cells - np.minimum(middle, self.cells - middle), 0.0)
        return np.asarray(1 + 1j * STRENGTH * (into / max(self.absorber_cells, 1)) ** 4)


def axis(low_um: float, high_um: float, *, step_um: float, absorber_um: float) -> Axis:
    """Divide ``[low, high]`` into cells of about ``step_um``, and put absorbers outside it."""
    cells = max(round((high_um - low_um) / step_um), 1)
    step = (high_um - low_um) / cells
    beyond = round(absorber_um / step)
    return Axis(low_um=low_um - beyond * step, step_um=step, cells=cells + 2 * beyond, absorber_cells=beyond)


def permittivity(
    guide: ThinGuide, dent: Dent, x_um: NDArray[np.float64], z_um: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Mean square of the index in each cell of the grid with these nodes; the dent's middle is at ``z_um = 0``.

    For a field along y the mean over the cell is what the wave sees, so answers do not jump when an interface passes a
    node. Across the layers the mean is exact, along them it is taken from a few sections of a cell.

    Returns
    -------
    NDArray[np.float64]
        Shape (cells along z, cells along x).
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


def _cell_means(
    at_um: NDArray[np.float64], jumps: NDArray[np.float64], x_um: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Means over the cells of x of steps ``jumps`` at the interfaces, shape (sections, cells)."""
    total = sum(jump * np.maximum(x_um - place[:, np.newaxis], 0.0) for jump, place in zip(jumps, at_um.T, strict=True))
    return np.asarray(np.diff(total, axis=1) / np.diff(x_um))
