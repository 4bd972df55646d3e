"""Real contact of rough surfaces under a pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import erf

if TYPE_CHECKING:
    from tsis.optics._inputs import Floats


ERF_SLOPE = np.sqrt(np.pi) / 2  # erf(0.886 x) has the slope 1 at zero


def real_contact(pressure_kpa: Floats, saturation_kpa: float) -> Floats:
    """Fraction ``erf(0.886 p / saturation)`` of the face in real contact with asperities, zero under tension.

    Examples
    --------
    >>> real_contact(np.array([-1.0, 1.0, 100.0]), 20.0).round(3).tolist()
    [0.0, 0.05, 1.0]
    """
    return np.asarray(erf(ERF_SLOPE * np.maximum(pressure_kpa, 0.0) / saturation_kpa), dtype=float)
