"""How far an answer can be relied on, whatever method gave it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.matching.fit import UNMATCHED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.fit import Fit

RELIABLE = 0.1


def confidence_of(fit: Fit, source: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Confidence in [0, 1]: mean trust of as many matches as there could be."""
    possible = min(len(source), len(target))
    return float(min(1.0, np.sum(fit.trust[fit.matches != UNMATCHED]) / possible))
