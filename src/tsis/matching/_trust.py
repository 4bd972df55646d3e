"""Calibrated probability that an answer is right: its root-mean-square error is at most 0.1 of the unit box.

The posterior over poses is a model's; it does not know of the poses that a search missed, nor of deformations that its
prior does not hold. A logistic regression on its log odds and on how well the best map explains the sets turns it into
a frequency. `benchmarks.matching_trust --calibrate` fits the weights on the calibration generator.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tsis.matching._pose_evidence import size_and_stretch

if TYPE_CHECKING:
    from tsis.matching._fit import Floats, Move
    from tsis.matching._posterior import PosePosterior

STEP = 1e-3  # of the numerical gradient of a map
MOST_FOLDED, MOST_STRETCH = 0.1, 1.4  # fraction of folded points, and log ratio of singular values, of a sound map
RELIABLE = 0.999  # least probability of a reliable answer
FEATURES = ("constant", "odds", "negative odds", "unpaired", "spare", "sigma", "odds x unpaired")
WEIGHTS = (0.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def trust_features(posterior: PosePosterior, moved: Floats) -> Floats:
    """What the probability depends on, shape (7,), for an answer's points, shape (n, d)."""
    odds, best = posterior.log_odds(moved), posterior.best
    if best is None:
        return np.array([1.0, 0.0, -400.0, 1.0, 1.0, 0.0, 0.0])
    sizes = len(moved), len(posterior.search.target)
    unpaired, spare = 1 - best.paired / min(sizes), 1 - best.paired / max(sizes)
    gain = math.log1p(max(odds, 0.0))
    noise = math.log(best.sigma / posterior.search.step)
    return np.array([1.0, gain, min(odds, 0.0), unpaired, max(spare, 0.0), noise, gain * unpaired])


def is_sound(move: Move, source: Floats) -> bool:
    """Whether a map of normalised points, shape (n, d), neither folds nor mirrors nor flattens the set."""
    dimension = source.shape[1]
    centred = source - source.mean(axis=0)
    matrix = np.linalg.lstsq(centred, move(source), rcond=None)[0]
    if np.linalg.det(matrix) <= 0 or size_and_stretch(matrix)[1] > MOST_STRETCH:
        return False
    steps = STEP * np.eye(dimension)
    gradient = np.stack([(move(source + step) - move(source - step)) / (2 * STEP) for step in steps], axis=1)
    return bool(np.mean(np.linalg.det(gradient) <= 0) <= MOST_FOLDED)


def probability_right(features: Floats) -> float:
    """Probability that the error is at most 0.1 of the unit box."""
    return float(1 / (1 + math.exp(-float(np.clip(features @ np.array(WEIGHTS), -50.0, 50.0)))))
