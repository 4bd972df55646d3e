"""Classifier of targets by the estimates of diameter, depth, modulus and presence."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.detection._inputs import choice
from tsis.detection._presence import presence
from tsis.detection.classify._classes import CLASSES, ClassSplit
from tsis.errors import InputError, UntrustedError, import_extra
from tsis.inclusion import PARAMETERS
from tsis.model import LARGEST_EVIDENCE, ContentValue, require_array, require_integer, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from tsis.model import Estimate, Inclusion


DRAWS = 64  # samples of a posterior over which a probability is averaged
LARGEST_LOG_RATIO = 15.0  # of the inverse hyperbolic sine of a log likelihood ratio
MOST_TARGETS = 5000  # fitting takes the square of it
LARGEST = 1e6  # mm or kPa


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetEvidence(ContentValue):
    """Estimate of one target as input of a classifier.

    Raises `InputError` when the samples are empty, not positive or of another shape, or the ratio is no number.

    Parameters
    ----------
    samples
        Diameters in mm, depths in mm and moduli in kPa of the posterior, shape (draws, 3), positive.
    log_ratio
        Natural logarithm of the likelihood ratio of an inclusion over tissue without inclusion.
    """

    samples: NDArray[np.float64]
    log_ratio: float

    def __post_init__(self) -> None:
        samples = require_array("samples", self.samples, ndim=2)
        if samples.shape[1] != len(PARAMETERS) or samples.min() <= 0 or samples.max() > LARGEST:
            raise InputError(
                f"samples must hold {', '.join(PARAMETERS)} a row, above 0 and at most 1e6; got shape {samples.shape} "
                f"from {samples.min():g} to {samples.max():g}"
            )
        object.__setattr__(self, "samples", samples)
        log_ratio = require_number("log_ratio", self.log_ratio, -LARGEST_EVIDENCE, LARGEST_EVIDENCE)
        object.__setattr__(self, "log_ratio", log_ratio)

    @property
    def log_likelihood_ratio(self) -> float:
        """Inverse hyperbolic sine of the log likelihood ratio: linear for weak, logarithmic for strong evidence."""
        return float(np.arcsinh(self.log_ratio))

    @property
    def at_mean(self) -> NDArray[np.float64]:
        """The posterior's mean and the transformed ratio, shape (4,)."""
        return np.array([*self.samples.mean(axis=0), self.log_likelihood_ratio])

    @property
    def rows(self) -> NDArray[np.float64]:
        """The samples with the transformed ratio, shape (draws, 4)."""
        return np.column_stack([self.samples, np.full(len(self.samples), self.log_likelihood_ratio)])


def target_evidence(estimate: Estimate, *, draws: int = DRAWS, prior: float | None = None) -> TargetEvidence:
    """Input of a classifier from an estimate.

    Raises `InputError` when it has no probability of an inclusion, or no samples of diameter, depth and modulus, and
    `UntrustedError` when that probability is not to be trusted. Of tissue without an inclusion the posterior describes
    inclusions that could remain undetected; a classifier uses it all the same.

    Parameters
    ----------
    estimate
        A result of `tsis.inclusion.estimate`.
    draws
        Number of samples, evenly through its own; all where it has fewer.
    prior
        As for `tsis.detection._presence`.
    """
    result = presence(estimate, prior=prior)
    if not estimate.presence_trusted:
        raise UntrustedError(
            f"estimate must have a presence to be trusted; it is flagged {', '.join(estimate.flags)}: press the target "
            "again"
        )
    draws = require_integer("draws", draws, 1, 10**6)
    missing = [name for name in PARAMETERS if name not in estimate.names]
    if missing:
        raise InputError(f"estimate must hold samples of {', '.join(PARAMETERS)}; it has none of {', '.join(missing)}")
    every = np.column_stack([estimate.untrusted.samples[name] for name in PARAMETERS])
    evenly = np.linspace(0, len(every) - 1, min(draws, len(every))).round().astype(int)
    return TargetEvidence(samples=every[evenly], log_ratio=result.log_likelihood_ratio)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainingSet(ContentValue):
    """Targets of known class.

    Raises `InputError` when shapes do not belong together, there are more than 5,000 targets, or a value is out of its
    range.

    Parameters
    ----------
    features
        Diameter, depth, modulus and inverse hyperbolic sine of the log likelihood ratio of each, shape (targets, 4).
    labels
        Classes 0, 1 or 2, shape (targets,).
    """

    features: NDArray[np.float64]
    labels: NDArray[np.int64]

    def __post_init__(self) -> None:
        features = require_array("features", self.features, ndim=2)
        labels = require_array("labels", self.labels, ndim=1, dtype=int)
        if features.shape != (len(labels), 4) or len(labels) > MOST_TARGETS:
            raise InputError(
                f"features must hold 4 numbers for each of at most {MOST_TARGETS} labels; got shape {features.shape} "
                f"and {len(labels)} labels"
            )
        if features[:, :3].min() <= 0 or features.max() > LARGEST or np.abs(features[:, 3]).max() > LARGEST_LOG_RATIO:
            raise InputError(
                f"features must be positive sizes up to 1e6 and a transformed ratio within ±{LARGEST_LOG_RATIO:g}; "
                "got a row beyond that"
            )
        if not np.isin(labels, range(CLASSES)).all():
            raise InputError(f"labels must be 0, 1 or 2; got {int(labels[~np.isin(labels, range(CLASSES))][0])}")
        object.__setattr__(self, "features", features)
        object.__setattr__(self, "labels", labels)

    @classmethod
    def of(
        cls, readings: Sequence[TargetEvidence], truth: Sequence[Inclusion | None], split: ClassSplit
    ) -> TrainingSet:
        """Training set from readings and truth, one of each per target."""
        require_type("split", split, ClassSplit)
        if len(readings) != len(truth) or not readings:
            raise InputError(
                f"readings and truth must be equally many, one a target; got {len(readings)} and {len(truth)}"
            )
        return cls(
            features=np.array([reading.at_mean for reading in readings]),
            labels=np.array(split.labels(truth), dtype=int),
        )


CALIBRATIONS = ("sigmoid", "isotonic")


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassifierSettings:
    """How a classifier is fitted.

    Raises `InputError` when a setting lies outside its range.

    Parameters
    ----------
    penalty
        Of misclassified targets, in [0.001, 100]: larger values fit the training targets more closely.
    width
        Of the Gaussian kernel, as ``exp(-width * squared distance)`` of standardised features, in [0.001, 100]; None
        takes one over the number of features.
    calibration
        ``"sigmoid"`` (Platt), or ``"isotonic"``, which needs hundreds of targets a class.
    folds
        Parts by which the probabilities are calibrated, 2 to 20.
    seed
        Shuffles the parts.
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
        By class name: means over the posterior's samples.
    at_mean
        Those of the posterior's mean, for comparison: overconfident for uncertain estimates.
    """

    probabilities: Mapping[str, float]
    at_mean: Mapping[str, float]

    @property
    def likeliest(self) -> str:
        """Name of the class of the largest probability."""
        return max(self.probabilities, key=lambda name: self.probabilities[name])

    @property
    def difference(self) -> float:
        """Largest difference of both probabilities over the classes: effect of the uncertainty."""
        return max(abs(self.probabilities[name] - self.at_mean[name]) for name in self.probabilities)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Classifier:
    """A fitted classifier; `train_classifier` creates it, and `read_classifier` fits it again from its file.

    Attributes
    ----------
    split
        The classes.
    settings, training
        Settings and targets of the fit.
    notes
        Warnings, e.g. that another version of scikit-learn gives another fit.
    """

    split: ClassSplit
    settings: ClassifierSettings
    training: TrainingSet
    notes: tuple[str, ...] = ()
    model: Any = field(default=None, repr=False)

    def probabilities(self, features: ArrayLike) -> NDArray[np.float64]:
        """Probability of each class, shape (n, 3), at given features, shape (n, 4), as in `TrainingSet`."""
        reported: NDArray[np.float64] = self.model.predict_proba(require_array("features", features, ndim=2))
        return reported

    def classify(self, reading: TargetEvidence) -> Classified:
        """Probabilities of the classes of a target."""
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

    Raises `InputError` when a class has too few targets.

    Parameters
    ----------
    training
        At least ``settings.folds`` targets of each class.
    split
        The classes, by which the targets were labelled.
    settings
        How; `ClassifierSettings` by default.
    """
    settings = ClassifierSettings() if settings is None else settings
    require_type("training", training, TrainingSet)
    require_type("split", split, ClassSplit)
    require_type("settings", settings, ClassifierSettings)
    enough(training.labels, split, settings.folds)
    return Classifier(split=split, settings=settings, training=training, model=_fitted(training, settings))


def enough(labels: NDArray[np.int64], split: ClassSplit, least: int) -> None:
    """Refuse labels with fewer than ``least`` of a class."""
    for label, name in enumerate(split.names):
        number = int(np.count_nonzero(labels == label))
        if number < least:
            raise InputError(
                f"the class {name!r} must have at least {least} targets, one a part; got {number}: add targets, or "
                "choose fewer folds or another split"
            )


def _fitted(training: TrainingSet, settings: ClassifierSettings) -> Any:
    return calibrated_machine(settings).fit(training.features, training.labels)


def calibrated_machine(settings: ClassifierSettings) -> Any:
    """The pipeline of scikit-learn, not fitted; `MissingExtraError` without the extra ``classify``."""
    import_extra("sklearn", feature="a classifier", extra="classify")
    from sklearn.calibration import CalibratedClassifierCV
    from sklearn.model_selection import StratifiedKFold
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    machine = SVC(C=settings.penalty, gamma="auto" if settings.width is None else settings.width)
    parts = StratifiedKFold(settings.folds, shuffle=True, random_state=settings.seed)
    return CalibratedClassifierCV(make_pipeline(StandardScaler(), machine), method=settings.calibration, cv=parts)
