"""Three classes of targets from the estimates of presses, with probabilities."""

from tsis.detection.classify._classes import ClassSplit
from tsis.detection.classify._classifier import (
    Classified,
    Classifier,
    ClassifierSettings,
    TargetEvidence,
    TrainingSet,
    target_evidence,
    train_classifier,
)
from tsis.detection.classify._file import classifier_sha256, read_classifier, write_classifier
from tsis.detection.classify._validation import Validation, cross_validate

__all__ = [
    "ClassSplit",
    "Classified",
    "Classifier",
    "ClassifierSettings",
    "TargetEvidence",
    "TrainingSet",
    "Validation",
    "classifier_sha256",
    "cross_validate",
    "read_classifier",
    "target_evidence",
    "train_classifier",
    "write_classifier",
]
