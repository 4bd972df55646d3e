"""Three classes of targets from the estimates of presses, with probabilities."""

from typing import TYPE_CHECKING

import lazy_loader

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

if TYPE_CHECKING:
    from tsis.detection.classify._adapter import TargetClassifier

__all__ = [
    "ClassSplit",
    "Classified",
    "Classifier",
    "ClassifierSettings",
    "TargetClassifier",
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

if not TYPE_CHECKING:  # its base class is of scikit-learn
    __getattr__ = lazy_loader.attach(__name__, submod_attrs={"_adapter": ["TargetClassifier"]})[0]
