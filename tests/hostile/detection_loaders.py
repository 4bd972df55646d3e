"""Loaders of classifiers and of tables of reaches, with small files for each."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from tests.hostile.json_changed import changed_document, text_of
from tests.hostile.loader import Loader

from tsis.study.classifier import (
    ClassifierSettings,
    ClassSplit,
    TrainingSet,
    classifier_sha256,
    read_classifier,
    train_classifier,
    write_classifier,
)
from tsis.study.search import read_detection_range

if TYPE_CHECKING:
    from collections.abc import Hashable

REACHES = b"diameter_mm,depth_mm,reach_mm\n4,4,3\n4,8,1\n10,4,6\n10,8,4\n"


def detection_loaders() -> tuple[Loader, ...]:
    """Classifiers as text, and reaches as CSV."""
    return (
        Loader(
            name="classifier",
            file="classes.json",
            originals=(_classifier(),),
            load=_told,
            integrity=True,
            text=True,
            forge=_forged,
        ),
        Loader(name="reaches", file="reach.csv", originals=(REACHES,), load=_reaches, text=True, share=0.5),
    )


@cache
def _classifier() -> bytes:
    rng = np.random.default_rng(1)
    training = TrainingSet(
        features=rng.uniform((1, 4, 40, -5), (15, 12, 120, 5), (12, 4)).round(3), labels=np.arange(12) % 3
    )
    fitted = train_classifier(training, ClassSplit(young_kpa=60.0), ClassifierSettings(folds=2))
    with tempfile.TemporaryDirectory() as place:
        return write_classifier(fitted, Path(place) / "classes.json").read_bytes()


def _told(path: Path) -> Hashable:
    found = read_classifier(path)
    training = found.training
    return found.split, found.settings, training.features.tobytes(), training.labels.tobytes()


def _reaches(path: Path) -> Hashable:
    found = read_detection_range(path)
    return found.diameter_mm.tobytes(), found.depth_mm.tobytes(), found.reach_mm.tobytes()


def _forged(original: bytes, rng: np.random.Generator) -> bytes:
    document = changed_document(original, rng)
    if "sha256" in document:
        with suppress(ValueError):  # numbers that JSON has not have no hash
            document["sha256"] = classifier_sha256({name: one for name, one in document.items() if name != "sha256"})
    return text_of(document, rng)
