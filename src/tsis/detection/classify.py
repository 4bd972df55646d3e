"""Three classes of targets by what presses tell of them, with probabilities that carry the estimate's uncertainty.

A support vector machine parts the classes by diameter, depth, modulus and how much better an inclusion explains the
frames than plain tissue does; cross-validated calibration makes probabilities of its answers. The probability of a
class is the mean over samples of the posterior, not that of the posterior's mean: where the modulus is not known, no
class of moduli is certain.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.detection.classify_classes import ClassSplit
from tsis.detection.classify_readings import TargetEvidence, TrainingSet
from tsis.detection.inputs import choice
from tsis.model.check import require_array, require_integer, require_number, require_type
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike, NDArray

CALIBRATIONS = ("sigmoid", "isotonic")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassifierSettings:
    """How a classifier is fitted.

    Parameters
    ----------
    penalty
        Of targets on the wrong side, in [0.001, 100]: larger follows the training targets more closely.
    width
        Of the Gaussian kernel, as ``exp(-width * squared distance)`` of standardised features, in [0.001, 100]; None
        takes one over the number of features.
    calibration
        ``"sigmoid"`` (Platt), or ``"isotonic"``, which needs hundreds of targets a class.
    folds
        Parts by which the probabilities are calibrated, 2 to 20.
    seed
        Shuffles the parts.

    Raises
    ------
    InputError
        When a setting lies outside its range.
    """

    penalty: float = 1.0
    width: float | None = None
    calibration: str = "sigmoid"
    folds: int = 5
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "penalty", require_number("penalty", self.penalty, 1e-3, 100.0))
        if self.width is not None:
            object.__setattr__(self, "width", require_number("width", self.width, 1e-3, 100.0))
        choice("calibration", self.calibration, CALIBRATIONS)
        object.__setattr__(self, "folds", require_integer("folds", self.folds, 2, 20))
        object.__setattr__(self, "seed", require_integer("seed", self.seed, 0, 2**32 - 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Classified:
    """Probabilities of the classes of one target.

    Attributes
    ----------
    probabilities
        By the names of the classes: means over the posterior's samples.
    at_mean
        Those of the posterior's mean, for comparison: too sure where the estimate is not.
    """

    probabilities: Mapping[str, float]
    at_mean: Mapping[str, float]

    @property
    def likeliest(self) -> str:
        """Name of the class of the largest probability."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])

    @property
    def difference(self) -> float:
        """Largest difference, over the classes, of both probabilities: how much the uncertainty matters."""
        return max(abs(self.probabilities[name] - self.at_mean[name]) for name in self.probabilities)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Classifier:
    """A fitted classifier; `train_classifier` makes one, and `read_classifier` fits one again from its file.

    Attributes
    ----------
    split
        The classes.
    settings, training
        How and on what it was fitted.
    notes
        What its reader must know, e.g. that another version of scikit-learn fits it otherwise.
    """

    split: ClassSplit
    settings: ClassifierSettings
    training: TrainingSet
    notes: tuple[str, ...] = ()
    model: Any = field(default=None, repr=False)

    def probabilities(self, features: ArrayLike) -> NDArray[np.float64]:
        """Probability of each class, shape (n, 3), at given features, shape (n, 4), as in `TrainingSet`."""
        told: NDArray[np.float64] = self.model.predict_proba(require_array("features", features, ndim=2))
        return told

    def classify(self, reading: TargetEvidence) -> Classified:
        """Probabilities of the classes of a target.

        Parameters
        ----------
        reading
            As `measured` takes it from an estimate.
        """
        require_type("reading", reading, TargetEvidence)
        mean, single = (self.probabilities(rows).mean(axis=0) for rows in (reading.rows, reading.at_mean[None]))
        names = self.split.names
        return Classified(
            probabilities=dict(zip(names, mean.tolist(), strict=True)),
            at_mean=dict(zip(names, single.tolist(), strict=True)),
        )


def train_classifier(
    training: TrainingSet, split: ClassSplit, settings: ClassifierSettings | None = None
) -> Classifier:
    """Fit a classifier: standardised features, support vectors, probabilities calibrated by cross-validation.

    Parameters
    ----------
    training
        At least ``settings.folds`` targets of each class.
    split
        The classes, by which the targets were labelled.
    settings
        How; `ClassifierSettings` by default.

    Raises
    ------
    InputError
        When a class has too few targets.
    """
    settings = ClassifierSettings() if settings is None else settings
    require_type("training", training, TrainingSet)
    require_type("split", split, ClassSplit)
    require_type("settings", settings, ClassifierSettings)
    enough(training.labels, split, settings.folds)
    return Classifier(split=split, settings=settings, training=training, model=_fitted(training, settings))


def enough(labels: NDArray[np.int64], split: ClassSplit, least: int) -> None:
    """Refuse labels of which a class has fewer than ``least``."""
    for label, name in enumerate(split.names):
        number = int(np.count_nonzero(labels == label))
        if number < least:
            raise InputError(
                f"the class {name!r} must have at least {least} targets, one a part; got {number}: add targets, or "
                "choose fewer folds or another split"
            )


def _fitted(training: TrainingSet, settings: ClassifierSettings) -> Any:
    from sklearn.calibration import CalibratedClassifierCV
    from sklearn.model_selection import StratifiedKFold
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    machine = SVC(C=settings.penalty, gamma="auto" if settings.width is None else settings.width)
    parts = StratifiedKFold(settings.folds, shuffle=True, random_state=settings.seed)
    model = CalibratedClassifierCV(make_pipeline(StandardScaler(), machine), method=settings.calibration, cv=parts)
    return model.fit(training.features, training.labels)


__all__ = ["CALIBRATIONS", "Classified", "Classifier", "ClassifierSettings", "train_classifier"]
