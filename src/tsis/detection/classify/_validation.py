"""Cross-validation of a classifier."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection._proportions import Proportion
from tsis.detection.classify._classes import CLASSES, ClassSplit
from tsis.detection.classify._classifier import (
    ClassifierSettings,
    TargetEvidence,
    TrainingSet,
    enough,
    train_classifier,
)
from tsis.errors import InputError, import_extra
from tsis.model import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from tsis.model import Inclusion


LEAST = 1e-15  # a probability of 0 that came true would cost an infinite loss


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Validation:
    """Cross-validated probabilities of targets, and their true classes.

    Attributes
    ----------
    split
        The classes.
    labels
        True classes, shape (targets,).
    probabilities
        Means over each target's posterior, shape (targets, 3).
    at_mean
        Those of its posterior's mean, shape (targets, 3).
    """

    split: ClassSplit
    labels: NDArray[np.int64]
    probabilities: NDArray[np.float64]
    at_mean: NDArray[np.float64]

    @property
    def decided(self) -> NDArray[np.int64]:
        """The likeliest class of each target, shape (targets,)."""
        return np.asarray(self.probabilities.argmax(axis=1))

    @property
    def confusion(self) -> NDArray[np.int64]:
        """Number of targets by true class (rows) and decided class (columns), shape (3, 3)."""
        table = np.zeros((CLASSES, CLASSES), dtype=np.int64)
        np.add.at(table, (self.labels, self.decided), 1)
        return table

    def proportion(self, truth: int, decided: int) -> Proportion:
        """Proportion of targets of class ``truth`` decided as ``decided``; its ``interval()`` is Wilson's."""
        row = self.confusion[require_integer("truth", truth, 0, CLASSES - 1)]
        decided = require_integer("decided", decided, 0, CLASSES - 1)
        return Proportion(successes=int(row[decided]), trials=int(row.sum()))

    @property
    def accuracy(self) -> Proportion:
        """Fraction of correct decisions; it depends on the frequencies of the classes."""
        right = int(np.count_nonzero(self.decided == self.labels))
        return Proportion(successes=right, trials=len(self.labels))

    @property
    def log_loss(self) -> float:
        """Mean negative log of the probability of the true class, at least 1e-15."""
        likelihood = self.probabilities[np.arange(len(self.labels)), self.labels]
        return float(-np.log(np.maximum(likelihood, LEAST)).mean())

    @property
    def brier(self) -> float:
        """Mean over targets of the sum over classes of probability less truth, squared: 0 at best, 2 at worst."""
        return float(((self.probabilities - np.eye(CLASSES)[self.labels]) ** 2).sum(axis=1).mean())

    @property
    def differences(self) -> NDArray[np.float64]:
        """Largest difference of both probabilities over the classes, shape (targets,)."""
        return np.asarray(np.abs(self.probabilities - self.at_mean).max(axis=1))


def cross_validate(
    readings: Sequence[TargetEvidence],
    truth: Sequence[Inclusion | None],
    split: ClassSplit,
    settings: ClassifierSettings | None = None,
    *,
    folds: int = 5,
    progress: Callable[[int, int], None] | None = None,
) -> Validation:
    """Classify the targets by classifiers that were fitted, and calibrated, without them.

    Raises `InputError` when the input is bad, or a class has too few targets for parts within parts.

    Parameters
    ----------
    readings
        Estimates of the targets.
    truth
        True inclusions, None for none; as many.
    split
        The classes.
    settings
        Settings of the classifiers; the seed also shuffles the folds.
    folds
        Number of stratified folds, 2 to 20.
    progress
        Called with (folds done, folds).
    """
    settings = ClassifierSettings() if settings is None else settings
    folds = require_integer("folds", folds, 2, 20)
    training = TrainingSet.of(readings, truth, split)
    enough(training.labels, split, -(-settings.folds * folds // (folds - 1)))  # what is left holds one a part
    import_extra("sklearn", feature="cross-validation", extra="classify")
    from sklearn.model_selection import StratifiedKFold

    parts = StratifiedKFold(folds, shuffle=True, random_state=settings.seed)
    mean, single = np.empty((2, len(readings), CLASSES))
    for done, (part, out) in enumerate(parts.split(training.features, training.labels)):
        fitted = train_classifier(
            TrainingSet(features=training.features[part], labels=training.labels[part]), split, settings
        )
        single[out] = fitted.probabilities(training.features[out])
        rows = [readings[index].rows for index in out]
        ends = np.cumsum([len(row) for row in rows])[:-1]
        mean[out] = [part.mean(axis=0) for part in np.split(fitted.probabilities(np.concatenate(rows)), ends)]
        if progress is not None:
            progress(done + 1, folds)
    if not np.isfinite(mean).all():
        raise InputError("readings must give finite probabilities; got some that are not: check their samples")
    return Validation(split=split, labels=training.labels, probabilities=mean, at_mean=single)
