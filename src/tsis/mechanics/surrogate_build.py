"""Solving the presses that a surrogate is made of, once for each probe and box.

The changes by an inclusion come from solves with and without contrast on one mesh. What was solved is kept on disk.
"""

from __future__ import annotations

import io
import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from tsis.mechanics import chebyshev, disk_cache
from tsis.mechanics.bodies import Resolution, face_of
from tsis.mechanics.small_strain import EDGE_SHARE, MN_PER_N, PressKernel, UnitPress, block_radius_mm
from tsis.mechanics.surrogate import Box, Degrees, PressSurrogate, Surrogate, log_range, scale
from tsis.model.errors import MechanicsError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model import Probe

FORMAT_VERSION = 3
CHECKS = 8  # fresh presses that the surrogate's error is measured on
CHECKED_SHARE = 0.8  # of the face's radius, as far as profiles are used


def build_surrogate(
    probe: Probe,
    box: Box | None = None,
    *,
    degrees: Degrees | None = None,
    resolution: Resolution | None = None,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> PressSurrogate:
    """Build the surrogate of a probe, or load it from the disk cache.

    Parameters
    ----------
    probe, box
        What presses, and the ranges of what is pressed.
    degrees, resolution
        Polynomial degrees and mesh density.
    progress
        Called with (slabs solved, slabs in all) as the work goes on.
    cached
        Whether to read and write the disk cache, whose key is the content of all arguments above.

    Raises
    ------
    InputError
        When a range is empty or an inclusion of the box does not fit into the slab.
    MechanicsError
        When the tissue would lift off the probe somewhere in the box.
    """
    box, degrees, resolution = box or Box(), degrees or Degrees(), resolution or Resolution()
    key = disk_cache.content_key(
        {
            "format": FORMAT_VERSION,
            "probe": [probe.radius_mm, [asdict(layer) for layer in probe.layers]],
            "box": asdict(box),
            "degrees": asdict(degrees),
            "resolution": asdict(resolution),
        }
    )
    stored = disk_cache.read("surrogates", key) if cached else None
    if stored is None:
        plain, change = _solve_all(probe, box, degrees, resolution, progress)
        error = _measured_error(probe, resolution, _assemble(probe, box, resolution, plain, change, key, error=0.0))
        if cached:
            buffer = io.BytesIO()
            np.savez(buffer, plain=plain, change=change, error=error)
            disk_cache.write("surrogates", key, buffer.getvalue())
    else:
        with np.load(io.BytesIO(stored), allow_pickle=False) as arrays:
            plain, change, error = arrays["plain"], arrays["change"], float(arrays["error"])
    return _assemble(probe, box, resolution, plain, change, key, error=error)


def _assemble(
    probe: Probe,
    box: Box,
    resolution: Resolution,
    plain: NDArray[np.float64],
    change: NDArray[np.float64],
    key: str,
    *,
    error: float,
) -> PressSurrogate:
    face = face_of(probe.radius_mm, resolution)
    nodes = len(face.radius_mm)
    parts = [slice(0, nodes), slice(nodes, 2 * nodes), slice(2 * nodes, None)]
    pressure, displacement, approach = (
        Surrogate(box=box, plain=plain[..., part], change=change[..., part]) for part in parts
    )
    return PressSurrogate(
        radius_mm=face.radius_mm,
        interpolate=face.interpolation,
        pressure_kpa=pressure,
        face_displacement_mm=displacement,
        approach_mm=approach,
        error=error,
        key=key,
    )


def _solve_all(
    probe: Probe,
    box: Box,
    degrees: Degrees,
    resolution: Resolution,
    progress: Callable[[int, int], None] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    slabs, tissues = _tissue_points(box, degrees.thickness, degrees.tissue)
    factors = chebyshev.points(box.contrast_factor, degrees.contrast)
    spheres = list(
        itertools.product(
            chebyshev.points(box.diameter_mm, degrees.diameter), chebyshev.points(box.depth_mm, degrees.depth)
        )
    )
    total, done = len(slabs) * len(spheres), itertools.count(1)

    def kernel_of(thickness: float) -> PressKernel:
        return _kernel(probe, box, resolution, thickness)

    change = []
    # Two levels of threads would fight for the cores: BLAS stays on one, the slabs share the others.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        for thickness in slabs:
            kernel = kernel_of(thickness)
            tasks = [pool.submit(_changes, kernel, sphere, factors, tissues) for sphere in spheres]
            rows = []
            for task in tasks:
                rows.append(task.result())
                if progress is not None:
                    progress(next(done), total)
            _refuse_lift_off(kernel, np.array(rows), spheres, factors, tissues)
            change.append(np.array(rows).reshape(degrees.diameter, degrees.depth, *rows[0].shape))
        slabs, tissues = _tissue_points(box, degrees.plain, degrees.plain)
        plain = pool.map(lambda thickness: _plain(kernel_of(thickness), tissues), slabs)
        return np.stack(list(plain), axis=1), np.stack(change, axis=4)


def _kernel(probe: Probe, box: Box, resolution: Resolution, thickness_mm: float) -> PressKernel:
    return PressKernel(
        probe,
        thickness_mm=thickness_mm,
        poisson=box.poisson,
        block_mm=block_radius_mm(probe, box.diameter_mm[1]),
        resolution=resolution,
    )


def _measured_error(probe: Probe, resolution: Resolution, surrogate: PressSurrogate) -> float:
    """Largest error of the pressure over fresh presses in the box, as a share of the mean pressure."""
    box = surrogate.pressure_kpa.box
    ranges = np.array([box.diameter_mm, box.depth_mm, box.young_kpa, box.tissue_young_kpa])
    # Shallow inclusions are the hardest, the smallest and the largest: corners that a few even points would miss.
    corners = [[share, 0.03, 0.5, 0.5] for share in (0.03, 0.3, 0.97)]
    unit = np.vstack([corners, qmc.Halton(4, scramble=False).random(CHECKS - len(corners))])
    slabs = [float(np.quantile(box.thickness_mm, share)) for share in (0.2, 0.7)]
    radius = np.linspace(0.0, CHECKED_SHARE * probe.radius_mm, 49)
    at_radius = surrogate.interpolate(radius)

    def error(kernel: PressKernel, point: NDArray[np.float64]) -> float:
        diameter, depth, young, tissue = point.tolist()
        slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=box.poisson)
        fresh = kernel.plain(tissue) + kernel.signal(slab, young / tissue, tissue)
        there = surrogate.pressure_kpa.at_tissue(tissue, kernel.thickness_mm)
        fast = there(np.array([diameter]), np.array([depth]), np.array([young]))[0]
        exact = MN_PER_N * at_radius @ fresh.pressure
        return float(np.abs(at_radius @ fast - exact).max() / exact.mean())

    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        kernels = itertools.cycle(pool.map(lambda slab: _kernel(probe, box, resolution, slab), slabs))
        return max(pool.map(error, kernels, ranges[:, 0] + unit * np.ptp(ranges, axis=1)))


def _tissue_points(box: Box, thicknesses: int, tissues: int) -> tuple[list[float], list[float]]:
    """Slab thicknesses in mm and tissue moduli in kPa at which presses are solved."""
    return (
        np.exp(chebyshev.points(log_range(box.thickness_mm), thicknesses)).tolist(),
        np.exp(chebyshev.points(log_range(box.tissue_young_kpa), tissues)).tolist(),
    )


def _plain(kernel: PressKernel, tissues: list[float]) -> NDArray[np.float64]:
    """Plain tissue of each modulus, shape (tissues, outputs)."""
    return np.array([_row(kernel.plain(tissue)) for tissue in tissues])


def _changes(
    kernel: PressKernel,
    sphere: tuple[float, float],
    factors: NDArray[np.float64],
    tissues: list[float],
) -> NDArray[np.float64]:
    diameter, depth = sphere
    slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=kernel.poisson)
    plain_stiffness = slab.plain_stiffness()
    plain = [kernel.solve(plain_stiffness, tissue) for tissue in tissues]
    rows = []
    for factor in factors:
        stiffness = slab.stiffness(_contrast(float(factor)))
        with_sphere = [kernel.solve(stiffness, tissue) for tissue in tissues]
        size = scale(diameter, depth, factor)
        rows.append([_row(lump - bare) / size for lump, bare in zip(with_sphere, plain, strict=True)])
    return np.array(rows)


def _contrast(factor: float) -> float:
    """The contrast Ei / Et whose `contrast_factor` is ``factor``."""
    return (1 + 1.5 * factor) / (1 - factor)


def _row(unit: UnitPress) -> NDArray[np.float64]:
    """One press of 1 N as one row: nodal pressures, nodal displacements, approach."""
    return MN_PER_N * np.concatenate([unit.pressure, unit.displacement, [unit.approach]])


def _refuse_lift_off(
    kernel: PressKernel,
    rows: NDArray[np.float64],
    spheres: list[tuple[float, float]],
    factors: NDArray[np.float64],
    tissues: list[float],
) -> None:
    inside = np.flatnonzero(kernel.face.radius_mm < EDGE_SHARE * kernel.probe.radius_mm)
    size = np.array([[scale(*sphere, factor) for factor in factors] for sphere in spheres])
    pressure = _plain(kernel, tissues)[:, inside] + size[:, :, None, None] * rows[..., inside]
    if pressure.min() < 0:
        diameter, depth = spheres[int(np.unravel_index(pressure.argmin(), pressure.shape)[0])]
        raise MechanicsError(
            f"the tissue lifts off the probe for an inclusion of diameter_mm {diameter:.1f} at depth_mm {depth:.1f}, "
            "and this model keeps the contact closed; narrow the ranges of the inclusion"
        )
