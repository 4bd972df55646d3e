"""Presses of the phantoms of section 6.4, solved at a few stiffnesses and forces and interpolated between.

The mesh is finer and of another order than the estimator's. A probe's own stiffness, and the modulus of a reference
place, only scale the moduli of the tissue, so one coordinate serves both; a press that covers the face is linear in its
force.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.searched_presses import MovingProbe

import tsis
from tsis.files import cached_arrays, content_key
from tsis.mechanics import press
from tsis.mechanics.surrogate import mechanical_content
from tsis.model import PressField
from tsis.virtual.probe import FINE_RESOLUTION

if TYPE_CHECKING:
    from benchmarks.uneven_tissue import Site
    from numpy.typing import NDArray

    from tsis.model import Phantom

BLANK = "detection-blank"
LOG_SOFTER = (-0.15, -0.05, 0.05, 0.15)  # logarithms of tissue over nominal, at which presses are solved
FORCE_SHARES = (0.96, 1.04)  # of the commanded force


@lru_cache(maxsize=64)
def solved(probe_name: str, phantom_name: str, force_n: float) -> NDArray[np.float64]:
    """Pressure and displacement at the stiffnesses and forces of the grid, shape (4, 2, 2, n); kept on disk."""
    probe, phantom = tsis.load_probe(probe_name), tsis.load_phantom(phantom_name)

    def solve() -> dict[str, NDArray[np.float64]]:
        fields = [
            [
                press(probe, scaled(phantom, np.exp(log)), force_n=share * force_n, resolution=FINE_RESOLUTION)
                for share in FORCE_SHARES
            ]
            for log in LOG_SOFTER
        ]
        return {"fields": np.array([[[f.pressure_kpa, f.face_displacement_mm] for f in row] for row in fields])}

    content = {
        "probe": mechanical_content(probe),
        "phantom": repr(phantom),
        "force": force_n,
        "grid": [*LOG_SOFTER, *FORCE_SHARES],
    }
    return cached_arrays("section-6-4", content_key(content), solve)["fields"]


def scaled(phantom: Phantom, factor: float) -> Phantom:
    """The phantom with every modulus times a factor."""
    lump = phantom.inclusion
    stiffer = None if lump is None else replace(lump, young_kpa=float(factor) * lump.young_kpa)
    return replace(phantom, young_kpa=float(factor) * phantom.young_kpa, inclusion=stiffer)


def between(probe_name: str, phantom_name: str, *, nominal_n: float, log_softer: float, force_n: float) -> PressField:
    """A press of the phantom with moduli times ``exp(log_softer)``, interpolated between those that were solved."""
    fields = solved(probe_name, phantom_name, nominal_n)
    nodes = np.array(LOG_SOFTER)
    log = float(np.clip(log_softer, *nodes[[0, -1]]))
    cubic = [np.prod([(log - other) / (node - other) for other in nodes if other != node]) for node in nodes]
    low, high = FORCE_SHARES
    share = (force_n / nominal_n - low) / (high - low)
    pressure, moved = np.einsum("s,f,sfqn->qn", cubic, [1 - share, share], fields)
    radius = np.linspace(0.0, tsis.load_probe(probe_name).radius_mm, len(pressure))
    return PressField(
        radius_mm=radius, pressure_kpa=pressure, face_displacement_mm=moved, approach_mm=0.0, force_n=force_n
    )


class PreparedProbe(MovingProbe):
    """A virtual probe whose round presses were solved before: it makes all its errors, and no mechanics."""

    phantom_name: str = BLANK
    nominal_n: float = 1.0

    def press_prepared(self, phantom_name: str, site: Site, force_n: float) -> tsis.TactileImage:
        """One frame of a site whose tissue and inclusion are those of a phantom, all moduli times one factor."""
        self.phantom_name, self.nominal_n = phantom_name, force_n
        return self.press_site(site, force_n=force_n, solid=False)

    def _round_press(self, phantom: Phantom, force_n: float) -> PressField:
        name = BLANK if phantom.inclusion is None else self.phantom_name
        nominal = tsis.load_phantom(name).young_kpa
        return between(
            self.probe.name,
            name,
            nominal_n=self.nominal_n,
            log_softer=float(np.log(phantom.young_kpa / nominal)),
            force_n=force_n,
        )
