"""Convert Young's modulus to the reading of a Shore durometer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable


LEAST, MOST = 10.0, 90.0  # range of the scales
SOURCES = (
    "Shore A: Gent, Rubber Chem. Technol. 31 (1958) 896; Shore 00: spring and ball of ASTM D2240 in Hertz's law, "
    "incompressible"
)
BALL_MM = 1.19  # radius of the 00 indenter
TRAVEL_MM = 2.5  # of the indenter at a reading of 0
SPRING_N = (0.203, 0.00908)  # force of the 00 spring at 0, and increase per point


@dataclass(frozen=True, slots=True, kw_only=True)
class ShoreHardness:
    """Shore readings of a material.

    Attributes
    ----------
    shore_a, shore_00
        Readings in [10, 90]; None outside.
    source
        References of the conversions.
    """

    shore_a: float | None
    shore_00: float | None
    source: str = SOURCES


def shore(young_kpa: float) -> ShoreHardness:
    """Convert Young's modulus to Shore A and Shore 00.

    Both relations assume linear elasticity; durometers indent deeply, and real readings scatter by some points. Raises
    `InputError` when the modulus lies outside its range.

    Parameters
    ----------
    young_kpa
        Modulus in kPa, in [0.1, 1e6].

    Examples
    --------
    >>> reading = shore(103.0)
    >>> reading.shore_a, round(reading.shore_00)
    (None, 29)
    """
    require_number("young_kpa", young_kpa, 0.1, 1e6, hint="kilopascals")
    return ShoreHardness(shore_a=_read(young_kpa, young_of_shore_a), shore_00=_read(young_kpa, young_of_shore_00))


def young_of_shore_a(reading: float) -> float:
    """Modulus in kPa of a Shore A reading: ``E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S))`` MPa."""
    return 1e3 * 0.0981 * (56 + 7.62336 * reading) / (0.137505 * (254 - 2.54 * reading))


def young_of_shore_00(reading: float) -> float:
    """Modulus in kPa of a Shore 00 reading: ``F = 16/9 E sqrt(R) depth^1.5`` with the durometer's force and depth."""
    force = SPRING_N[0] + SPRING_N[1] * reading
    depth = TRAVEL_MM * (1 - reading / 100)
    return float(1e3 * 9 * force / (16 * np.sqrt(BALL_MM) * depth**1.5))


def _read(young_kpa: float, young_of: Callable[[float], float]) -> float | None:
    if not young_of(LEAST) <= young_kpa <= young_of(MOST):
        return None
    return float(scipy.optimize.brentq(lambda reading: young_of(reading) - young_kpa, LEAST, MOST))
