"""How wide a soft sphere touches a probe: the finite-strain contact as a polynomial beside Hertz's law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.model.check import require_array
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Probe

MIDDLE_RADIUS_MM, RADIUS_STEP_MM = 3.3, 3.0
MIDDLE_POISSON, POISSON_STEP = 0.475, 0.025
BASE_DEGREES, BASE_TOTAL = (4, 3), 5  # in depth and softness, of what a sphere of the middle radius and ratio adds
CHANGE_DEGREES, CHANGE_TOTAL, CHANGE_ORDER = (3, 1), 4, 2  # of what another radius or ratio changes
FIRM_DEPTH = 0.6  # from which on a contact is many elements wide


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactTable:
    """Contact radius of a sphere on one probe, from its load and what share of the compliance is the sphere's.

    Moduli and force share a unit, and small contacts follow Hertz's law ``a³ = 3 F R c / 4`` with the compliance
    ``c = (1 - nu²)/E + (1 - nu_s²)/E_s`` of sphere and skin. What large strains and the layers below the skin add to
    the logarithm of the radius is a polynomial in ``depth = (F c / R²)^(1/3)`` and ``softness``, the sphere's share of
    ``c``; the radius matters as far as the probe is soft, Poisson's ratio as far as the sphere is.

    Parameters
    ----------
    coefficients
        Of the terms of `terms`, shape (n,).
    softness, deepest, error
        Shares of the compliance, ascending, the greatest depth that the mechanics reach at each, and the relative error
        of the contact radius there: root mean square over presses that the fit has not seen, shape (m,) each.
    skin_compliance
        ``(1 - nu_s²)/E_s`` of the skin, 1/kPa.
    key
        Hash of what the table was computed from.
    """

    coefficients: NDArray[np.float64]
    softness: NDArray[np.float64]
    deepest: NDArray[np.float64]
    error: NDArray[np.float64]
    skin_compliance: float
    key: str

    def __post_init__(self) -> None:
        for name in ("coefficients", "softness", "deepest", "error"):
            object.__setattr__(self, name, require_array(name, getattr(self, name), ndim=1))

    def log_radius(
        self, young_kpa: Any, poisson: Any, radius_mm: Any, force_n: Any, *, probe_factor: Any = 1.0
    ) -> NDArray[np.float64]:
        """Natural logarithm of the contact radius in mm; all arguments broadcast.

        Parameters
        ----------
        young_kpa, poisson, radius_mm
            The sphere.
        force_n
            Force in newtons; beyond the deepest contact of the table the radius goes on as Hertz's does.
        probe_factor
            The moduli of the probe's layers over their nominal values.
        """
        softness, depth = self.place(young_kpa, poisson, radius_mm, force_n, probe_factor=probe_factor)
        inside = np.minimum(depth, self.deepest_at(softness))
        added = terms(inside, softness, radius_mm, poisson) @ self.coefficients
        return np.asarray(np.log(radius_mm) + np.log(0.75) / 3 + np.log(depth) + added)

    def place(
        self, young_kpa: Any, poisson: Any, radius_mm: Any, force_n: Any, *, probe_factor: Any = 1.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Softness and depth of presses, as the class describes them."""
        sphere = (1 - np.square(poisson)) / np.asarray(young_kpa, dtype=float)
        compliance = sphere + self.skin_compliance / probe_factor
        depth = np.cbrt(MN_PER_N * np.asarray(force_n) * compliance / np.square(radius_mm))
        softness, depth = np.broadcast_arrays(sphere / compliance, depth)
        return softness, depth

    def deepest_at(self, softness: NDArray[np.float64]) -> NDArray[np.float64]:
        """Depth up to which the mechanics were solved."""
        return np.asarray(np.interp(softness, self.softness, self.deepest))

    def error_at(self, softness: NDArray[np.float64], depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative error of the contact radius; more where the contact is shallow and few elements wide."""
        return np.asarray(np.interp(softness, self.softness, self.error) / firmness(depth))


def firmness(depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weight of a press in the fit: 1, less where the contact is so shallow that it is few elements wide."""
    return np.asarray(np.minimum(1.0, depth / FIRM_DEPTH) ** 2)


def skin_compliance(probe: Probe) -> float:
    """``(1 - nu²)/E`` of the first layer, 1/kPa."""
    skin = probe.layers[0]
    return (1 - skin.poisson**2) / skin.young_kpa


def terms(depth: Any, softness: Any, radius_mm: Any, poisson: Any) -> NDArray[np.float64]:
    """Terms of the polynomial, shape of the arguments (which broadcast) with the terms as a last axis."""
    depth, softness, radius, ratio = np.broadcast_arrays(
        depth,
        softness,
        (np.asarray(radius_mm) - MIDDLE_RADIUS_MM) / RADIUS_STEP_MM,
        (np.asarray(poisson) - MIDDLE_POISSON) / POISSON_STEP,
    )
    centred = 2 * softness - 1
    columns = [
        depth**i * centred**j
        for i in range(BASE_DEGREES[0] + 1)
        for j in range(BASE_DEGREES[1] + 1)
        if i + j <= BASE_TOTAL
    ]
    for share, change in ((1 - softness, radius), (softness, ratio)):
        columns += [
            share * change**order * depth**i * centred**j
            for order in range(1, CHANGE_ORDER + 1)
            for i in range(CHANGE_DEGREES[0] + 1)
            for j in range(CHANGE_DEGREES[1] + 1)
            if order + i + j <= CHANGE_TOTAL
        ]
    return np.stack(columns, axis=-1)
