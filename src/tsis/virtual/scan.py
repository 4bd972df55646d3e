"""A virtual scan: presses of a probe on a grid of places over several lumps.

The presses are sums of the lumps' kernels (`tsis.mechanics.lump_kernel`), the model inside the estimate of a map. They
show how a scan is made and read; they do not judge the estimate.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError
from tsis.inclusion.frames import OUTER_FRACTION
from tsis.inclusion.posterior.rings import ring_means
from tsis.mapping.scan import Scan, ScanPress
from tsis.mechanics import press
from tsis.mechanics.lump_kernel import lump_kernel
from tsis.model.phantom import Phantom
from tsis.model.require import require_integer, require_number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.model.probe import Probe


RINGS, SECTORS = 12, 24
NOISE_KPA = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualLump:
    """A sphere in the tissue: place and depth of its TOP, diameter in mm, Young's modulus in kPa."""

    x_mm: float
    y_mm: float
    depth_mm: float
    diameter_mm: float
    young_kpa: float

    def __post_init__(self) -> None:
        require_number("x_mm", self.x_mm, -1000.0, 1000.0, hint="millimetres")
        require_number("y_mm", self.y_mm, -1000.0, 1000.0, hint="millimetres")
        require_number("depth_mm", self.depth_mm, 0.5, 100.0, hint="millimetres")
        require_number("diameter_mm", self.diameter_mm, 0.5, 50.0, hint="millimetres")
        require_number("young_kpa", self.young_kpa, 0.1, 1e6, hint="kilopascals")


THREE_LUMPS = tuple(
    VirtualLump(x_mm=x, y_mm=y, depth_mm=depth, diameter_mm=diameter, young_kpa=young)
    for x, y, depth, diameter, young in (
        (-9.0, -6.0, 5.0, 9.0, 60.0),
        (10.0, -4.0, 7.0, 8.0, 40.0),
        (1.0, 11.0, 4.0, 8.0, 80.0),
    )
)  # what a virtual scan presses where nothing else is asked


def grid_places(count: int, spacing_mm: float) -> NDArray[np.float64]:
    """Places of ``count`` times ``count`` presses around the origin, shape (count**2, 2), mm, row by row."""
    require_integer("count", count, 2, 30)
    require_number("spacing_mm", spacing_mm, 1.0, 100.0, hint="millimetres")
    axis = spacing_mm * (np.arange(count) - (count - 1) / 2)
    return np.array([(x, y) for y in axis for x in axis])


def virtual_scan(
    probe: Probe,
    lumps: Sequence[VirtualLump],
    places_mm: NDArray[np.float64],
    *,
    rng: np.random.Generator,
    force_n: float = 1.0,
    tissue: Phantom | None = None,
    place_sd_mm: float = 0.0,
    force_sd: float = 0.01,
) -> Scan:
    """Press a probe at each place.

    Parameters
    ----------
    probe
        The probe.
    lumps
        The lumps, each whole in the tissue.
    places_mm
        Stated places, shape (n, 2); the presses lie beside them by ``place_sd_mm``.
    rng
        Source of the errors of places, forces and pressures.
    force_n
        Stated force; the presses have it within ``force_sd``.
    tissue
        The tissue; 5 kPa and 30 mm by default.
    place_sd_mm, force_sd
        Standard deviation of each place in mm, and of each force as a fraction.

    Returns
    -------
    Scan
        Means of the pressure over rings and sectors, with noise of 0.005 kPa.

    Raises
    ------
    InputError
        When a value lies outside its range, or a lump does not fit into the tissue.
    """
    slab = tissue or Phantom(young_kpa=5.0, poisson=0.49, thickness_mm=30.0)
    for lump in lumps:
        if lump.depth_mm + lump.diameter_mm >= slab.thickness_mm:
            raise InputError(
                f"depth_mm + diameter_mm of a lump must be less than thickness_mm = {slab.thickness_mm:g}; got "
                f"{lump.depth_mm + lump.diameter_mm:g}"
            )
    require_number("place_sd_mm", place_sd_mm, 0.0, 10.0, hint="millimetres")
    require_number("force_sd", force_sd, 0.0, 0.2, hint="a fraction")
    kernel = lump_kernel(probe, young_kpa=slab.young_kpa, thickness_mm=slab.thickness_mm, poisson=slab.poisson)
    edges = np.linspace(0.0, OUTER_FRACTION * probe.radius_mm, RINGS + 1)
    bare = press(probe, slab, force_n=force_n)
    even = ring_means(bare.radius_mm, edges) @ bare.pressure_kpa
    to_rings = ring_means(kernel.radius_mm, edges)
    angle = (np.arange(SECTORS) + 0.5) * (2 * np.pi / SECTORS)
    presses = []
    for number, stated in enumerate(places_mm, start=1):
        place, gain = rng.normal(stated, place_sd_mm), 1.0 + force_sd * rng.normal()
        pressure = np.repeat(even[:, None], SECTORS, axis=1)
        for lump in lumps:
            away = np.array([lump.x_mm, lump.y_mm]) - place
            harmonics = kernel.response(
                distance_mm=float(np.hypot(*away)),
                centre_mm=lump.depth_mm + lump.diameter_mm / 2,
                diameter_mm=lump.diameter_mm,
                contrast=lump.young_kpa / slab.young_kpa,
                force_n=force_n,
            )
            turn = angle - np.arctan2(away[1], away[0])
            orders = np.arange(len(harmonics))
            mean = np.sinc(orders / SECTORS)[:, None] * np.cos(orders[:, None] * turn)  # over a sector's width
            pressure += (harmonics @ to_rings.T).T @ mean
        presses.append(
            ScanPress(
                place_mm=(float(stated[0]), float(stated[1])),
                place_sd_mm=place_sd_mm,
                force_n=force_n,
                force_sd=force_sd,
                pressure_kpa=gain * pressure + NOISE_KPA * rng.normal(size=pressure.shape),
                noise_kpa=NOISE_KPA,
                name=f"press {number}",
            )
        )
    return Scan(presses=tuple(presses), name="virtual scan")
