"""Receiver operating characteristic: true and false positive rates as functions of the threshold."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection._auc import area, delong_interval, is_normal, newcombe_interval
from tsis.detection._bootstrap import DRAWS, bootstrap_auc
from tsis.detection._counts import Counts
from tsis.detection._inputs import LEVEL, both_classes, choice, scored
from tsis.errors import InputError
from tsis.model import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike, NDArray

    from tsis.detection._inputs import Interval


METHODS = ("delong", "newcombe", "bootstrap")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Roc:
    """A step curve; a target is decided as an inclusion where its score is at least the threshold.

    Raises `InputError` when a score is not finite, the truth is not boolean, the lengths differ, or a class is missing.

    Parameters
    ----------
    scores
        Shape (targets,), finite; higher means that an inclusion is likelier.
    present
        Whether a target holds an inclusion, booleans of shape (targets,), both kinds.

    Attributes
    ----------
    thresholds
        Infinity, where no target is decided as an inclusion, then the distinct scores, falling.
    true_positive_rate, false_positive_rate
        At each threshold, rising from 0 to 1.
    true_positives, false_positives
        Numbers of targets with and without an inclusion that are decided as one at each threshold.
    """

    scores: NDArray[np.float64]
    present: NDArray[np.bool]
    thresholds: NDArray[np.float64] = field(init=False)
    true_positives: NDArray[np.int64] = field(init=False)
    false_positives: NDArray[np.int64] = field(init=False)

    def __post_init__(self) -> None:
        scores, present = scored(self.scores, self.present)
        both_classes(present, needed_by="a curve")
        falling, position = np.unique(-scores, return_inverse=True)
        inside = np.bincount(position[present], minlength=len(falling))
        outside = np.bincount(position[~present], minlength=len(falling))
        results = {
            "scores": scores,
            "present": present,
            "thresholds": np.concatenate([[math.inf], -falling]),
            "true_positives": np.concatenate([[0], np.cumsum(inside)]),
            "false_positives": np.concatenate([[0], np.cumsum(outside)]),
        }
        for name, value in results.items():
            value.flags.writeable = False
            object.__setattr__(self, name, value)

    @property
    def targets(self) -> int:
        """Number of targets with an inclusion."""
        return int(self.true_positives[-1])

    @property
    def blanks(self) -> int:
        """Number of targets without one."""
        return int(self.false_positives[-1])

    @property
    def true_positive_rate(self) -> NDArray[np.float64]:
        """Sensitivity at each threshold."""
        rate: NDArray[np.float64] = self.true_positives / self.targets
        return rate

    @property
    def false_positive_rate(self) -> NDArray[np.float64]:
        """One less specificity at each threshold."""
        rate: NDArray[np.float64] = self.false_positives / self.blanks
        return rate

    @property
    def auc(self) -> float:
        """Area under the curve, in [0, 1]: how often a target with an inclusion scores above one without, ties half."""
        return area(self.scores, self.present)

    def counts(self, index: int) -> Counts:
        """Decisions at the threshold of that index, counted; `InputError` when there is no such threshold.

        Parameters
        ----------
        index
            Into ``thresholds``, from 0.
        """
        index = require_integer("index", index, 0, len(self.thresholds) - 1)
        result, false = int(self.true_positives[index]), int(self.false_positives[index])
        return Counts(
            true_positives=result,
            false_positives=false,
            true_negatives=self.blanks - false,
            false_negatives=self.targets - result,
        )

    def auc_interval(
        self,
        level: float = LEVEL,
        method: str | None = None,
        *,
        rng: np.random.Generator | None = None,
        draws: int = DRAWS,
        progress: Callable[[int, int], None] | None = None,
    ) -> Interval:
        """Interval of the area under the curve.

        Raises `InputError` when the level is no probability, the method unknown or without a spread here, or ``rng``
        missing.

        Parameters
        ----------
        level
            Confidence, in (0, 1).
        method
            ``"delong"``, which needs many targets, and whose variance vanishes for areas of 0 and 1; ``"newcombe"``
            (2006, method 5), which is valid for few and for areas near 1; ``"bootstrap"``, which needs ``rng``. None is
            DeLong's where both classes have 30 targets or more, and the number of the smaller times the area's distance
            from 0 and from 1 is at least 5; else Newcombe's. The interval's ``method`` names it.
        rng, draws, progress
            For the bootstrap: random generator, number of draws, and a function called with (done, total).
        """
        if method is None:
            method = "delong" if is_normal(self.auc, self.targets, self.blanks) else "newcombe"
        if choice("method", method, METHODS) == "delong":
            return delong_interval(self.scores, self.present, level)
        if method == "newcombe":
            return newcombe_interval(self.auc, self.targets, self.blanks, level)
        if rng is None:
            raise InputError("rng must be given for the bootstrap; got None: give numpy.random.default_rng(seed)")
        return bootstrap_auc(self.scores, self.present, rng=rng, level=level, draws=draws, progress=progress)


def roc(scores: ArrayLike, present: ArrayLike) -> Roc:
    """Curve of a detector.

    Parameters
    ----------
    scores, present
        As for `Roc`, which raises `InputError` for invalid ones.

    Examples
    --------
    >>> curve = roc([0.1, 0.4, 0.35, 0.8], [False, False, True, True])
    >>> curve.auc, curve.auc_interval().method
    (0.75, 'newcombe')
    >>> [f"{end:.2f}" for end in curve.auc_interval()]
    ['0.23', '0.97']
    """
    return Roc(scores=scores, present=present)  # type: ignore[arg-type]  # the value copies and checks them
