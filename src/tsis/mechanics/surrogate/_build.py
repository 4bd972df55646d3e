"""Solving the presses that surrogates are made of, measuring their error on fresh ones, and keeping all that on disk.

The changes by an inclusion come from solves with and without contrast on one mesh.
"""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from tsis.files import content_key, read_cached_arrays, write_cached_arrays
from tsis.mechanics.surrogate import _chebyshev as chebyshev
from tsis.mechanics.surrogate._polynomial import (
    Box,
    Degrees,
    PressSurrogate,
    Surrogate,
    contrast_factor,
    contrast_from_factor,
    log_range,
    signal_scale,
)
from tsis.mechanics.surrogate._presses import FACE_POINTS, slabs_of
from tsis.model import Probe, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.mechanics.finite_strain import FiniteResolution
    from tsis.mechanics.small_strain import Resolution
    from tsis.mechanics.surrogate._presses import Slabs


CHECKS = 8  # fresh presses that a surrogate's error is measured on
CHECKED_FRACTION = 0.8  # of the face's radius, as far as profiles are used
SMALLEST_FACTOR = 1e-3  # contrasts below it change nothing that could be divided by it
PRESS_OUTPUTS = 2 * FACE_POINTS + 1  # of one press: pressures, displacements and the approach


def solve_all(
    box: Box,
    slabs: Callable[[float], Slabs],
    degrees: Degrees,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Solve at all Chebyshev points of a box.

    Parameters
    ----------
    box, degrees
        Where, and how many points.
    slabs
        Makes the slabs of a thickness in mm.
    progress
        Called with (slabs solved, slabs in all).

    Returns
    -------
    ``plain`` and ``change`` of a `Surrogate` whose outputs are the rows of the slabs.
    """
    thicknesses, tissues = _tissue_points(box, degrees.thickness, degrees.tissue)
    factors = _nonzero(chebyshev.points(box.contrast_factor, degrees.contrast))
    spheres = list(
        itertools.product(
            chebyshev.points(box.diameter_mm, degrees.diameter), chebyshev.points(box.depth_mm, degrees.depth)
        )
    )
    total, done = len(thicknesses) * len(spheres), itertools.count(1)
    change = []
    # Two levels of threads would fight for the cores: BLAS stays on one, the slabs share the others.
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        for thickness in thicknesses:
            correlation = slabs(thickness)
            tasks = [pool.submit(correlation.changes, sphere, factors, tissues) for sphere in spheres]
            rows = []
            for task in tasks:
                rows.append(task.result())
                if progress is not None:
                    progress(next(done), total)
            change.append(np.array(rows).reshape(degrees.diameter, degrees.depth, *rows[0].shape))
        thicknesses, tissues = _tissue_points(box, degrees.baseline, degrees.baseline)
        reference = pool.map(lambda thickness: slabs(thickness).without_inclusion(tissues), thicknesses)
        return np.stack(list(reference), axis=1), np.stack(change, axis=4)


def profiles(
    box: Box, reference: NDArray[np.float64], change: NDArray[np.float64], first: int
) -> tuple[Surrogate, Surrogate, Surrogate]:
    """Pressure, displacement and approach of the press whose outputs start at ``first``."""
    ends = np.array([0, FACE_POINTS, 2 * FACE_POINTS, PRESS_OUTPUTS]) + first
    pressure, displacement, approach = (
        Surrogate(box=box, baseline=reference[..., start:end], change=change[..., start:end])
        for start, end in itertools.pairwise(ends.tolist())
    )
    return pressure, displacement, approach


@dataclass(frozen=True, slots=True, kw_only=True)
class SurrogatePoint:
    """One inclusion in one slab, lengths in mm, moduli in kPa."""

    diameter_mm: float
    depth_mm: float
    young_kpa: float
    tissue_young_kpa: float
    thickness_mm: float

    def of(self, surrogate: Surrogate) -> NDArray[np.float64]:
        """Outputs of a surrogate here, shape (outputs,)."""
        there = surrogate.at_tissue(self.tissue_young_kpa, self.thickness_mm)
        every = there(np.array([self.diameter_mm]), np.array([self.depth_mm]), np.array([self.young_kpa]))
        return np.asarray(every[0])


def largest_error(
    box: Box, slabs: Callable[[float], Slabs], error: Callable[[SurrogatePoint, NDArray[np.float64]], float]
) -> float:
    """Largest ``error(spot, row)`` over fresh presses in a box, each told by its row of outputs."""
    ranges = np.array([box.diameter_mm, box.depth_mm, box.young_kpa, box.tissue_young_kpa])
    # Shallow inclusions are the hardest, the smallest and the largest: corners that a few even points would miss.
    corners = [[fraction, 0.03, 0.5, 0.5] for fraction in (0.03, 0.3, 0.97)]
    unit = np.vstack([corners, scipy.stats.qmc.Halton(4, scramble=False).random(CHECKS - len(corners))])
    thicknesses = [float(np.quantile(box.thickness_mm, fraction)) for fraction in (0.2, 0.7)]

    def measured(thickness: float, correlation: Slabs, point: NDArray[np.float64]) -> float:
        diameter, depth, young, tissue = point.tolist()
        factor = float(_nonzero(contrast_factor(young / tissue)))
        change = (
            signal_scale(diameter, depth, factor)
            * correlation.changes((diameter, depth), np.array([factor]), [tissue])[0]
        )
        spot = SurrogatePoint(
            diameter_mm=diameter,
            depth_mm=depth,
            young_kpa=float(contrast_from_factor(factor)) * tissue,
            tissue_young_kpa=tissue,
            thickness_mm=thickness,
        )
        return error(spot, (correlation.without_inclusion([tissue]) + change)[0])

    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(os.cpu_count()) as pool:
        kernels = itertools.cycle(list(pool.map(slabs, thicknesses)))
        points = ranges[:, 0] + unit * np.ptp(ranges, axis=1)
        return max(pool.map(measured, itertools.cycle(thicknesses), kernels, points))


def cached_arrays(
    kind: str, key: str, solved: Callable[[], dict[str, NDArray[np.float64]]]
) -> dict[str, NDArray[np.float64]]:
    """Arrays from the disk cache, or solved now and written there."""
    stored = read_cached_arrays(kind, key)
    if stored is None:
        result = solved()
        write_cached_arrays(kind, key, result)
        return result
    return stored


def mechanical_content(probe: Probe) -> dict[str, Any]:
    """Everything of a probe that its presses depend on, as JSON values."""
    return asdict(replace(probe.unlit(), name="", assumed=()))


def _nonzero(factor: Any) -> NDArray[np.float64]:
    """Contrast factors none of which is too small to divide by what it changes."""
    return np.where(np.abs(factor) < SMALLEST_FACTOR, SMALLEST_FACTOR, factor)


def _tissue_points(box: Box, thicknesses: int, tissues: int) -> tuple[list[float], list[float]]:
    """Slab thicknesses in mm and tissue moduli in kPa at which presses are solved."""
    return (
        np.exp(chebyshev.points(log_range(box.thickness_mm), thicknesses)).tolist(),
        np.exp(chebyshev.points(log_range(box.tissue_young_kpa), tissues)).tolist(),
    )


FORMAT_VERSION = 5


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
    require_type("probe", probe, Probe)
    force_n = require_number("force_n", force_n, 1e-3, 50.0, hint="newtons")
    box, degrees = box or Box(), degrees or Degrees()
    slabs, resolution = slabs_of(probe, box, force_n, strain, resolution)
    key = content_key(
        {
            "format": FORMAT_VERSION,
            "probe": mechanical_content(probe),
            "force_n": force_n,
            "strain": strain,
            "box": asdict(box),
            "degrees": asdict(degrees),
            "resolution": asdict(resolution),
        }
    )

    def solved() -> dict[str, NDArray[np.float64]]:
        reference, change = solve_all(box, slabs, degrees, progress)
        pressure = profiles(box, reference, change, 0)[0]
        inside = slice(0, int(CHECKED_FRACTION * (FACE_POINTS - 1)) + 1)

        def error(spot: SurrogatePoint, fresh: NDArray[np.float64]) -> float:
            return float(np.abs(spot.of(pressure) - fresh[:FACE_POINTS])[inside].max() / fresh[inside].mean())

        return {"plain": reference, "change": change, "error": np.array(largest_error(box, slabs, error))}

    result = cached_arrays("surrogates", key, solved) if cached else solved()
    pressure, displacement, approach = profiles(box, result["plain"], result["change"], 0)
    return PressSurrogate(
        radius_mm=np.linspace(0.0, probe.radius_mm, FACE_POINTS),
        force_n=force_n,
        pressure_kpa=pressure,
        face_displacement_mm=displacement,
        approach_mm=approach,
        error=float(result["error"]),
        key=key,
    )
