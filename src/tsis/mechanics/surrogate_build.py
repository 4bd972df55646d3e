"""The surrogate of a probe's presses at one force, built once for each probe and box and then kept on disk."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.surrogate import Box, Degrees, PressSurrogate
from tsis.mechanics.surrogate_presses import FACE_POINTS, slabs_of
from tsis.mechanics.surrogate_solves import (
    CHECKED_SHARE,
    cached_arrays,
    largest_error,
    mechanical_content,
    profiles,
    solve_all,
)
from tsis.model import Probe
from tsis.model.check import require_number, require_type
from tsis.model.disk_cache import content_key

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.mechanics.bodies import Resolution
    from tsis.mechanics.finite_strain.bodies import FiniteResolution
    from tsis.mechanics.surrogate_solves import SurrogatePoint

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
        plain, change = solve_all(box, slabs, degrees, progress)
        pressure = profiles(box, plain, change, 0)[0]
        inside = slice(0, int(CHECKED_SHARE * (FACE_POINTS - 1)) + 1)

        def error(spot: SurrogatePoint, fresh: NDArray[np.float64]) -> float:
            return float(np.abs(spot.of(pressure) - fresh[:FACE_POINTS])[inside].max() / fresh[inside].mean())

        return {"plain": plain, "change": change, "error": np.array(largest_error(box, slabs, error))}

    found = cached_arrays("surrogates", key, solved) if cached else solved()
    pressure, displacement, approach = profiles(box, found["plain"], found["change"], 0)
    return PressSurrogate(
        radius_mm=np.linspace(0.0, probe.radius_mm, FACE_POINTS),
        force_n=force_n,
        pressure_kpa=pressure,
        face_displacement_mm=displacement,
        approach_mm=approach,
        error=float(found["error"]),
        key=key,
    )
