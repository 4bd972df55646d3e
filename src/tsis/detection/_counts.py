"""Counts of correct and false decisions, and the rates derived from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection._inputs import booleans, same_length
from tsis.detection._proportions import MOST_TRIALS, Proportion, ProportionDifference, ProportionRatio
from tsis.errors import InputError
from tsis.model import require_integer

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Counts of decisions by truth.

    A rate is a `Proportion` with an interval; `InputError` is raised where the study has no target of its denominator.
    Raises `InputError` when a number is not whole or negative, or all are 0.

    Parameters
    ----------
    true_positives
        Targets with an inclusion, decided present.
    false_positives
        Targets without an inclusion, decided present.
    true_negatives
        Targets without an inclusion, decided absent.
    false_negatives
        Targets with an inclusion, decided absent.

    Examples
    --------
    >>> printed = Counts(true_positives=6, false_negatives=2, true_negatives=7, false_positives=1)
    >>> printed.sensitivity.value, printed.specificity.value
    (0.75, 0.875)
    """

    true_positives: int
    false_positives: int
    true_negatives: int
    false_negatives: int

    def __post_init__(self) -> None:
        for name in ("true_positives", "false_positives", "true_negatives", "false_negatives"):
            object.__setattr__(self, name, require_integer(name, getattr(self, name), 0, MOST_TRIALS // 4))
        if self.targets == 0:
            raise InputError("counts must hold at least one target; got 0 of every kind")

    @classmethod
    def of(cls, decided: ArrayLike, present: ArrayLike) -> Counts:
        """Count decisions; `InputError` when either is empty or not boolean, or their lengths differ.

        Parameters
        ----------
        decided
            Whether an inclusion was decided present in each target, booleans of shape (targets,).
        present
            Whether it was present, likewise.

        Examples
        --------
        >>> Counts.of([True, True, False], [True, False, False])
        Counts(true_positives=1, false_positives=1, true_negatives=1, false_negatives=0)
        """
        message, truth = booleans("decided", decided), booleans("present", present)
        same_length("decided", message, "present", truth)
        return cls(
            true_positives=int(np.count_nonzero(message & truth)),
            false_positives=int(np.count_nonzero(message & ~truth)),
            true_negatives=int(np.count_nonzero(~message & ~truth)),
            false_negatives=int(np.count_nonzero(~message & truth)),
        )

    @property
    def targets(self) -> int:
        """All targets."""
        return self.present + self.absent

    @property
    def present(self) -> int:
        """Targets with an inclusion."""
        return self.true_positives + self.false_negatives

    @property
    def absent(self) -> int:
        """Targets without one."""
        return self.true_negatives + self.false_positives

    @property
    def sensitivity(self) -> Proportion:
        """Fraction of present inclusions decided present: equation (2.2) of the dissertation."""
        return _proportion("sensitivity", self.true_positives, self.present, "target with an inclusion")

    @property
    def specificity(self) -> Proportion:
        """Fraction of targets without inclusion decided absent: equation (2.3) of the dissertation."""
        return _proportion("specificity", self.true_negatives, self.absent, "target without an inclusion")

    @property
    def accuracy(self) -> Proportion:
        """Fraction of correct decisions; it depends on the prevalence."""
        return Proportion(successes=self.true_positives + self.true_negatives, trials=self.targets)

    @property
    def positive_predictive_value(self) -> Proportion:
        """Fraction of inclusions present among those decided present, at the prevalence of this study."""
        message = self.true_positives + self.false_positives
        return _proportion(
            "positive_predictive_value", self.true_positives, message, "target said to hold an inclusion"
        )

    @property
    def negative_predictive_value(self) -> Proportion:
        """Fraction of targets without inclusion among those decided absent, at the prevalence of this study."""
        message = self.true_negatives + self.false_negatives
        return _proportion(
            "negative_predictive_value", self.true_negatives, message, "target said to hold no inclusion"
        )

    @property
    def positive_likelihood_ratio(self) -> ProportionRatio:
        """Factor of a positive decision on the odds of an inclusion: sensitivity / (1 - specificity)."""
        missed = self.specificity.trials - self.specificity.successes
        return ProportionRatio(first=self.sensitivity, second=Proportion(successes=missed, trials=self.absent))

    @property
    def negative_likelihood_ratio(self) -> ProportionRatio:
        """Factor of a negative decision on the odds of an inclusion: (1 - sensitivity) / specificity."""
        missed = self.sensitivity.trials - self.sensitivity.successes
        return ProportionRatio(first=Proportion(successes=missed, trials=self.present), second=self.specificity)

    @property
    def youden(self) -> ProportionDifference:
        """Youden's index, sensitivity + specificity - 1: 1 at best, 0 by chance."""
        false = self.specificity.trials - self.specificity.successes
        return ProportionDifference(first=self.sensitivity, second=Proportion(successes=false, trials=self.absent))


def _proportion(name: str, successes: int, trials: int, requested: str) -> Proportion:
    if trials == 0:
        raise InputError(f"{name} must have at least one {requested} to be a share of; got 0: add such targets")
    return Proportion(successes=successes, trials=trials)
