"""What a classifier learns from: diameter, depth and modulus as presses told them, and how likely there is any."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection.classify_classes import CLASSES, ClassSplit
from tsis.detection.presence import presence
from tsis.inclusion import PARAMETERS
from tsis.model.check import require_array, require_integer, require_number, require_type
from tsis.model.errors import InputError
from tsis.model.estimate import LARGEST_EVIDENCE

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.model import Estimate, Inclusion

DRAWS = 64  # samples of a posterior over which a probability is averaged
LARGEST_TOLD = 15.0  # of the inverse hyperbolic sine of a log likelihood ratio
MOST_TARGETS = 5000  # fitting takes the square of it
LARGEST = 1e6  # mm or kPa


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TargetEvidence:
    """What presses told of one target.

    Parameters
    ----------
    samples
        Diameters in mm, depths in mm and moduli in kPa of the posterior, shape (draws, 3), positive.
    log_ratio
        Natural logarithm of how much better an inclusion explains the frames than plain tissue does.

    Raises
    ------
    InputError
        When the samples are empty, not positive or of another shape, or the ratio is no number.
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
    def told(self) -> float:
        """Inverse hyperbolic sine of the log likelihood ratio: weak evidence as it is, strong by its order."""
        return float(np.arcsinh(self.log_ratio))

    @property
    def at_mean(self) -> NDArray[np.float64]:
        """The posterior's mean and what is told of the ratio, shape (4,)."""
        return np.array([*self.samples.mean(axis=0), self.told])

    @property
    def rows(self) -> NDArray[np.float64]:
        """Each sample with the same, shape (draws, 4)."""
        return np.column_stack([self.samples, np.full(len(self.samples), self.told)])


def target_evidence(estimate: Estimate, *, draws: int = DRAWS, prior: float | None = None) -> TargetEvidence:
    """Take from an estimate what a classifier needs.

    Parameters
    ----------
    estimate
        As `tsis.inclusion.estimate` makes it.
    draws
        How many samples are kept, evenly through its own; all where it has fewer.
    prior
        As for `tsis.detection.presence`.

    Raises
    ------
    InputError
        When it has no probability of an inclusion, or no samples of diameter, depth and modulus.
    """
    found = presence(estimate, prior=prior)
    draws = require_integer("draws", draws, 1, 10**6)
    missing = [name for name in PARAMETERS if name not in estimate.samples]
    if missing:
        raise InputError(f"estimate must hold samples of {', '.join(PARAMETERS)}; it has none of {', '.join(missing)}")
    every = np.column_stack([estimate.samples[name] for name in PARAMETERS])
    evenly = np.linspace(0, len(every) - 1, min(draws, len(every))).round().astype(int)
    return TargetEvidence(samples=every[evenly], log_ratio=found.log_likelihood_ratio)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrainingSet:
    """Targets whose class is known.

    Parameters
    ----------
    features
        Diameter, depth, modulus and inverse hyperbolic sine of the log likelihood ratio of each, shape (targets, 4).
    labels
        Classes 0, 1 or 2, shape (targets,).

    Raises
    ------
    InputError
        When shapes do not belong together, there are more than 5,000 targets, or a value is out of its range.
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
        if features[:, :3].min() <= 0 or features.max() > LARGEST or np.abs(features[:, 3]).max() > LARGEST_TOLD:
            raise InputError(
                "features must be positive sizes up to 1e6 and what is told of a ratio within "
                f"±{LARGEST_TOLD:g}; got a row beyond that"
            )
        if not np.isin(labels, range(CLASSES)).all():
            raise InputError(f"labels must be 0, 1 or 2; got {int(labels[~np.isin(labels, range(CLASSES))][0])}")
        object.__setattr__(self, "features", features)
        object.__setattr__(self, "labels", labels)

    @classmethod
    def of(
        cls, readings: Sequence[TargetEvidence], truth: Sequence[Inclusion | None], split: ClassSplit
    ) -> TrainingSet:
        """From readings and what was there, one of each a target."""
        require_type("split", split, ClassSplit)
        if len(readings) != len(truth) or not readings:
            raise InputError(
                f"readings and truth must be equally many, one a target; got {len(readings)} and {len(truth)}"
            )
        return cls(
            features=np.array([one.at_mean for one in readings]), labels=np.array(split.labels(truth), dtype=int)
        )


__all__ = ["TargetEvidence", "TrainingSet", "target_evidence"]
