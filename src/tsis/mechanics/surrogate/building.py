"""Solve the presses of a surrogate, and measure its error on fresh ones.

The changes by an inclusion come from solves with and without contrast on one mesh.
"""

from __future__ import annotations

import itertools
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.files.cache import cached_arrays, content_key
from tsis.mechanics.mesh import mechanical_content
from tsis.mechanics.surrogate.polynomial import (
    Box,
    Degrees,
    PressSurrogate,
    Surrogate,
    chebyshev_points,
    contrast_factor,
    contrast_from_factor,
    log_range,
    signal_scale,
)
from tsis.mechanics.surrogate.states import FACE_POINTS, OUTPUTS, PRESS_OUTPUTS, slabs_of
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.finite_strain.patches import FiniteResolution
    from tsis.mechanics.mesh import Floats
    from tsis.mechanics.small_strain.slab import Resolution
    from tsis.mechanics.surrogate.states import Slabs


CHECKS = 8  # fresh presses to measure a surrogate's error
CHECKED_FRACTION = 0.8  # of the face's radius; the part of the profiles in use
SMALLEST_FACTOR = 1e-3  # smallest contrast factor that the change is divided by
FORMAT_VERSION = 5


def solve_all(
    box: Box, slabs: Callable[[float], Slabs], degrees: Degrees, progress: Callable[[int, int], None] | None = None
) -> tuple[Floats, Floats]:
    """Solve at all Chebyshev points of a box: ``baseline`` and ``change`` of a `Surrogate` of the slabs' rows.

    ``slabs`` gives the slabs of a thickness in mm. ``progress`` is called with (slabs solved, slabs in all).
    """
    thicknesses, tissues = _tissue_points(box, degrees.thickness, degrees.tissue)
    factors = _nonzero(chebyshev_points(box.contrast_factor, degrees.contrast))
    spheres = list(
        itertools.product(
            chebyshev_points(box.diameter_mm, degrees.diameter), chebyshev_points(box.depth_mm, degrees.depth)
        )
    )
    total, done = len(thicknesses) * len(spheres), itertools.count(1)
    change = []
    # Only one level of threads: the slabs run in parallel, BLAS does not.
    with one_blas_thread(), ThreadPoolExecutor(os.cpu_count()) as pool:
        for thickness in thicknesses:
            at_thickness = slabs(thickness)
            tasks = [pool.submit(at_thickness.changes, sphere, factors, tissues) for sphere in spheres]
            rows = []
            for task in tasks:
                rows.append(task.result())
                if progress is not None:
                    progress(next(done), total)
            change.append(np.array(rows).reshape(degrees.diameter, degrees.depth, *rows[0].shape))
        thicknesses, tissues = _tissue_points(box, degrees.baseline, degrees.baseline)
        reference = pool.map(lambda thickness: slabs(thickness).without_inclusion(tissues), thicknesses)
        return np.stack(list(reference), axis=1), np.stack(change, axis=4)


def profiles(box: Box, reference: Floats, change: Floats, first: int) -> tuple[Surrogate, Surrogate, Surrogate]:
    """Pressure, displacement and approach of the press whose outputs start at ``first``."""
    ends = np.array([0, FACE_POINTS, OUTPUTS, PRESS_OUTPUTS]) + first
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

    def evaluate(self, surrogate: Surrogate) -> Floats:
        """Outputs of a surrogate at this point, shape (outputs,)."""
        at_tissue = surrogate.at_tissue(self.tissue_young_kpa, self.thickness_mm)
        rows = at_tissue(np.array([self.diameter_mm]), np.array([self.depth_mm]), np.array([self.young_kpa]))
        return np.asarray(rows[0])


def largest_error(box: Box, slabs: Callable[[float], Slabs], error: Callable[[SurrogatePoint, Floats], float]) -> float:
    """Largest ``error(point, row)`` over fresh presses in a box; ``row`` has the outputs."""
    ranges = np.array([box.diameter_mm, box.depth_mm, box.young_kpa, box.tissue_young_kpa])
    # Shallow inclusions, the smallest and the largest, are the hardest; a few even points would miss these corners.
    corners = [[fraction, 0.03, 0.5, 0.5] for fraction in (0.03, 0.3, 0.97)]
    unit = np.vstack([corners, scipy.stats.qmc.Halton(4, scramble=False).random(CHECKS - len(corners))])
    thicknesses = [float(np.quantile(box.thickness_mm, fraction)) for fraction in (0.2, 0.7)]

    def measured(thickness: float, at_thickness: Slabs, values: Floats) -> float:
        diameter, depth, young, tissue = values.tolist()
        factor = float(_nonzero(contrast_factor(young / tissue)))
        scaled = at_thickness.changes((diameter, depth), np.array([factor]), [tissue])[0]
        point = SurrogatePoint(
            diameter_mm=diameter,
            depth_mm=depth,
            young_kpa=float(contrast_from_factor(factor)) * tissue,
            tissue_young_kpa=tissue,
            thickness_mm=thickness,
        )
        change = signal_scale(diameter, depth, factor) * scaled
        return error(point, (at_thickness.without_inclusion([tissue]) + change)[0])

    with one_blas_thread(), ThreadPoolExecutor(os.cpu_count()) as pool:
        kernels = itertools.cycle(list(pool.map(slabs, thicknesses)))
        points = ranges[:, 0] + unit * np.ptp(ranges, axis=1)
        return max(pool.map(measured, itertools.cycle(thicknesses), kernels, points))


def surrogate_key(
    version: int,
    probe: Probe,
    box: Box,
    degrees: Degrees,
    resolution: Resolution | FiniteResolution,
    others: dict[str, Any],
) -> str:
    """Hash of the content of a surrogate."""
    values = {"box": asdict(box), "degrees": asdict(degrees), "resolution": asdict(resolution), **others}
    return content_key({"format": version, "probe": mechanical_content(probe), **values})


def _nonzero(factor: Any) -> Floats:
    """Contrast factors without values near 0, which the change is divided by."""
    return np.where(np.abs(factor) < SMALLEST_FACTOR, SMALLEST_FACTOR, factor)


def _tissue_points(box: Box, thicknesses: int, tissues: int) -> tuple[list[float], list[float]]:
    """Chebyshev points of slab thickness in mm and tissue modulus in kPa."""
    return (
        np.exp(chebyshev_points(log_range(box.thickness_mm), thicknesses)).tolist(),
        np.exp(chebyshev_points(log_range(box.tissue_young_kpa), tissues)).tolist(),
    )


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
        The probe, and the ranges of inclusions and tissues.
    force_n
        Force of every press, N, in [1e-3, 50]; at small strain the response of a flat face is proportional to it.
    strain
        ``"small"``, or ``"finite"``, which takes seconds a press: choose a small box and few `Degrees`.
    degrees, resolution
        Polynomial degrees, and the mesh density of the model.
    progress
        Called with (slabs solved, slabs in all).
    cached
        Whether to read and write the disk cache; its key is the content of all arguments above.

    Raises
    ------
    InputError
        When a range is empty or an inclusion of the box does not fit into the slab.
    MechanicsError
        When the strain of tissue without inclusion is too large for the model, or a press fails.
    """
    require_type("probe", probe, Probe)
    force_n = require_number("force_n", force_n, 1e-3, 50.0, hint="newtons")
    box, degrees = box or Box(), degrees or Degrees()
    slabs, resolution = slabs_of(probe, box, force_n, strain, resolution)
    press = {"force_n": force_n, "strain": strain}
    key = surrogate_key(FORMAT_VERSION, probe, box, degrees, resolution, press)

    def solve() -> dict[str, Floats]:
        reference, change = solve_all(box, slabs, degrees, progress)
        pressure = profiles(box, reference, change, 0)[0]
        inside = slice(0, int(CHECKED_FRACTION * (FACE_POINTS - 1)) + 1)

        def error(point: SurrogatePoint, fresh: Floats) -> float:
            return float(np.abs(point.evaluate(pressure) - fresh[:FACE_POINTS])[inside].max() / fresh[inside].mean())

        return {"plain": reference, "change": change, "error": np.array(largest_error(box, slabs, error))}

    result = cached_arrays("surrogates", key, solve) if cached else solve()
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
