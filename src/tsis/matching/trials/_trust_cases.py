"""What calibrates the confidence of a match: cases with their features, and the regression on them."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

from tsis.matching._fit import NormalFrame
from tsis.matching._registration import confidence_and_posterior
from tsis.matching._trust import RELIABLE, is_sound, trust_features
from tsis.matching.trials._trials import matching_error

if TYPE_CHECKING:
    from tsis.matching._fit import Floats
    from tsis.matching.trials._distort import Trial

RIDGE = 0.01  # on the weights but the constant


@dataclass(frozen=True, slots=True, kw_only=True)
class TrustCase:
    """One answer, how far it is wrong, and what was said of it.

    Attributes
    ----------
    trial, method
        Names of the trial and of the method.
    error
        Root-mean-square error, in the trial's unit.
    unmoved_error
        Error of the source where it is, which an abstaining answer has.
    confidence
        Calibrated probability that the error is at most 0.1.
    reliable
        Whether the confidence suffices.
    second
        Posterior probability of all poses but the best.
    seconds
        Duration.
    features
        Of the regression.
    """

    trial: str
    method: str
    error: float
    unmoved_error: float
    confidence: float
    reliable: bool
    second: float
    seconds: float
    features: tuple[float, ...]


def trust_case(trial: Trial, method: str, *, rotation_sd_deg: float | None = None) -> TrustCase:
    """Match a trial by one of the methods of `tsis.matching.METHODS` and compare the answer with the truth."""
    start = time.perf_counter()
    here, there = NormalFrame.of(trial.source), NormalFrame.of(trial.target)
    source, target = here.inward(trial.source), there.inward(trial.target)
    fit, posterior, confidence = confidence_and_posterior(method, source, target, rotation_sd_deg=rotation_sd_deg)
    moved = fit.move(source)
    seconds = time.perf_counter() - start
    poses = posterior.alternatives()
    centre = trial.target.mean(axis=0) - trial.source.mean(axis=0)
    return TrustCase(
        trial=trial.name,
        method=method,
        error=matching_error(trial, there.outward(moved)),
        unmoved_error=matching_error(trial, trial.source + centre),
        confidence=confidence,
        reliable=confidence >= RELIABLE,
        second=1 - poses[0].probability if poses else 1.0,
        seconds=seconds,
        features=tuple(trust_features(posterior, moved).tolist()) if is_sound(fit.move, source) else (),
    )


def fit_trust(features: Floats, right: Floats) -> Floats:
    """Weights, shape (k,), of the logistic regression of being right, shape (n,), on features, shape (n, k).

    A weak ridge on standardised features bounds the weights.
    """
    scale = np.maximum(np.std(features, axis=0), 1e-9)
    scale[0] = 1.0
    scaled = features / scale

    def loss(weights: Floats) -> tuple[float, Floats]:
        logit = scaled @ weights
        chance = 1 / (1 + np.exp(-np.clip(logit, -50, 50)))
        value = np.logaddexp(0, logit).sum() - right @ logit + 0.5 * RIDGE * (weights[1:] ** 2).sum()
        return float(value), scaled.T @ (chance - right) + RIDGE * np.append(0.0, weights[1:])

    result = minimize(loss, np.zeros(features.shape[1]), jac=True, method="L-BFGS-B", options={"maxiter": 2000})
    return np.asarray(result.x / scale)
