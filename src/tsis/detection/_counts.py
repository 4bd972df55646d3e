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
        positive, truth = booleans("decided", decided), booleans("present", present)
        same_length("decided", positive, "present", truth)
        return cls(
            true_positives=int(np.count_nonzero(positive & truth)),
            false_positives=int(np.count_nonzero(positive & ~truth)),
            true_negatives=int(np.count_nonzero(~positive & ~truth)),
            false_negatives=int(np.count_nonzero(~positive & truth)),
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
        decided = self.true_positives + self.false_positives
        return _proportion("positive_predictive_value", self.true_positives, decided, "target decided present")

    @property
    def negative_predictive_value(self) -> Proportion:
        """Fraction of targets without inclusion among those decided absent, at the prevalence of this study."""
        decided = self.true_negatives + self.false_negatives
        return _proportion("negative_predictive_value", self.true_negatives, decided, "target decided absent")

    @property
    def positive_likelihood_ratio(self) -> ProportionRatio:
        """Factor of a positive decision on the odds of an inclusion: sensitivity / (1 - specificity)."""
        return ProportionRatio(first=self.sensitivity, second=_complement(self.specificity))

    @property
    def negative_likelihood_ratio(self) -> ProportionRatio:
        """Factor of a negative decision on the odds of an inclusion: (1 - sensitivity) / specificity."""
        return ProportionRatio(first=_complement(self.sensitivity), second=self.specificity)

    @property
    def youden(self) -> ProportionDifference:
        """Youden's index, sensitivity + specificity - 1: 1 at best, 0 by chance."""
        return ProportionDifference(first=self.sensitivity, second=_complement(self.specificity))


def _proportion(name: str, successes: int, trials: int, requested: str) -> Proportion:
    if trials == 0:
        raise InputError(f"{name} must have at least one {requested} to be a fraction of; got 0: add such targets")
    return Proportion(successes=successes, trials=trials)


def _complement(proportion: Proportion) -> Proportion:
    return Proportion(successes=proportion.trials - proportion.successes, trials=proportion.trials)
