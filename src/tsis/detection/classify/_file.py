"""A classifier as a text file of its training set and settings, fitted again on reading.

The file contains no code. A few stored probabilities reveal a different fit by another version of scikit-learn.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.detection.classify._classes import CLASSES, ClassSplit
from tsis.detection.classify._classifier import (
    MOST_TARGETS,
    Classifier,
    ClassifierSettings,
    TrainingSet,
    train_classifier,
)
from tsis.errors import FileInputError, InputError
from tsis.files import as_path, printable_path, read_object, write_durably
from tsis.model import require_array, require_integer, require_type

if TYPE_CHECKING:
    import os
    from pathlib import Path

    from numpy.typing import NDArray


FORMAT, VERSION = "tsis classifier", 1
LARGEST_BYTES = 2 * 2**20
COMPARED = 8  # targets with stored probabilities
SAME = 1e-6  # largest difference of a probability that rounding explains
KEYS = {"format", "version", "notice", "made_with", "split", "settings", "targets", "probabilities", "sha256"}


def write_classifier(classifier: Classifier, path: str | os.PathLike[str]) -> Path:
    """Write a classifier atomically; `FileInputError` when it cannot be written there.

    Parameters
    ----------
    classifier
        As `tsis.detection.classify.train_classifier` makes it.
    path
        File to write or replace.

    Returns
    -------
    The file.
    """
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
    """Read a classifier's file and fit it again.

    Raises `FileInputError` when the file is of another kind, was changed, or its versions give another fit here.

    Parameters
    ----------
    path
        A file of `write_classifier`, of at most 2 MiB.

    Returns
    -------
    The same classifier; its ``notes`` say so where another version of scikit-learn gives other probabilities.
    """
    path = as_path(path)
    name, content = printable_path(path), read_object(path, most=LARGEST_BYTES)
    _check_form(content, name)
    try:
        classifier = train_classifier(
            _training(content["targets"]), ClassSplit(**content["split"]), ClassifierSettings(**content["settings"])
        )
        selected = require_array("probabilities", content["probabilities"], ndim=2)
    except InputError as error:
        raise FileInputError(f"{name} must hold a classifier; {error}") from error
    except TypeError as error:
        reason = "its split or its settings name something unknown, or are no objects"
        raise FileInputError(f"{name} must hold a classifier; {reason}") from error
    result = _few(classifier)
    if selected.shape != result.shape:
        raise FileInputError(
            f"{name} must hold {result.shape[0]} rows of {CLASSES} probabilities; got shape {selected.shape}"
        )
    difference = float(np.abs(selected - result).max())
    if difference <= SAME:
        return classifier
    created, here = content["made_with"], _versions()
    if created == here:
        raise FileInputError(
            f"{name} must give the probabilities that it holds; they differ by up to {difference:.2g}, though the "
            "same versions made it: train the classifier again"
        )
    versions = ", ".join(
        f"{name} {created[name]} then and {here[name]} now" for name in here if created[name] != here[name]
    )
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
    created = content["made_with"]
    stated = isinstance(created, dict) and set(created) == set(_versions())
    if not stated or not all(
        isinstance(item, str) and len(item) < 40 and item.isprintable() for item in created.values()
    ):
        raise FileInputError(f"{name} must name the versions it was made with; got {created!r:.80}")
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
