"""Solving the presses that a surrogate is made of, once for each probe and box.

The changes by an inclusion come from solves with and without contrast on one mesh. What was solved is kept on disk.
"""

from __future__ import annotations

import io
import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import qmc
from threadpoolctl import threadpool_limits

from tsis.mechanics import chebyshev
from tsis.mechanics.surrogate import (
    Box,
    Degrees,
    PressSurrogate,
    Surrogate,
    contrast_factor,
    contrast_of,
    log_range,
    scale,
)
from tsis.mechanics.surrogate_presses import FACE_POINTS, slabs_of
from tsis.model import Probe, check, disk_cache

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.mechanics.bodies import Resolution
    from tsis.mechanics.finite_strain.bodies import FiniteResolution
    from tsis.mechanics.surrogate_presses import Slabs

FORMAT_VERSION = 5
CHECKS = 8  # fresh presses that the surrogate's error is measured on
CHECKED_SHARE = 0.8  # of the face's radius, as far as profiles are used
SMALLEST_FACTOR = 1e-3  # contrasts below it change nothing that could be divided by it


def build_surrogate(
    probe: Probe,
    box: Box | None = None,
    *,
    force_n: float = 1.0,
    strain: str = "small",
    degrees: Degrees | None = None,
    resolution: Resolution | FiniteResolution | None = None,
    progress: Callable[[int, int], None] | None = None,
    cached: bool = True,
) -> PressSurrogate:
    """Build the surrogate of a probe, or load it from the disk cache.

    Parameters
    ----------
    probe, box
        What presses, and the ranges of what is pressed.
    force_n
        Force of every press, N, in [1e-3, 50]; at small strain the answers of a flat face are proportional to it.
    strain
        ``"small"``, or ``"finite"``, which takes seconds a press: choose a small box and few `Degrees`.
    degrees, resolution
        Polynomial degrees, and the mesh density of the model.
    progress
        Called with (slabs solved, slabs in all) as the work goes on.
    cached
        Whether to read and write the disk cache, whose key is the content of all arguments above.

    Raises
    ------
    InputError
        When a range is empty or an inclusion of the box does not fit into the slab.
    MechanicsError
        When the force strains plain tissue of the box beyond what the model describes, or a press fails.
    """
    check.kind("probe", probe, Probe)
    force_n = check.number("force_n", force_n, 1e-3, 50.0, hint="newtons")
    box, degrees = box or Box(), degrees or Degrees()
    slabs, resolution = slabs_of(probe, box, force_n, strain, resolution)
    key = disk_cache.content_key(
        {
            "format": FORMAT_VERSION,
            "probe": asdict(replace(probe.unlit(), name="", assumed=())),
            "force_n": force_n,
            "strain": strain,
            "box": asdict(box),
            "degrees": asdict(degrees),
            "resolution": asdict(resolution),
        }
    )
    stored = disk_cache.read("surrogates", key) if cached else None
    presses = Presses(probe=probe, box=box, force_n=force_n, slabs=slabs)
    if stored is None:
        plain, change = _solve_all(presses, degrees, progress)
        error = _measured_error(presses, _assemble(presses, plain, change, key, error=0.0))
        if cached:
            buffer = io.BytesIO()
            np.savez(buffer, plain=plain, change=change, error=error)
            disk_cache.write("surrogates", key, buffer.getvalue())
    else:
        with np.load(io.BytesIO(stored), allow_pickle=False) as arrays:
            plain, change, error = arrays["plain"], arrays["change"], float(arrays["error"])
    return _assemble(presses, plain, change, key, error=error)


@dataclass(frozen=True, slots=True, kw_only=True)
class Presses:
    """Presses of one probe at one force anywhere in a box; ``slabs`` makes those of one thickness."""

    probe: Probe
    box: Box
    force_n: float
    slabs: Callable[[float], Slabs]


def _assemble(
    presses: Presses, plain: NDArray[np.float64], change: NDArray[np.float64], key: str, *, error: float
) -> PressSurrogate:
    parts = [slice(0, FACE_POINTS), slice(FACE_POINTS, 2 * FACE_POINTS), slice(2 * FACE_POINTS, None)]
    pressure, displacement, approach = (
        Surrogate(box=presses.box, plain=plain[..., part], change=change[..., part]) for part in parts
    )
    return PressSurrogate(
        radius_mm=np.linspace(0.0, presses.probe.radius_mm, FACE_POINTS),
        force_n=presses.force_n,
        pressure_kpa=pressure,
        face_displacement_mm=displacement,
        approach_mm=approach,
        error=error,
        key=key,
    )


def _solve_all(
    presses: Presses, degrees: Degrees, progress: Callable[[int, int], None] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    box = presses.box
    slabs, tissues = _tissue_points(box, degrees.thickness, degrees.tissue)
    factors = _apart_from_none(chebyshev.points(box.contrast_factor, degrees.contrast))
    spheres = list(
        itertools.product(
            chebyshev.points(box.diameter_mm, degrees.diameter), chebyshev.points(box.depth_mm, degrees.depth)
        )
    )
    total, done = len(slabs) * len(spheres), itertools.count(1)
    change = []
    # Two levels of threads would fight for the cores: BLAS stays on one, the slabs share the others.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        for thickness in slabs:
            alike = presses.slabs(thickness)
            tasks = [pool.submit(alike.changes, sphere, factors, tissues) for sphere in spheres]
            rows = []
            for task in tasks:
                rows.append(task.result())
                if progress is not None:
                    progress(next(done), total)
            change.append(np.array(rows).reshape(degrees.diameter, degrees.depth, *rows[0].shape))
        slabs, tissues = _tissue_points(box, degrees.plain, degrees.plain)
        plain = pool.map(lambda thickness: presses.slabs(thickness).plain(tissues), slabs)
        return np.stack(list(plain), axis=1), np.stack(change, axis=4)


def _measured_error(presses: Presses, surrogate: PressSurrogate) -> float:
    """Largest error of the pressure over fresh presses in the box, as a share of the mean pressure."""
    box = presses.box
    ranges = np.array([box.diameter_mm, box.depth_mm, box.young_kpa, box.tissue_young_kpa])
    # Shallow inclusions are the hardest, the smallest and the largest: corners that a few even points would miss.
    corners = [[share, 0.03, 0.5, 0.5] for share in (0.03, 0.3, 0.97)]
    unit = np.vstack([corners, qmc.Halton(4, scramble=False).random(CHECKS - len(corners))])
    slabs = [float(np.quantile(box.thickness_mm, share)) for share in (0.2, 0.7)]
    inside = surrogate.radius_mm <= CHECKED_SHARE * presses.probe.radius_mm

    def error(thickness: float, alike: Slabs, point: NDArray[np.float64]) -> float:
        diameter, depth, young, tissue = point.tolist()
        factor = float(_apart_from_none(contrast_factor(young / tissue)))
        change = scale(diameter, depth, factor) * alike.changes((diameter, depth), np.array([factor]), [tissue])[0]
        fresh = (alike.plain([tissue]) + change)[0, :FACE_POINTS][inside]
        there = surrogate.pressure_kpa.at_tissue(tissue, thickness)
        young = float(contrast_of(factor)) * tissue
        fast = there(np.array([diameter]), np.array([depth]), np.array([young]))[0, inside]
        return float(np.abs(fast - fresh).max() / fresh.mean())

    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        kernels = itertools.cycle(list(pool.map(presses.slabs, slabs)))
        points = ranges[:, 0] + unit * np.ptp(ranges, axis=1)
        return max(pool.map(error, itertools.cycle(slabs), kernels, points))


def _apart_from_none(factor: Any) -> NDArray[np.float64]:
    """Contrast factors none of which is too small to divide by what it changes."""
    return np.where(np.abs(factor) < SMALLEST_FACTOR, SMALLEST_FACTOR, factor)


def _tissue_points(box: Box, thicknesses: int, tissues: int) -> tuple[list[float], list[float]]:
    """Slab thicknesses in mm and tissue moduli in kPa at which presses are solved."""
    return (
        np.exp(chebyshev.points(log_range(box.thickness_mm), thicknesses)).tolist(),
        np.exp(chebyshev.points(log_range(box.tissue_young_kpa), tissues)).tolist(),
    )
