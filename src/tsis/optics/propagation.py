"""Waves in a pressed thin guide: beam propagation for sweeps, a frequency-domain solution as reference.

The guide has thin layers and the round dent of a tip. Its grid of cells has nodes, absorbers, permittivities and
matrices. Light enters and leaves as the modes of one section of the grid: guided modes, and the discrete radiation
modes between the absorbers.

The balance of the launched power is exact on the discrete grid. The power between two nodes with the real matrix
element ``a`` is ``-a Im(u* v)``. Its sum over any border without sources inside is exactly zero. Light at the end of
the grid continues in a flat guide as a sum of the section's modes, so the power that leaves up to infinity is a
geometric series.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.model.require import require_integer, require_number, require_one_of, require_type
from tsis.optics import angles as inputs

if TYPE_CHECKING:
    from numpy.typing import ArrayLike
    from scipy import sparse

    from tsis.optics.angles import Booleans, Complexes, Floats


THINNEST_LEFT = 0.05  # remaining fraction of the soft layers under the deepest dent
LARGEST_TIP_UM = 1e4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ThinGuide:
    """Layers a few micrometres thick in a uniform medium, as in the dissertation's section 3.3 (whose "mm" are µm).

    Parameters
    ----------
    index
        Real refractive indices, shape (layers,), the pressed layer first.
    thickness_um
        Thicknesses, µm, shape (layers,).
    rigid_layers
        Number of the last layers that do not yield to a dent; 1 is the glass plate.
    index_outside
        Refractive index of the medium on both sides and in the dent, in [1, 5].

    Raises
    ------
    InputError
        When a value lies outside its range, or no layer yields.
    """

    index: Floats
    thickness_um: Floats
    rigid_layers: int = 1
    index_outside: float = 1.0

    def __post_init__(self) -> None:
        index, thickness = inputs.require_stack(self.index, self.thickness_um)
        object.__setattr__(self, "index", index)
        object.__setattr__(self, "thickness_um", thickness)
        inputs.require_refractive_index("index_outside", self.index_outside)
        rigid = require_integer("rigid_layers", self.rigid_layers, 0, len(index) - 1, hint="for a layer must yield")
        object.__setattr__(self, "rigid_layers", rigid)

    def __eq__(self, other: object) -> bool:
        """Equality by content."""
        return isinstance(other, ThinGuide) and self._content() == other._content()

    def __hash__(self) -> int:
        return hash(self._content())

    def _content(self) -> tuple[bytes | float, ...]:
        return self.index.tobytes(), self.thickness_um.tobytes(), self.rigid_layers, self.index_outside

    @property
    def total_um(self) -> float:
        """Thickness of the whole guide, µm."""
        return float(self.thickness_um.sum())

    @property
    def soft_um(self) -> float:
        """Thickness of the layers that yield, µm."""
        return float(self.thickness_um[: len(self.index) - self.rigid_layers].sum())


THIN_GUIDES = {
    "dissertation": ThinGuide(index=np.array([1.16, 1.15, 1.14, 1.13]), thickness_um=np.array([2.0, 3.0, 4.0, 1.0])),
    "realistic": ThinGuide(index=np.array([1.41, 1.41, 1.41, 1.515]), thickness_um=np.array([2.0, 3.0, 4.0, 1.0])),
}


def thin_guide(name: str) -> ThinGuide:
    """Return a guide in air by its name: ``dissertation`` with the printed indices, ``realistic`` with PDMS on glass.

    Raises
    ------
    UnknownNameError
        When there is no guide of that name.

    Examples
    --------
    >>> thin_guide("dissertation").total_um
    10.0
    """
    return THIN_GUIDES[require_one_of("thin guide", name, THIN_GUIDES)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Dent:
    """The dent of a rigid round tip: a cylinder across the guide, its axis along y.

    Parameters
    ----------
    depth_um
        Depth of the tip's lowest line below the flat face, µm, in [0, 1e4].
    tip_radius_um
        Radius of the tip, µm, in [0.1, 1e4]. The walls above a tip deeper than its radius are vertical.
    """

    depth_um: float = 0.0
    tip_radius_um: float = 10.0

    def __post_init__(self) -> None:
        require_number("depth_um", self.depth_um, 0.0, LARGEST_TIP_UM, hint="micrometres")
        require_number("tip_radius_um", self.tip_radius_um, 0.1, LARGEST_TIP_UM, hint="micrometres")

    @property
    def half_width_um(self) -> float:
        """Half of the dent's width at the face, µm."""
        sunk = min(self.depth_um, self.tip_radius_um)
        return float(np.sqrt(sunk * (2 * self.tip_radius_um - sunk)))

    def at(self, distance_um: ArrayLike) -> Floats:
        """Depth of the pressed face, µm, at signed distances from the dent's middle along the guide, any shape."""
        distance = np.abs(np.asarray(distance_um, dtype=float))
        sagitta = self.tip_radius_um - np.sqrt(np.maximum(self.tip_radius_um**2 - distance**2, 0.0))
        return np.where(distance < self.tip_radius_um, np.maximum(self.depth_um - sagitta, 0.0), 0.0)


def interfaces_um(guide: ThinGuide, dent: Dent, distance_um: ArrayLike) -> Floats:
    """Depths of all interfaces below the flat face, µm, at distances from the dent's middle.

    The rigid layers do not move. The soft layers between them and the tip are compressed in proportion to their
    thickness; their indices do not change, and there is no bulge beside the tip.

    Returns
    -------
    NDArray[np.float64]
        Shape (distances, layers + 1): the pressed face first, the far face last.

    Raises
    ------
    InputError
        When the dent leaves less than 5 % of the soft layers.

    Examples
    --------
    >>> interfaces_um(thin_guide("dissertation"), Dent(depth_um=4.5), [0.0])
    array([[ 4.5,  5.5,  7. ,  9. , 10. ]])
    """
    deepest = (1 - THINNEST_LEFT) * guide.soft_um
    if dent.depth_um > deepest:
        raise InputError(
            f"depth_um must be at most {deepest:g}, because the soft layers are {guide.soft_um:g} um thick;"
            f" got {dent.depth_um:g}"
        )
    flat = np.concatenate(([0.0], np.cumsum(guide.thickness_um)))
    fraction = np.maximum(1 - flat / guide.soft_um, 0.0)  # of the dent's depth, at each interface
    return np.asarray(flat + dent.at(distance_um)[..., np.newaxis] * fraction)


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
            factors = scipy.linalg.lapack.zgttrf(off[:-1], diagonal, off[:-1])[:5]
            explicit = mass + (0.25 + half) * operator
            passed = section
        field[number + 1] = scipy.linalg.lapack.zgttrs(*factors, times(explicit, field[number]))[0]
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
    factors = scipy.sparse.linalg.splu(
        matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
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


Method = Literal["bpm", "fdfd"]
CELLS_A_WAVE = {"bpm": 4.75, "fdfd": 9.5}  # of the shortest wavelength; phase velocities are of fourth order
COARSEST = 4.0
AIR_WAVES = 3.6  # wavelengths of the medium outside on either side, and the same of absorber
DENT_MARGIN_UM = 2.0
LONGEST_UM = 1e4
MOST_SECTION_NODES = 2000  # all modes of a section take time as the cube of its nodes
GIB = 2.0**30
FINE_STEP_UM = 1e-3
LEAST_FRACTION = 1e-6  # smaller fractions are rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Propagation:
    """Fields and powers of guided modes launched from the left, each with unit power.

    Modes are incoherent with each other: means over them are means of powers.

    Attributes
    ----------
    guide, dent, method, wavelength_um
        The arguments of `propagate`.
    x_um
        Depth below the flat pressed face, µm, of the nodes between the absorbers, shape (x,).
    z_um
        Distance of these nodes from the dent's middle along the guide, µm, shape (z,).
    index
        Root of the mean square of the index in the cells between these nodes, shape (z - 1, x - 1).
    n_eff
        Effective indices of the launched modes on this grid, descending, shape (modes,).
    clear
        Whether each mode decays before the absorber; near cut-off the powers are less exact, shape (modes,).
    guided_count
        Number of guided modes of the flat guide.
    field
        Complex field of each launched mode, shape (z, x, modes).
    powers
        Balance of the power of each mode.
    top_per_um, bottom_per_um
        Fraction of the launched power that leaves through the lines x = ``x_um[0]`` and x = ``x_um[-1]``, per µm along
        z, shape (z, modes); the two end nodes lack a neighbour. The powers' ``top`` and ``bottom`` also include light
        that leaves beyond the grid.
    """

    guide: ThinGuide
    dent: Dent
    method: Method
    wavelength_um: float
    x_um: Floats
    z_um: Floats
    index: Floats
    n_eff: Floats
    clear: Booleans
    guided_count: int
    field: Complexes
    powers: Powers
    top_per_um: Floats
    bottom_per_um: Floats

    @property
    def interfaces_um(self) -> Floats:
        """Depths of all interfaces, µm, at ``z_um``, the pressed face first, shape (z, layers + 1)."""
        return interfaces_um(self.guide, self.dent, self.z_um)

    @property
    def intensity(self) -> Floats:
        """Mean over the launched modes of the squared field, 1 for unit power on a µm at the index 1; shape (z, x)."""
        wavenumber = 2 * np.pi / self.wavelength_um * self.n_eff
        return np.asarray(np.abs(self.field) ** 2 @ (wavenumber / len(wavenumber)))


def propagate(
    guide: ThinGuide,
    dent: Dent | None = None,
    *,
    method: Method = "bpm",
    wavelength_um: float = 0.55,
    modes: int = 12,
    length_um: float = 40.0,
    step_um: float | None = None,
    memory_gib: float = 2.0,
) -> Propagation:
    """Propagate the guided modes of a thin guide under a dent, in two dimensions, with the field along the dent (TE).

    Parameters
    ----------
    guide, dent
        The guide, and the dent in the middle of its length; none by default.
    method
        ``bpm`` marches the wave in one direction, a tenth of a second for all modes together; ``fdfd`` solves
        Helmholtz's equation with waves in all directions, in seconds.
    wavelength_um
        Vacuum wavelength, µm, in [0.1, 20].
    modes
        Number of guided modes to launch, the lowest first, at least 1.
    length_um
        Length of guide on the grid, µm; the dent must fit with 2 µm at either end.
    step_um
        Size of a cell, µm; by default 9.5 cells a wavelength in the highest index for ``fdfd`` and half of that for
        ``bpm``; at least 4 cells.
    memory_gib
        Limit of the memory, GiB, in [0.01, 4096].

    Raises
    ------
    InputError
        When a value lies outside its range, the guide has fewer guided modes, the dent is deeper than the soft layers,
        or the grid exceeds the memory.

    Examples
    --------
    >>> from tsis.optics.propagation import Dent, thin_guide
    >>> flat, pressed = (propagate(thin_guide("dissertation"), Dent(depth_um=d), modes=3) for d in (0.0, 4.0))
    >>> bool(flat.powers.guided.mean() > 0.999999), bool(pressed.powers.guided.mean() < 0.99)
    (True, True)
    """
    require_type("guide", guide, ThinGuide)
    dent = Dent() if dent is None else dent
    require_type("dent", dent, Dent)
    require_one_of("method", method, CELLS_A_WAVE)
    wavelength_um = inputs.require_wavelength(wavelength_um)
    modes = require_integer("modes", modes, 1, MOST_SECTION_NODES)
    require_number(
        "length_um", length_um, 2 * (dent.half_width_um + DENT_MARGIN_UM), LONGEST_UM, hint="the dent must fit"
    )
    layer, along = _axes(guide, method, wavelength_um, length_um, step_um)
    _refuse_large_grid(layer, along, method, modes, memory_gib)
    with one_blas_thread():
        flat = _modes_of_flat(guide, layer, wavelength_um)
        _refuse_missing_modes(guide, flat, modes)
        squared = (2 * np.pi / wavelength_um) ** 2 * permittivity(guide, dent, layer.nodes_um, along.nodes_um)
        if method == "bpm":
            reference = float(np.sqrt(flat.separation[:modes].real.mean()))
            field = march(layer, along, squared, flat.profile[:, :modes], reference)
        else:
            field = solve_launched(layer, along, squared, flat, modes)
        powers, top, bottom = _balance(layer, along, flat, field, float(squared[0, 0]))
    hidden = LAUNCH_NODES if method == "fdfd" else 0  # nodes with reflected light only
    shown_x, shown_z = layer.inner, slice(along.inner.start + hidden, along.inner.stop)
    return Propagation(
        guide=guide,
        dent=dent,
        method=method,
        wavelength_um=wavelength_um,
        x_um=layer.nodes_um[shown_x],
        z_um=along.nodes_um[shown_z],
        index=np.sqrt(squared[shown_z.start : shown_z.stop - 1, shown_x.start : shown_x.stop - 1])
        * wavelength_um
        / (2 * np.pi),
        n_eff=flat.effective_index(wavelength_um)[:modes],
        clear=flat.clear[:modes],
        guided_count=flat.guided,
        field=field[shown_z, shown_x],
        powers=powers,
        top_per_um=top[hidden:],
        bottom_per_um=bottom[hidden:],
    )


def _axes(
    guide: ThinGuide, method: Method, wavelength_um: float, length_um: float, step_um: float | None
) -> tuple[Axis, Axis]:
    shortest = wavelength_um / max(float(guide.index.max()), guide.index_outside)
    step = shortest / CELLS_A_WAVE[method]
    if step_um is not None:
        step = require_number("step_um", step_um, 1e-4, shortest / COARSEST, hint="micrometres, 4 cells a wavelength")
    air = AIR_WAVES * wavelength_um / guide.index_outside
    ends = air if method == "fdfd" else 0.0
    return (
        axis(-air, guide.total_um + air, step_um=step, absorber_um=air),
        axis(-length_um / 2, length_um / 2, step_um=step, absorber_um=ends),
    )


def _refuse_large_grid(layer: Axis, along: Axis, method: Method, modes: int, memory_gib: float) -> None:
    limit = require_number("memory_gib", memory_gib, 0.01, 4096.0)
    rows = layer.cells + 1
    if rows > MOST_SECTION_NODES:
        raise InputError(
            f"a section across the guide must have at most {MOST_SECTION_NODES} nodes; got {rows}:"
            " choose a thinner guide or a larger step_um"
        )
    nodes = rows * (along.cells + 1)
    needed = (memory_bytes(nodes, modes) if method == "fdfd" else nodes * (32.0 * modes + 64.0)) / GIB
    if needed > limit:
        raise InputError(
            f"the grid of {rows} x {along.cells + 1} nodes must fit in {limit:g} GiB; it needs about {needed:.2g}:"
            " choose a larger step_um or memory_gib, or a smaller length_um"
        )


@lru_cache(maxsize=1)  # one entry may fill 64 MB
def _modes_of_flat(guide: ThinGuide, layer: Axis, wavelength_um: float) -> SectionModes:
    """Modes of the flat guide, cached for sweeps over dents."""
    any_length = np.array([0.0, 1.0])
    squared = (2 * np.pi / wavelength_um) ** 2 * permittivity(guide, Dent(), layer.nodes_um, any_length)
    air = -layer.low_um - layer.absorber_cells * layer.step_um
    return section_modes(layer, squared[0], faded_um=air)


def _refuse_missing_modes(guide: ThinGuide, flat: SectionModes, modes: int) -> None:
    if flat.guided == 0:
        raise InputError(
            f"the guide must have a guided mode; with {guide.index_outside:g} outside, an index above it and enough"
            f" thickness would guide; got at most {guide.index.max():g}"
        )
    if modes > flat.guided:
        raise InputError(f"modes must lie in [1, {flat.guided}], the number of guided modes; got {modes}")


def _balance(
    layer: Axis, along: Axis, flat: SectionModes, field: Complexes, outside_squared: float
) -> tuple[Powers, Floats, Floats]:
    """The powers, and the fraction that leaves through either side per µm."""
    count = field.shape[-1]
    first, last = along.inner.start, along.inner.stop - 1
    both_ways = along.absorber_cells > 0
    # A marched wave has the phase velocity of the continuous z, so its powers need a very fine step.
    step = along.step_um if both_ways else FINE_STEP_UM
    ends = Count(transverse=layer, step_um=step, modes=flat, outside_squared=outside_squared)
    launched = ends.launched(count)
    if both_ways:
        ahead = outward(flat, step, field[last], field[last + 1])
        back = outward(flat, step, field[first], field[first - 1])
    else:
        ahead = flat.amplitudes(field[last])
        back = np.zeros_like(ahead)
    top, bottom = (side / launched for side in replace(ends, step_um=along.step_um).through_sides(field[along.inner]))
    later = [sum(sides) / launched for sides in zip(ends.beyond_end(ahead), ends.beyond_end(back), strict=True)]
    sides = [here.sum(axis=0) + after for here, after in zip((top, bottom), later, strict=True)]
    if not both_ways:
        scale = _march_correction(ahead[: flat.guided], sides[0] + sides[1])
        top, bottom, *sides = (scale * item for item in (top, bottom, *sides))
    powers = Powers(
        guided=ends.guided(ahead) / launched,
        reflected=ends.guided(back) / launched,
        top=sides[0],
        bottom=sides[1],
    )
    return powers, top / along.step_um, bottom / along.step_um


def _march_correction(guided: Complexes, leaving: Floats) -> Floats:
    """Factor on the flow out of the sides that compensates the march's loss of power, shape (columns,).

    The march preserves the sum of the squared field, not the power, so light at steep angles has too little power. The
    unguided part of that sum has left the guide; the flow only decides through which side.
    """
    unguided = 1 - np.sum(np.abs(guided) ** 2, axis=0)
    return np.where(leaving > LEAST_FRACTION, unguided / np.maximum(leaving, LEAST_FRACTION), 1.0)
