"""How far an answer can be relied on, whatever method gave it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.matching.evidence import log_evidence
from tsis.matching.spline import far_apart, spline_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.matching.fit import Fit

RELIABLE = 0.5
# Log evidence, by dimension, at which a match is as likely as chance. Unrelated shapes of one size reach it now and
# then, for all shapes have outlines, and methods look for the pose that explains most.
EVEN = {2: 15.0, 3: 60.0}
SCALE = 3.0
MOST = 600  # points of each set that are looked at
PASSING = 1e-6  # bending that is held back when the spline is read back from the moved points


def confidence_of(fit: Fit, source: NDArray[np.float64], target: NDArray[np.float64]) -> float:
    """Confidence in [0, 1] that an answer says more than chance: from the evidence for it, over that for no relation.

    A wrong answer that explains much, as half of a shape that lies on another, is not told from a right one.

    Parameters
    ----------
    fit
        What a method found.
    source, target
        The normalised points that it was given.
    """
    seen = source[far_apart(source, MOST)] if len(source) > MOST else source
    there = target[far_apart(target, MOST)] if len(target) > MOST else target
    basis = spline_basis(seen)
    coordinates = basis.coordinates(fit.move(seen), bending=PASSING)
    return float(
        1 / (1 + np.exp(np.clip((EVEN[source.shape[1]] - log_evidence(basis, coordinates, there)) / SCALE, -50, 50)))
    )
