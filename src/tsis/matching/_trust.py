"""Calibrated probability that an answer is right: its root-mean-square error is at most 0.1 of the unit box.

The posterior over poses is a model's; it does not know of the poses that a search missed, nor of deformations that its
prior does not hold. A logistic regression on its log odds and on how well the best map explains the sets turns it into
a frequency. `benchmarks.matching_trust --calibrate` fits the weights on the calibration generator.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from tsis.matching._outline import self_resemblance
from tsis.matching._pose_evidence import size_and_stretch
from tsis.matching._posterior import distance

if TYPE_CHECKING:
    from tsis.matching._fit import Floats, Move
    from tsis.matching._posterior import PosePosterior

STEP = 1e-3  # of the numerical gradient of a map
MOST_FOLDED, MOST_STRETCH = 0.1, 1.4  # fraction of folded points, and log ratio of singular values, of a sound map
RELIABLE = 0.999  # least probability of a reliable answer
MOST_RESEMBLANCE = 1e4
MOST_NOISE, LEAST_NOISE = 0.5, -3.0  # log of the standard deviation in spacings, in the calibration
FARTHEST = 0.05  # root-mean-square radii: an answer this far from the best map is judged as that map
COLLAPSED = -0.05  # unpaired fraction below which points of one set share partners
COMPLETE, PRECISE = 0.03, -1.5  # fraction without partner, and log noise in spacings, below which sets are complete
MOST_SPARE = 0.75  # of the calibration: three outliers an inlier
MOST_UNSUPPORTED = 0.99
WEIGHTS = (
    *(1.803, 0.8427, -0.1743, -1.112, -8.958, 0.5957, -1.097, 2.393),
    *(0.1991, 5.587, 0.1879, 0.8187, -0.4518),
    *(3.242, -0.8025, 0.3717, 0.4297, 0.2928),
    *(-3.708, 2.453, 0.09857, 1.818, -1.549),
)


def trust_features(posterior: PosePosterior, moved: Floats) -> Floats:
    """What the probability depends on, shape (23,), for an answer's points, shape (n, d).

    It grows with the posterior odds of the answer and with what a wrong alignment of the source's outline with itself
    would cost. It falls with points without partner, noise, and distance from the best map. Squares and products
    follow, and terms for sets whose points all have partners.
    """
    odds, best = posterior.log_odds(moved), posterior.best
    gain, loss = math.log1p(max(odds, 0.0)), math.log1p(max(-odds, 0.0))
    if best is None:
        return _expanded(0.0, loss, 1.0, 1.0, 0.0, 1.0, 0.0)
    search = posterior.search
    sizes = len(moved), len(search.target)
    unpaired, spare = 1 - best.paired / min(sizes), 1 - best.paired / max(sizes)
    noise = float(np.clip(math.log(best.sigma / search.step), LEAST_NOISE, MOST_NOISE))
    resemblance = 1 - math.log1p(min(self_resemblance(search.field), MOST_RESEMBLANCE)) / math.log1p(MOST_RESEMBLANCE)
    far = math.log(max(distance(best.moved, moved) / FARTHEST, 1.0))
    return _expanded(gain, loss, abs(unpaired), min(max(spare, 0.0), MOST_SPARE), noise, resemblance, far)


def _expanded(
    gain: float, loss: float, unpaired: float, spare: float, noise: float, resemblance: float, far: float
) -> Floats:
    squares = [gain**2, spare**2, noise**2, resemblance**2, far**2]
    products = [resemblance * spare, resemblance * gain, gain * spare, gain * unpaired, gain * noise]
    complete = unpaired < COMPLETE and spare < COMPLETE and noise < PRECISE
    alone = [1.0, gain, loss, resemblance, far] if complete else [0.0] * 5
    return np.array([1.0, gain, loss, unpaired, spare, noise, resemblance, far, *squares, *products, *alone])


def is_collapsed(posterior: PosePosterior) -> bool:
    """Whether points of one set share partners in the best map."""
    best = posterior.best
    return best is None or best.paired > (1 - COLLAPSED) * min(len(best.moved), len(posterior.search.target))


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


def probability_right(posterior: PosePosterior, moved: Floats) -> float:
    """Probability that an answer's points, shape (n, d), are right: their error is at most 0.1 of the unit box.

    It is at most the probability that the sets are related. It is at most `MOST_UNSUPPORTED` without posterior odds of
    `RELIABLE`, or where the source's outline could as well lie on itself in another way, as that of a symmetric shape.
    """
    features = trust_features(posterior, moved)
    chance = float(1 / (1 + math.exp(-float(np.clip(features @ np.array(WEIGHTS), -50.0, 50.0)))))
    chance *= 1 - math.exp(min(posterior.unrelated, 0.0))
    odds = min(posterior.log_odds(moved), 0.5 * self_resemblance(posterior.search.field))
    supported = odds >= math.log(RELIABLE / (1 - RELIABLE))
    return chance if supported else min(chance, MOST_UNSUPPORTED)
