"""Waves through a pressed guide: input checks, choice of the method, and result."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError
from tsis.model.require import require_integer, require_number, require_one_of, require_type
from tsis.optics import _inputs as inputs
from tsis.optics.propagation._grid import (
    MASS,
    STIFFNESS,
    Axis,
    axis,
    helmholtz_matrix,
    permittivity,
    times,
    tridiagonal,
)
from tsis.optics.propagation._guide import Dent, ThinGuide, interfaces_um
from tsis.optics.propagation._power import Count, Powers, outward
from tsis.optics.propagation._section_modes import SectionModes, section_modes

if TYPE_CHECKING:
    from scipy import sparse

    from tsis.optics._inputs import Booleans, Complexes, Floats
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
