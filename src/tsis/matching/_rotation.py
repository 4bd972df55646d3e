"""Prior of the rotation between two sets, over the prior without any knowledge."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import i0e

if TYPE_CHECKING:
    from tsis.matching._fit import Floats

UPRIGHT, UPRIGHT_SD_DEG = 0.8, 20.0  # default: this fraction of all pairs is the same way up, within so many degrees
WIDEST_DEG = 1000.0  # a standard deviation from which all rotations are equally likely


def log_rotation_prior(matrix: Floats, sd_deg: float | None) -> float:
    """Log density of the nearest rotation to a matrix, shape (d, d), over that of equally likely rotations.

    With ``sd_deg`` the angle has a von Mises distribution (in space: that of its exponent on all rotations) of this
    standard deviation. None is the default mixture: `UPRIGHT` within `UPRIGHT_SD_DEG`, else any rotation.

    Examples
    --------
    >>> round(log_rotation_prior(np.eye(2), 1000.0), 6)
    0.0
    """
    cosine = math.cos(math.radians(rotation_deg(matrix)))
    if sd_deg is None:
        upright = math.exp(_concentrated(cosine, UPRIGHT_SD_DEG, len(matrix)))
        return math.log(UPRIGHT * upright + 1 - UPRIGHT)
    return 0.0 if sd_deg >= WIDEST_DEG else _concentrated(cosine, sd_deg, len(matrix))


def rotation_deg(matrix: Floats) -> float:
    """Angle of the nearest rotation to a matrix, shape (d, d), in [0, 180]."""
    left, _, right = np.linalg.svd(matrix)
    trace = float(np.trace(left @ right))
    return math.degrees(math.acos(float(np.clip(trace / 2 if len(matrix) == 2 else (trace - 1) / 2, -1.0, 1.0))))


def _concentrated(cosine: float, sd_deg: float, dimension: int) -> float:
    concentration = 1 / math.radians(sd_deg) ** 2
    return concentration * (cosine - 1) - _log_normaliser(concentration, dimension)


@lru_cache(maxsize=32)
def _log_normaliser(concentration: float, dimension: int) -> float:
    """Log mean of ``exp(concentration (cos - 1))`` over all rotations."""
    if dimension == 2:
        return math.log(float(i0e(concentration)))
    angle = np.linspace(0, np.pi, 20_001)
    density = np.exp(concentration * (np.cos(angle) - 1)) * (1 - np.cos(angle)) / np.pi
    return math.log(float(np.trapezoid(density, angle)))
