"""Solved presses of spheres, from which many rigs take theirs: a path of the fine model serves several frames.

Contacts at neighbouring forces and moduli look alike once radius and pressure are scaled by the contact's own. So the
scaled profile, the logarithm of the contact radius and the displacement are interpolated by the logarithms of force and
modulus between a few solved presses; `tests/benchmarks/test_hardness_bank.py` says how closely.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.files.cache import cached_arrays, content_key
from tsis.hardness.sphere import hertzian_radius_mm, press_fields
from tsis.mechanics.mesh import mechanical_content
from tsis.model.phantom import SoftSphere
from tsis.model.press import PressField
from tsis.virtual.direct_contact import DIRECT_CONTACT_RESOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.model.probe import Probe

KIND = "hardness-bank"
AROUND = (-0.06, 0.02)  # logarithms of the solved forces over the commanded one, which may be as large as it can be
SCALED = np.linspace(0.0, 3.0, 301)  # radii over the contact radius


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvedSphere:
    """Presses of one sphere at two forces near each commanded one, at one or more moduli; solved once and kept."""

    probe: Probe
    radius_mm: float
    poisson: float
    young_kpa: tuple[float, ...]
    forces_n: tuple[float, ...]

    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """Solved quantities, moduli by forces first."""
        content = {
            "probe": mechanical_content(self.probe),
            "sphere": [self.radius_mm, self.poisson, list(self.young_kpa), list(self.forces_n)],
            "resolution": asdict(DIRECT_CONTACT_RESOLUTION),
            "scaled": [*AROUND, len(SCALED)],
        }
        return cached_arrays(KIND, content_key(content), self._solve)

    def _nodes(self) -> list[float]:
        return [force * float(np.exp(side)) for force in self.forces_n for side in AROUND]

    def _solve(self) -> dict[str, NDArray[np.float64]]:
        found: dict[str, list[Any]] = {"log_radius": [], "pressure": [], "moved": []}
        for young in self.young_kpa:
            sphere = SoftSphere(radius_mm=self.radius_mm, young_kpa=young, poisson=self.poisson)
            fields = press_fields(self.probe, sphere, forces_n=self._nodes(), resolution=DIRECT_CONTACT_RESOLUTION)
            radii = [hertzian_radius_mm(field) for field in fields]
            found["log_radius"].append(np.log(radii))
            pairs = list(zip(fields, radii, strict=True))
            found["pressure"].append(
                [np.interp(a * SCALED, f.radius_mm, f.pressure_kpa) * a**2 / f.force_n for f, a in pairs]
            )
            found["moved"].append([f.face_displacement_mm for f in (field for field, _ in pairs)])
        return {name: np.array(values) for name, values in found.items()}

    def __call__(
        self, probe: Probe, sphere: SoftSphere, *, forces_n: Sequence[float], resolution: object
    ) -> list[PressField]:
        """Fields at ``forces_n``, as `tsis.hardness.sphere.press_fields` gives them."""
        del probe, resolution
        arrays = self.arrays()
        return [self._field(arrays, float(np.log(sphere.young_kpa)), float(force)) for force in forces_n]

    def _field(self, arrays: dict[str, NDArray[np.float64]], log_young: float, force_n: float) -> PressField:
        nearest = int(np.argmin(np.abs(np.log(force_n / np.array(self.forces_n)))))
        low, high = self._nodes()[2 * nearest : 2 * nearest + 2]
        share = np.log(force_n / low) / np.log(high / low)
        across = np.array([1 - share, share])
        down = _lagrange(np.log(self.young_kpa), log_young)
        log_radius, pressure, moved = (
            np.tensordot(across, np.tensordot(down, arrays[name], 1)[2 * nearest : 2 * nearest + 2], 1)
            for name in ("log_radius", "pressure", "moved")
        )
        contact = float(np.exp(log_radius))
        radius = np.linspace(0.0, self.probe.radius_mm, len(moved))
        field = PressField(
            radius_mm=radius,
            face_displacement_mm=moved,
            pressure_kpa=np.interp(radius, contact * SCALED, pressure, right=0.0) * force_n / contact**2,
            approach_mm=0.0,
            force_n=force_n,
        )
        carried = np.trapezoid(2e-3 * np.pi * radius * field.pressure_kpa, radius)
        return replace(field, pressure_kpa=field.pressure_kpa * force_n / carried)


def _lagrange(nodes: NDArray[np.float64], place: float) -> NDArray[np.float64]:
    """Weights of the values at ``nodes``, of the polynomial through them at ``place``."""
    weights = [
        np.prod([(place - other) / (node - other) for other in np.delete(nodes, i)]) for i, node in enumerate(nodes)
    ]
    return np.array(weights)
