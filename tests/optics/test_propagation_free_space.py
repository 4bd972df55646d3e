"""Waves in a uniform medium: the finite elements and the march against closed forms."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.sparse.linalg import splu
from scipy.special import hankel1

from tsis.optics.propagation import MASS, Axis, axis, helmholtz_matrix, links, march, memory_bytes, solve

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

K = 2 * np.pi  # a wavelength of 1 um


def point_source(step: float) -> tuple[Axis, NDArray[np.complex128], float]:
    """A square of 4 um with a source in its middle: its sides, the field, and the power that it gives."""
    line = axis(-2.0, 2.0, step_um=step, absorber_um=1.5)
    nodes, middle = line.cells + 1, line.cells // 2
    source = np.zeros((nodes, nodes), dtype=complex)
    weights = np.array([MASS[0, 1], 2 * MASS[0, 0], MASS[0, 1]])  # a source is weighed as the elements weigh a field
    source[middle - 1 : middle + 2, middle - 1 : middle + 2] = np.outer(weights, weights)
    matrix = helmholtz_matrix(line, line, np.full((line.cells, line.cells), K**2))
    field = solve(matrix, source.reshape(-1, 1)).reshape(nodes, nodes)
    return line, field, float(np.vdot(source, field).imag)


def test_a_point_source_sends_a_hankel_function_into_all_directions() -> None:
    errors = []
    for step in (0.1, 0.05):
        line, field, _ = point_source(step)
        x = line.nodes_um[line.inner]
        distance = np.hypot(x, x[:, np.newaxis])
        far = distance > 0.5
        exact = 0.25j * hankel1(0, K * distance[far])
        errors.append(np.abs(field[line.inner, line.inner][far] - exact).max() / np.abs(exact).max())
    assert errors[1] < 1e-3, "nothing comes back from the absorbers, at any angle"
    assert errors[0] / errors[1] > 2**3.5, "its speed is good to fourth order"


def test_the_flow_through_any_closed_border_is_the_power_of_the_source() -> None:
    line, field, power = point_source(0.1)
    assert power == pytest.approx(0.25, rel=(0.1 * K) ** 2 / 10), "the imaginary part of i H0 / 4 at its source"
    straight, aslant = links(line.step_um, line.step_um, K**2)
    for half in (5, 12, 19):
        edge = line.cells // 2 - half
        near, before, after = (slice(edge + by, edge + by + 2 * half + 1) for by in (0, -1, 1))
        beyond = straight * field[edge - 1, near] + aslant * (field[edge - 1, before] + field[edge - 1, after])
        side = -np.imag(field[edge, near].conj() * beyond).sum()
        shared = -np.imag(field[edge, edge].conj() * aslant * field[edge - 1, edge - 1])  # by two sides
        assert 4 * (side - shared) == pytest.approx(power, rel=1e-9)


def exact_root(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(1 + x)


def pade_root(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 + (x / 2) / (1 + x / 4)


def paraxial_root(x: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1 + x / 2


def tilted_beam(
    x: NDArray[np.float64], z: float, tilt: float, root: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> NDArray[np.complex128]:
    """A Gaussian beam by its plane waves; at z = 0 it is ``exp(-((x + 3) / 2)**2 + i tilt x)``."""
    kx = np.linspace(tilt - 5.0, tilt + 5.0, 2001)
    kx = kx[np.abs(kx) < K]
    kz = K * root(-(kx**2) / K**2)
    spectrum = np.exp(-((kx - tilt) ** 2) + 3j * (kx - tilt) + 1j * z * kz) / np.sqrt(np.pi)
    return np.asarray(np.exp(1j * np.outer(x, kx)) @ spectrum * (kx[1] - kx[0]))


@pytest.mark.parametrize(("angle_deg", "bound"), [(0.0, 0.002), (10.0, 0.005), (20.0, 0.02), (25.0, 0.06)])
def test_a_marched_beam_goes_where_it_is_sent(angle_deg: float, bound: float) -> None:
    """Twelve wavelengths on: as the fraction says, and at 20 degrees still as the wave does, unlike a paraxial one."""
    across = axis(-16.0, 16.0, step_um=0.05, absorber_um=3.0)
    along = axis(0.0, 12.0, step_um=0.05, absorber_um=0.0)
    x, tilt = across.nodes_um, K * np.sin(np.radians(angle_deg))
    start = tilted_beam(x, 0.0, tilt, exact_root)[:, np.newaxis]
    found = march(across, along, np.full((along.cells, across.cells), K**2), start, K)[-1, :, 0]
    seen = np.abs(x) < 14.0
    fraction, exact, paraxial = (
        tilted_beam(x[seen], 12.0, tilt, root) for root in (pade_root, exact_root, paraxial_root)
    )
    size = np.linalg.norm(exact)
    assert np.linalg.norm(found[seen] - fraction) / size < 0.01
    error = np.linalg.norm(found[seen] - exact) / size
    assert error < bound
    assert 10 * error < np.linalg.norm(paraxial - exact) / size or angle_deg < 10.0


@pytest.mark.parametrize("step", [0.08, 0.05])
def test_the_memory_is_estimated_above_the_factors_and_not_far(step: float) -> None:
    across, along = (axis(-1.0, end, step_um=step, absorber_um=1.0) for end in (2.0, 9.0))
    matrix = helmholtz_matrix(across, along, np.full((along.cells, across.cells), K**2))
    factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    held = 20.0 * (factors.L.nnz + factors.U.nnz)  # a complex number and the number of its row
    assert 0.5 < held / memory_bytes(matrix.shape[0], 0) < 1.0
