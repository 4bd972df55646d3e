"""Variances and covariances of areas under curves by DeLong, DeLong and Clarke-Pearson (1988)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from tsis.detection.auc import doubled_placements
from tsis.detection.inputs import booleans, both_classes
from tsis.detection.interval import LEVEL, Interval, checked_level
from tsis.model.check import require_array
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

FROM_TARGETS = 30  # of each class, from which the normal law of the area is trusted
FROM_ENDS = 5  # smaller class times distance of the area from 0 and 1: nearer, the normal law covers too little


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AucCovariance:
    """Areas of several methods on the same targets, with what their errors have in common.

    Attributes
    ----------
    auc
        Areas under the curves, shape (methods,).
    covariance
        Of their errors, shape (methods, methods).
    present, absent
        Numbers of targets with and without an inclusion.
    """

    auc: NDArray[np.float64]
    covariance: NDArray[np.float64]
    present: int
    absent: int

    def __post_init__(self) -> None:
        for name in ("auc", "covariance"):
            held = np.array(getattr(self, name), dtype=float)
            held.flags.writeable = False
            object.__setattr__(self, name, held)


def auc_covariance(scores: ArrayLike, present: ArrayLike) -> AucCovariance:
    """Areas under the curves of several methods, and their covariance.

    Parameters
    ----------
    scores
        Scores of each method for the same targets, shape (methods, targets); higher speaks for an inclusion.
    present
        Whether a target holds an inclusion, booleans of shape (targets,); at least two targets of each kind.

    Raises
    ------
    InputError
        When the scores are not finite or their shape does not fit, or a class has fewer than two targets.

    Examples
    --------
    >>> found = auc_covariance([[1, 4, 2, 5], [2, 1, 3, 4]], [False, True, False, True])
    >>> found.auc.tolist()
    [1.0, 0.5]
    """
    values, truth = require_array("scores", scores, ndim=2), booleans("present", present)
    if values.shape[1] != len(truth):
        raise InputError(f"scores must have one column a target, {len(truth)} in all; got shape {values.shape}")
    m, n = both_classes(truth, least=2, needed_by="a variance")
    inside, outside = _placed(values, truth)
    return AucCovariance(
        auc=inside.sum(axis=1) / (2 * m * n), covariance=_covariance(inside, outside), present=m, absent=n
    )


def delong_interval(scores: NDArray[np.float64], present: NDArray[np.bool_], level: float = LEVEL) -> Interval:
    """DeLong's interval of one area, cut to [0, 1].

    Parameters
    ----------
    scores, present
        Shape (targets,), as `tsis.detection.roc` takes them.
    level
        Confidence, in (0, 1).

    Raises
    ------
    InputError
        When a class has fewer than two targets, or the variance is estimated as 0, as it is for areas of 0 and 1.

    Examples
    --------
    >>> interval = delong_interval(np.array([1.0, 3.0, 2.0, 4.0]), np.array([False, False, True, True]), 0.5)
    >>> [round(end, 3) for end in interval]
    [0.512, 0.988]
    """
    z = float(ndtri(0.5 + checked_level(level) / 2))
    found = auc_covariance(np.atleast_2d(scores), present)
    auc, variance = float(found.auc[0]), float(found.covariance[0, 0])
    if variance == 0:
        raise InputError(
            f"method must not be delong where its variance is 0, as for an area under the curve of {auc:g}: "
            "take newcombe, which holds there"
        )
    half = z * math.sqrt(variance)
    return Interval(low=max(auc - half, 0.0), high=min(auc + half, 1.0), level=level, method="delong")


def difference_variance(first: NDArray[np.float64], second: NDArray[np.float64], present: NDArray[np.bool_]) -> float:
    """Variance of the difference of two areas on the same targets; exactly 0 where nothing varies.

    Parameters
    ----------
    first, second
        Scores of two methods, shape (targets,).
    present
        Whether a target holds an inclusion, shape (targets,), at least two of each kind.
    """
    inside, outside = _placed(np.stack([first, second]), present)
    return float(_covariance(inside[:1] - inside[1:], outside[:1] - outside[1:])[0, 0])


def _placed(scores: NDArray[np.float64], present: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    pairs = [doubled_placements(row, present) for row in scores]
    return np.stack([inside for inside, _ in pairs]), np.stack([outside for _, outside in pairs])


def _covariance(inside: NDArray[np.int64], outside: NDArray[np.int64]) -> NDArray[np.float64]:
    """From doubled placements of shapes (methods, m) and (methods, n); whole numbers leave exact zeros."""
    m, n = inside.shape[1], outside.shape[1]
    within = np.atleast_2d(np.cov(inside - inside[:, :1])) / (4 * n**2)
    without = np.atleast_2d(np.cov(outside - outside[:, :1])) / (4 * m**2)
    both: NDArray[np.float64] = within / m + without / n
    return both


def is_normal(auc: float, present: int, absent: int) -> bool:
    """Whether DeLong's interval of an area covers as it says, as measured by ``benchmarks/detection_intervals.py``.

    Parameters
    ----------
    auc
        Area, in [0, 1].
    present, absent
        Numbers of targets with and without an inclusion.

    Examples
    --------
    >>> is_normal(0.8, 40, 40), is_normal(0.8, 8, 8), is_normal(0.98, 40, 40)
    (True, False, False)
    """
    smaller = min(present, absent)
    return smaller >= FROM_TARGETS and smaller * min(auc, 1 - auc) >= FROM_ENDS


__all__ = ["AucCovariance", "auc_covariance", "delong_interval", "difference_variance", "is_normal"]
