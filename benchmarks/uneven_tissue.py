"""Tissue that is not the same everywhere: soft lumps beside and below each other, some a little stiffer than the rest.

Lumps are spheres of 4 to 10 mm that do not meet; the logarithm of each one's modulus over the tissue's is normal. Their
centres lie within 6 mm of the probe's axis and their tops 1 to 15 mm deep, so tissue farther out is even, and so is
what lies between them. What each changes is solved on the axis, moved beside it
(`tsis.inclusion.posterior.rings.off_axis_profile`), and added up: right for weak lumps, as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from tsis.files.cache import cached_arrays, content_key
from tsis.inclusion.posterior.rings import FARTHEST, SHIFTED
from tsis.mechanics import press
from tsis.mechanics.mesh import mechanical_content
from tsis.mechanics.surrogate.polynomial import contrast_factor
from tsis.model.phantom import Inclusion, Phantom
from tsis.model.press import PressField, PressMap
from tsis.virtual.probe import FINE_RESOLUTION

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.probe import Probe

TRIES = 14  # places at which a lump is put unless it would meet another
DIAMETER_MM, TOP_MM, OUT_MM = (4.0, 10.0), (1.0, 15.0), 6.0
GAP_MM = 0.5
NOMINAL = Phantom(young_kpa=5.0, thickness_mm=30.0)
WEAK = 0.1  # logarithm of the contrast by which a lump's change is found
DIAMETERS_MM = (4.0, 6.0, 8.0, 10.0)
TOPS_MM = (1.0, 1.5, 2.0, 3.0, 4.0, 5.5, 7.0, 9.0, 12.0, 15.0)
SPACING_MM = 0.25


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A place to press: tissue, the inclusion or none, and weak lumps.

    Attributes
    ----------
    phantom
        Tissue and inclusion, which may lie beside the axis.
    lumps
        Weak lumps of the same tissue.
    """

    phantom: Phantom
    lumps: tuple[Inclusion, ...] = ()

    @property
    def whole(self) -> Phantom:
        """All of it as the three-dimensional model presses it."""
        every = (*self.phantom.inclusions, *self.lumps)
        return replace(self.phantom, inclusion=every[0] if every else None, more_inclusions=every[1:])


def uneven(phantom: Phantom, sd: float, rng: np.random.Generator) -> Site:
    """The phantom with lumps whose log moduli have the standard deviation ``sd``; they keep off its inclusion.

    As many numbers are drawn whatever is kept.
    """
    kept: list[Inclusion] = []
    for _ in range(TRIES):
        diameter, top = rng.uniform(*DIAMETER_MM), rng.uniform(*TOP_MM)
        away, angle = OUT_MM * np.sqrt(rng.random()), 2 * np.pi * rng.random()
        lump = Inclusion(
            diameter_mm=diameter,
            depth_mm=top,
            young_kpa=phantom.young_kpa * float(np.exp(sd * rng.standard_normal())),
            poisson=phantom.poisson,
            offset_mm=(float(away * np.cos(angle)), float(away * np.sin(angle))),
        )
        fits = lump.bottom_mm < 0.97 * phantom.thickness_mm
        if fits and all(_apart(lump, other) for other in (*phantom.inclusions, *kept)):
            kept.append(lump)
    return Site(phantom=phantom, lumps=tuple(kept))


def _apart(one: Inclusion, other: Inclusion) -> bool:
    centres = [np.array([*lump.offset_mm, lump.centre_depth_mm]) for lump in (one, other)]
    reach = (one.diameter_mm + other.diameter_mm) / 2
    return float(np.linalg.norm(centres[0] - centres[1])) > reach + GAP_MM


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LumpChanges:
    """What weak lumps on the axis change in nominal tissue, by diameter, depth and force: solved once and kept.

    A change goes with the contrast factor (E_i - E) / (E_i + 1.5 E); it is taken for tissue of any modulus and slab.
    """

    radius_mm: NDArray[np.float64]
    of_lump: RegularGridInterpolator

    def __call__(self, lump: Inclusion, tissue_kpa: float, force_n: float) -> NDArray[np.float64]:
        """Change of pressure (kPa) and displacement (mm) over the radius, shape (2, n)."""
        at = np.array([lump.diameter_mm, lump.depth_mm, force_n])
        return np.asarray(float(contrast_factor(lump.young_kpa / tissue_kpa)) * self.of_lump(at)[0])


@lru_cache(maxsize=4)
def lump_changes(probe: Probe, forces_n: tuple[float, float]) -> LumpChanges:
    """Changes under forces near two, between and beyond which a press that covers the face is linear in the force."""
    content = {
        "probe": mechanical_content(probe),
        "forces": list(forces_n),
        "lumps": [list(DIAMETERS_MM), list(TOPS_MM), WEAK],
    }

    def solve() -> dict[str, NDArray[np.float64]]:
        values = [
            [[_change(probe, diameter, top, force) for force in forces_n] for top in TOPS_MM]
            for diameter in DIAMETERS_MM
        ]
        return {"values": np.array(values)}

    values = cached_arrays("lump-changes", content_key(content), solve)["values"]
    return LumpChanges(
        radius_mm=np.linspace(0.0, probe.radius_mm, values.shape[-1]),
        of_lump=RegularGridInterpolator((DIAMETERS_MM, TOPS_MM, forces_n), values, bounds_error=False, fill_value=None),
    )


def _change(probe: Probe, diameter_mm: float, top_mm: float, force_n: float) -> NDArray[np.float64]:
    """By a contrast factor of 1, from a stiffer and a softer lump."""
    found, factors = [], []
    for sign in (1, -1):
        young = NOMINAL.young_kpa * float(np.exp(sign * WEAK))
        lump = Inclusion(diameter_mm=diameter_mm, depth_mm=top_mm, young_kpa=young, poisson=NOMINAL.poisson)
        field = press(probe, replace(NOMINAL, inclusion=lump), force_n=force_n, resolution=FINE_RESOLUTION)
        found.append(np.array([field.pressure_kpa, field.face_displacement_mm]))
        factors.append(float(contrast_factor(young / NOMINAL.young_kpa)))
    return np.asarray((found[0] - found[1]) / (factors[0] - factors[1]))


class FaceGrid:
    """A grid over the face, and changes on the axis moved beside it."""

    def __init__(self, probe: Probe) -> None:
        steps = int(np.ceil(probe.radius_mm / SPACING_MM))
        self.edge = probe.radius_mm
        self.axis = SPACING_MM * np.arange(-steps, steps + 1)
        self.x, self.y = np.meshgrid(self.axis, self.axis)
        self.covered = self._on_grid(np.ones((2, 2)), np.array([0.0, self.edge])).pressure_kpa
        self.inside = np.hypot(self.x, self.y) <= self.edge * (1 + 1e-12)

    def _on_grid(self, values: NDArray[np.float64], radius_mm: NDArray[np.float64]) -> PressMap:
        pressure, moved = values
        field = PressField(
            radius_mm=radius_mm, pressure_kpa=pressure, face_displacement_mm=moved, approach_mm=0.0, force_n=0.0
        )
        return field.on_grid(self.axis, self.axis)

    def moved(
        self, radius_mm: NDArray[np.float64], change: NDArray[np.float64], offset_mm: tuple[float, float]
    ) -> NDArray[np.float64]:
        """Pressure and displacement over the grid, shape (2, m, m); around the axis the mean is `moved_profile`'s."""
        away = float(np.hypot(*offset_mm))
        if away > FARTHEST * self.edge * (1 + 1e-9):
            raise ValueError(f"offset_mm must be at most {FARTHEST * self.edge:g}; got {away:g}")
        level = np.array([np.interp(np.minimum(radius_mm, SHIFTED * self.edge), radius_mm, one) for one in change])
        stays = self._on_grid(change - level, radius_mm)
        growth = 1 / (1 - (away / self.edge) ** 2)
        from_it = np.minimum(np.hypot(self.x - offset_mm[0], self.y - offset_mm[1]), SHIFTED * self.edge)
        pressure, moved = (growth * np.interp(from_it, radius_mm, one) for one in change)
        return np.array(
            [stays.pressure_kpa + self.covered * pressure, stays.face_displacement_mm + self.inside * moved]
        )
