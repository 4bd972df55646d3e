"""Three classes of targets from the estimates of presses, with probabilities.

A classifier is trained on targets of known class, cross-validated, and stored as a text file of its training set and
settings, fitted again on reading. The file contains no code. A few stored probabilities reveal a different fit by
another version of scikit-learn.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.errors import FileInputError, InputError, UntrustedError, import_extra
from tsis.files.atomic import write_durably
from tsis.files.reading import as_path, printable_path, read_object
from tsis.inclusion.prior import PARAMETERS
from tsis.model.content import ContentValue
from tsis.model.estimate import LARGEST_EVIDENCE
from tsis.model.phantom import INCLUSION_RANGES, Inclusion
from tsis.model.require import require_array, require_integer, require_number, require_type
from tsis.study.probabilities import presence
from tsis.study.proportions import Proportion, choice

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from tsis.model.estimate import Estimate


NONE, OTHER, TARGET = 0, 1, 2
CLASSES = 3
SIDES = {  # unit, name of the side of the target class, and of the other
    "young_kpa": ("kPa", "stiffer than", "softer than"),
    "diameter_mm": ("mm", "larger than", "smaller than"),
    "depth_mm": ("mm", "shallower than", "deeper than"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassSplit:
    """Limits that separate two kinds of inclusions.

    The third class is stiffer than ``young_kpa``, larger than ``diameter_mm`` and shallower than ``depth_mm``, as far
    as these are given; the second is any other inclusion, and the first is none. Raises `InputError` when no limit is
    given, or one lies outside its range.

    Examples
    --------
    >>> ClassSplit(young_kpa=60).names
    ('none', 'softer than 60 kPa', 'stiffer than 60 kPa')
    >>> ClassSplit(young_kpa=60, diameter_mm=5).names[1:]
    ('not stiffer than 60 kPa and larger than 5 mm', 'stiffer than 60 kPa and larger than 5 mm')
    >>> ClassSplit(young_kpa=60).label(Inclusion(diameter_mm=5, depth_mm=5, young_kpa=100))
    2
    >>> ClassSplit(young_kpa=60).label(None)
    0
    """

    #: young_kpa, diameter_mm, depth_mm: limits, within what an `tsis.Inclusion` may have; None where a
    #: property does not matter
    young_kpa: float | None = None
    diameter_mm: float | None = None
    depth_mm: float | None = None

    def __post_init__(self) -> None:
        for name, limit in self.limits.items():
            object.__setattr__(self, name, require_number(name, limit, *INCLUSION_RANGES[name]))
        if not self.limits:
            raise InputError(f"a split needs at least one of {', '.join(SIDES)}; got none")

    @property
    def limits(self) -> dict[str, float]:
        """The limits that are given, by name."""
        every = {name: getattr(self, name) for name in SIDES}
        return {name: limit for name, limit in every.items() if limit is not None}

    @property
    def names(self) -> tuple[str, str, str]:
        """Names of the three classes, in the order of their labels 0, 1 and 2."""
        target = " and ".join(f"{SIDES[name][1]} {limit:g} {SIDES[name][0]}" for name, limit in self.limits.items())
        if len(self.limits) > 1:
            return "none", f"not {target}", target
        (name, limit), *_ = self.limits.items()
        return "none", f"{SIDES[name][2]} {limit:g} {SIDES[name][0]}", target

    def label(self, inclusion: Inclusion | None) -> int:
        """The true class of a target: 0, 1 or 2; an inclusion on a limit is of class 1."""
        if inclusion is None:
            return NONE
        require_type("inclusion", inclusion, Inclusion)
        above = (
            (limit - value if name == "depth_mm" else value - limit) > 0
            for name, limit in self.limits.items()
            for value in (getattr(inclusion, name),)
        )
        return TARGET if all(above) else OTHER

    def labels(self, truth: Sequence[Inclusion | None]) -> list[int]:
        """The class of each target."""
        return [self.label(item) for item in truth]


EVIDENCE_DRAWS = 64  # samples of a posterior over which a probability is averaged
LARGEST_LOG_RATIO = 15.0  # of the inverse hyperbolic sine of a log likelihood ratio
MOST_TARGETS = 5000  # fitting takes the square of it
LARGEST = 1e6  # mm or kPa


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetEvidence(ContentValue):
    """Estimate of one target as input of a classifier.

    Raises `InputError` when the samples are empty, not positive or of another shape, or the ratio is no number.
    """

    #: diameters in mm, depths in mm and moduli in kPa of the posterior, shape (draws, 3), positive
    samples: NDArray[np.float64]
    log_ratio: float  #: natural logarithm of the likelihood ratio of an inclusion over tissue without inclusion

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


def target_evidence(estimate: Estimate, *, draws: int = EVIDENCE_DRAWS, prior: float | None = None) -> TargetEvidence:
    """Input of a classifier from a result of `tsis.inclusion.estimate`: ``draws`` of its samples, evenly through them.

    ``prior`` is as for `tsis.study.probabilities.presence`. Of tissue without an inclusion the posterior describes
    inclusions that could remain undetected; a classifier uses it all the same. Raises `InputError` when the estimate
    has no probability of an inclusion, or no samples of diameter, depth and modulus, and `UntrustedError` when that
    probability is not to be trusted.
    """
    evidence = presence(estimate, prior=prior)
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
    return TargetEvidence(samples=every[evenly], log_ratio=evidence.log_likelihood_ratio)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainingSet(ContentValue):
    """Targets of known class.

    Raises `InputError` when shapes do not belong together, there are more than 5,000 targets, or a value is out of its
    range.
    """

    #: diameter, depth, modulus and inverse hyperbolic sine of the log likelihood ratio of each, shape (targets, 4)
    features: NDArray[np.float64]
    labels: NDArray[np.int64]  #: classes 0, 1 or 2, shape (targets,)

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
    """

    #: of misclassified targets, in [0.001, 100]: larger values fit the training targets more closely
    penalty: float = 1.0
    #: of the Gaussian kernel, as ``exp(-width * squared distance)`` of standardised features, in [0.001, 100]; None
    #: takes one over the number of features
    width: float | None = None
    calibration: str = "sigmoid"  #: ``"sigmoid"`` (Platt), or ``"isotonic"``, which needs hundreds of targets a class
    folds: int = 5  #: parts by which the probabilities are calibrated, 2 to 20
    seed: int = 0  #: shuffles the parts

    def __post_init__(self) -> None:
        object.__setattr__(self, "penalty", require_number("penalty", self.penalty, 1e-3, 100.0))
        if self.width is not None:
            object.__setattr__(self, "width", require_number("width", self.width, 1e-3, 100.0))
        choice("calibration", self.calibration, CALIBRATIONS)
        object.__setattr__(self, "folds", require_integer("folds", self.folds, 2, 20))
        object.__setattr__(self, "seed", require_integer("seed", self.seed, 0, 2**32 - 1))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Classified:
    """Probabilities of the classes of one target."""

    probabilities: Mapping[str, float]  #: by class name: means over the posterior's samples
    #: those of the posterior's mean, for comparison: overconfident for uncertain estimates
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
    """A fitted classifier; `train_classifier` creates it, and `read_classifier` fits it again from its file."""

    split: ClassSplit  #: the classes
    #: settings, training: settings and targets of the fit
    settings: ClassifierSettings
    training: TrainingSet
    notes: tuple[str, ...] = ()  #: Warnings, e.g. that another version of scikit-learn gives another fit.
    model: Any = field(default=None, repr=False)

    def probabilities(self, features: ArrayLike) -> NDArray[np.float64]:
        """Probability of each class, shape (n, 3), at given features, shape (n, 4), as in `TrainingSet`."""
        probabilities: NDArray[np.float64] = self.model.predict_proba(require_array("features", features, ndim=2))
        return probabilities

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

    The ``split`` is that by which the targets were labelled. Raises `InputError` when a class has fewer than
    ``settings.folds`` targets.
    """
    settings = ClassifierSettings() if settings is None else settings
    require_type("training", training, TrainingSet)
    require_type("split", split, ClassSplit)
    require_type("settings", settings, ClassifierSettings)
    _require_enough(training.labels, split, settings.folds)
    return Classifier(
        split=split,
        settings=settings,
        training=training,
        model=calibrated_machine(settings).fit(training.features, training.labels),
    )


def _require_enough(labels: NDArray[np.int64], split: ClassSplit, least: int) -> None:
    """Refuse labels with fewer than ``least`` of a class."""
    for label, name in enumerate(split.names):
        number = int(np.count_nonzero(labels == label))
        if number < least:
            raise InputError(
                f"the class {name!r} must have at least {least} targets, one a part; got {number}: add targets, or "
                "choose fewer folds or another split"
            )


def calibrated_machine(settings: ClassifierSettings) -> Any:
    """The pipeline of scikit-learn, not fitted; `MissingExtraError` without the extra ``study``."""
    import_extra("sklearn", feature="a classifier", extra="study")
    from sklearn.calibration import CalibratedClassifierCV
    from sklearn.model_selection import StratifiedKFold
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    machine = SVC(C=settings.penalty, gamma="auto" if settings.width is None else settings.width)
    parts = StratifiedKFold(settings.folds, shuffle=True, random_state=settings.seed)
    return CalibratedClassifierCV(make_pipeline(StandardScaler(), machine), method=settings.calibration, cv=parts)


LEAST = 1e-15  # a probability of 0 that came true would cost an infinite loss


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Validation:
    """Cross-validated probabilities of targets, and their true classes."""

    split: ClassSplit  #: the classes
    labels: NDArray[np.int64]  #: true classes, shape (targets,)
    probabilities: NDArray[np.float64]  #: means over each target's posterior, shape (targets, 3)
    at_mean: NDArray[np.float64]  #: those of its posterior's mean, shape (targets, 3)

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


def cross_validate(
    readings: Sequence[TargetEvidence],
    truth: Sequence[Inclusion | None],
    split: ClassSplit,
    settings: ClassifierSettings | None = None,
    *,
    folds: int = 5,
    progress: Callable[[int, int], None] | None = None,
) -> Validation:
    """Classify targets by classifiers that were fitted and calibrated without them, in 2 to 20 stratified ``folds``.

    ``truth`` has the inclusion of each reading's target, None for none. The seed of the settings also shuffles the
    folds; ``progress`` is called with (folds done, folds). Raises `InputError` when the input is bad, or a class has
    too few targets for parts within parts.
    """
    settings = ClassifierSettings() if settings is None else settings
    folds = require_integer("folds", folds, 2, 20)
    training = TrainingSet.of(readings, truth, split)
    _require_enough(training.labels, split, -(-settings.folds * folds // (folds - 1)))  # what is left holds one a part
    import_extra("sklearn", feature="cross-validation", extra="study")
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


FORMAT, VERSION = "tsis classifier", 1
LARGEST_BYTES = 2 * 2**20
COMPARED = 8  # targets with stored probabilities
SAME = 1e-6  # largest difference of a probability that rounding explains
KEYS = {"format", "version", "notice", "made_with", "split", "settings", "targets", "probabilities", "sha256"}


def write_classifier(classifier: Classifier, path: str | os.PathLike[str]) -> Path:
    """Write a classifier atomically and return its path; `FileInputError` when it cannot be written there."""
    require_type("classifier", classifier, Classifier)
    path, training = as_path(path), classifier.training
    content = {
        "format": FORMAT,
        "version": VERSION,
        "notice": RESEARCH_USE_ONLY,
        "made_with": _versions(),
        "split": classifier.split.limits,
        "settings": asdict(classifier.settings),
        "targets": [
            [*features, label]
            for features, label in zip(training.features.tolist(), training.labels.tolist(), strict=True)
        ],
        "probabilities": _few(classifier).tolist(),
    }
    try:
        write_durably(path, _serialised(content | {"sha256": classifier_sha256(content)}))
    except OSError as error:
        raise FileInputError(f"{printable_path(path)} must be writable; got: {error.strerror}") from error
    return path


def read_classifier(path: str | os.PathLike[str]) -> Classifier:
    """Read a file of `write_classifier`, of at most 2 MiB, and fit its classifier again.

    Its ``notes`` say so where another version of scikit-learn gives other probabilities. Raises `FileInputError` when
    the file is of another kind, was changed, or the same versions give another fit here.
    """
    path = as_path(path)
    name, content = printable_path(path), read_object(path, most=LARGEST_BYTES)
    _check_form(content, name)
    try:
        classifier = train_classifier(
            _training(content["targets"]), ClassSplit(**content["split"]), ClassifierSettings(**content["settings"])
        )
        stored = require_array("probabilities", content["probabilities"], ndim=2)
    except InputError as error:
        raise FileInputError(f"{name} must hold a classifier; {error}") from error
    except TypeError as error:
        reason = "its split or its settings name something unknown, or are no objects"
        raise FileInputError(f"{name} must hold a classifier; {reason}") from error
    refitted = _few(classifier)
    if stored.shape != refitted.shape:
        raise FileInputError(
            f"{name} must hold {refitted.shape[0]} rows of {CLASSES} probabilities; got shape {stored.shape}"
        )
    difference = float(np.abs(stored - refitted).max())
    if difference <= SAME:
        return classifier
    then, here = content["made_with"], _versions()
    if then == here:
        raise FileInputError(
            f"{name} must give the probabilities that it holds; they differ by up to {difference:.2g}, though the "
            "same versions made it: train the classifier again"
        )
    versions = ", ".join(f"{name} {then[name]} then and {here[name]} now" for name in here if then[name] != here[name])
    note = f"Refitted, its probabilities differ by up to {difference:.2g} from those of its file: {versions}."
    return replace(classifier, notes=(note,))


def _versions() -> dict[str, str]:
    import scipy
    import sklearn

    return {
        "tsis": __version__,
        "scikit-learn": sklearn.__version__,
        "numpy": np.__version__,
        "scipy": scipy.__version__,
    }


def _few(classifier: Classifier) -> NDArray[np.float64]:
    """Probabilities of a few targets, evenly through the training's."""
    features = classifier.training.features
    positions = np.linspace(0, len(features) - 1, min(COMPARED, len(features))).round().astype(int)
    return classifier.probabilities(features[positions])


def _serialised(content: dict[str, Any]) -> bytes:
    return (json.dumps(content, indent=None, allow_nan=False, separators=(",", ":")) + "\n").encode()


def classifier_sha256(content: dict[str, Any]) -> str:
    """SHA-256 of a file's content without its own hash."""
    return hashlib.sha256(_serialised(content)).hexdigest()


def _check_form(content: dict[str, Any], name: str) -> None:
    kind, version = content.get("format"), content.get("version")
    if kind != FORMAT or version != VERSION:
        raise FileInputError(
            f"{name} must be a {FORMAT!r} of version {VERSION}; got {kind!r:.40} of version {version!r:.20}"
        )
    if set(content) != KEYS:
        other = min(set(content) ^ KEYS)
        raise FileInputError(f"{name} must hold {', '.join(sorted(KEYS))}; {other!r:.40} is missing or unknown")
    versions = content["made_with"]
    stated = isinstance(versions, dict) and set(versions) == set(_versions())
    if not stated or not all(
        isinstance(item, str) and len(item) < 40 and item.isprintable() for item in versions.values()
    ):
        raise FileInputError(f"{name} must name the versions it was made with; got {versions!r:.80}")
    try:
        same = classifier_sha256({key: item for key, item in content.items() if key != "sha256"}) == content["sha256"]
    except (ValueError, RecursionError):  # numbers that are not valid JSON
        same = False
    if not same:
        raise FileInputError(f"{name} must be as it was written; it does not match its own hash: it was changed")


def _training(targets: Any) -> TrainingSet:
    """Targets of the file, checked before they become arrays."""
    rows = isinstance(targets, list) and 0 < len(targets) <= MOST_TARGETS
    if not rows or not all(isinstance(row, list) and len(row) == 5 for row in targets):
        raise InputError(f"targets must be 1 to {MOST_TARGETS} rows of 5 numbers; got something else")
    labels = [require_integer("a target's class", row[-1], 0, CLASSES - 1) for row in targets]
    return TrainingSet(
        features=np.array(require_array("targets", [row[:-1] for row in targets], ndim=2)),
        labels=np.array(labels),
    )
