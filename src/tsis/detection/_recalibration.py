"""Logistic recalibration of probabilities after Cox."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from tsis.detection._brier import probabilities_and_truth
from tsis.detection._inputs import LEVEL, Interval, both_classes, checked_level
from tsis.errors import InputError, import_extra

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


STEPS = 100
TOLERANCE = 1e-10  # of the gradient of the mean likelihood


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedValue:
    """A maximum-likelihood estimate.

    Attributes
    ----------
    value
        The estimate.
    standard_error
        From the curvature of the likelihood there.
    """

    value: float
    standard_error: float

    def interval(self, level: float = LEVEL) -> Interval:
        """Wald's interval; it assumes a normal distribution, and is approximate below some 30 targets of each kind.

        ``level`` is the confidence, in (0, 1); else `InputError` is raised.
        """
        half = float(scipy.special.ndtri(0.5 + checked_level(level) / 2)) * self.standard_error
        return Interval(low=self.value - half, high=self.value + half, level=level, method="wald")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recalibration:
    """``logit(true fraction) = intercept + slope * logit(probability)``.

    Attributes
    ----------
    slope
        1 for calibrated probabilities; below 1 they are overconfident, above 1 underconfident.
    intercept
        With that slope; 0 for calibrated probabilities.
    in_the_large
        Intercept with the slope fixed at 1: positive where inclusions are more frequent than the probabilities.
    """

    slope: FittedValue
    intercept: FittedValue
    in_the_large: FittedValue


def recalibration(probabilities: ArrayLike, present: ArrayLike) -> Recalibration:
    """Fit slope and intercept of the logits by maximum likelihood.

    Raises `InputError` when the input is invalid, a class is missing, or the probabilities separate both kinds, so that
    the slope is infinite.

    Parameters
    ----------
    probabilities
        That each target contains an inclusion, shape (targets,), strictly between 0 and 1, not all equal.
    present
        Whether it does, booleans of shape (targets,), both kinds.

    Examples
    --------
    >>> fitted = recalibration([0.01, 0.1, 0.9, 0.99, 0.9, 0.1], [False, True, True, True, False, False])
    >>> fitted.slope.value < 1  # too bold
    True
    """
    values, truth = probabilities_and_truth(probabilities, present)
    both_classes(truth, needed_by="a recalibration")
    certain = (values == 0) | (values == 1)
    if certain.any():
        raise InputError(
            f"probabilities must lie strictly between 0 and 1 for their logits; got {np.count_nonzero(certain)} that "
            "do not: a probability from n samples can be counted as (k + 1/2) / (n + 1)"
        )
    logits = scipy.special.logit(values)
    _require_overlap(logits, truth)
    scale = float(np.abs(logits).max())
    joint, errors = _line(logits / scale, truth)
    return Recalibration(
        slope=FittedValue(value=joint[1] / scale, standard_error=errors[1] / scale),
        intercept=FittedValue(value=joint[0], standard_error=errors[0]),
        in_the_large=_shift(logits, truth),
    )


def _require_overlap(logits: NDArray[Any], truth: NDArray[np.bool_]) -> None:
    """Albert and Anderson (1984): the maximum exists where no cut separates both kinds, touching or not."""
    if np.ptp(logits) == 0:
        raise InputError("probabilities must not all be equal for a slope; got one value alone: add targets")
    within, without = logits[truth], logits[~truth]
    if within.min() >= without.max() or without.min() >= within.max():
        raise InputError(
            "probabilities of targets with and without an inclusion must overlap for a slope; got two parts that one "
            "cut separates: add targets"
        )


def _line(logits: NDArray[Any], truth: NDArray[np.bool_]) -> tuple[list[float], list[float]]:
    """Intercept and slope of the largest likelihood, with standard errors from its curvature."""
    linear_model = import_extra("sklearn.linear_model", feature="a recalibration", extra="classify")
    model = linear_model.LogisticRegression(C=np.inf, solver="newton-cholesky", tol=TOLERANCE, max_iter=STEPS)
    model.fit(logits[:, None], truth)
    at = np.array([model.intercept_[0], model.coef_[0, 0]])
    design = np.stack([np.ones_like(logits), logits], axis=1)
    chance = scipy.special.expit(design @ at)
    curvature = (design * (chance * (1 - chance))[:, None]).T @ design
    return at.tolist(), np.sqrt(np.diag(np.linalg.inv(curvature))).tolist()


def _shift(logits: NDArray[Any], truth: NDArray[np.bool_]) -> FittedValue:
    """Shift of the logits that makes the expected number of inclusions equal to the observed one."""
    observed = int(truth.sum())
    low, high = (
        scipy.special.logit(observed / len(truth)) - logits.max(),
        scipy.special.logit(observed / len(truth)) - logits.min(),
    )

    def excess(shift: float) -> float:
        return float(scipy.special.expit(logits + shift).sum() - observed)

    shift = float(scipy.optimize.brentq(excess, low - 1, high + 1, xtol=1e-13))
    chance = scipy.special.expit(logits + shift)
    return FittedValue(value=shift, standard_error=float(1 / np.sqrt((chance * (1 - chance)).sum())))
