"""Results of a device: every target with its truth and the device's first reading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection import Counts, Proportion

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.study._values import DeviceReading, TargetTruth


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetResult:
    """A target with its true values and the first reading of it by one device, if any."""

    code: str
    truth: TargetTruth
    reading: DeviceReading | None

    @property
    def score(self) -> float | None:
        """Score of the reading; None for an unread or undecided target."""
        return None if self.reading is None else self.reading.score


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceResults:
    """All targets of a study, in its order, with the results of one device.

    ``threshold`` is the least score of a target that is called one with an inclusion.
    """

    device: str
    threshold: float
    targets: tuple[TargetResult, ...]

    @property
    def decided(self) -> tuple[TargetResult, ...]:
        """Targets with a score."""
        return tuple(target for target in self.targets if target.score is not None)

    @property
    def undecided(self) -> tuple[TargetResult, ...]:
        """Targets with an undecided reading."""
        return tuple(target for target in self.targets if target.reading is not None and target.score is None)

    @property
    def unread(self) -> tuple[TargetResult, ...]:
        """Targets without a reading."""
        return tuple(target for target in self.targets if target.reading is None)

    @property
    def detected(self) -> tuple[TargetResult, ...]:
        """Targets with a detected inclusion."""
        return tuple(item for item in self.decided if item.truth.has_inclusion and self.calls(item))

    def calls(self, target: TargetResult) -> bool:
        """Whether a decided target was called one with an inclusion."""
        return target.score is not None and target.score >= self.threshold

    @property
    def are_probabilities(self) -> bool:
        """Whether there are scores, and all lie in [0, 1]."""
        scores, _ = self.scores()
        return len(scores) > 0 and bool((scores >= 0).all() and (scores <= 1).all())

    def scores(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Scores and truth of the decided targets."""
        return (
            np.array([target.score for target in self.decided], dtype=float),
            np.array([target.truth.has_inclusion for target in self.decided], dtype=bool),
        )

    @property
    def is_ranked(self) -> bool:
        """Whether every decided target has a rank, which separates rounded scores."""
        return bool(self.decided) and all(item.reading and item.reading.rank is not None for item in self.decided)

    def ranks(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Ranks of the decided targets, or their scores without ranks, and truth."""
        scores, present = self.scores()
        if not self.is_ranked:
            return scores, present
        return np.array([item.reading.rank for item in self.decided if item.reading], dtype=float), present

    def ranks_if_wrong(self) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """As `ranks`, with undecided targets as errors: below, or above, every other."""
        ranks, present = self.ranks()
        lowest, highest = (ranks.min() - 1, ranks.max() + 1) if len(ranks) else (0.0, 1.0)
        missed = np.array([target.truth.has_inclusion for target in self.undecided], dtype=bool)
        return np.concatenate([ranks, np.where(missed, lowest, highest)]), np.concatenate([present, missed])

    def counts(self, *, undecided_wrong: bool = False) -> Counts | None:
        """Decisions at the fixed threshold, counted; None without any."""
        decisions = [(self.calls(target), target.truth.has_inclusion) for target in self.decided]
        if undecided_wrong:
            decisions += [(not target.truth.has_inclusion, target.truth.has_inclusion) for target in self.undecided]
        return Counts.of([called for called, _ in decisions], [true for _, true in decisions]) if decisions else None


def device_results(
    device: str,
    threshold: float,
    readings: Sequence[DeviceReading],
    truths: Mapping[str, TargetTruth],
    codes: Sequence[str],
) -> DeviceResults:
    """Pair the first of the ``readings`` of every target by a device with the truth of its code."""
    first: dict[str, DeviceReading] = {}
    for reading in readings:
        if reading.device == device:
            first.setdefault(reading.code, reading)
    targets = tuple(TargetResult(code=code, truth=truths[code], reading=first.get(code)) for code in codes)
    return DeviceResults(device=device, threshold=threshold, targets=targets)


EDGES_MM = {"diameter_mm": (5.0, 8.0), "depth_mm": (6.0, 8.0)}  # a value at an edge belongs below it, but sizes above


@dataclass(frozen=True, slots=True, kw_only=True)
class Stratum:
    """Inclusions in one range of size or depth, mm."""

    quantity: str  # "diameter_mm" or "depth_mm"
    low: float
    high: float  # infinite without an end
    detected: Proportion | None  # of the decided ones; None without any
    undecided: int


def strata(device_results: DeviceResults) -> tuple[Stratum, ...]:
    """Inclusions by size, then by depth."""
    return tuple(
        _of(device_results, quantity, low, high)
        for quantity, edges in EDGES_MM.items()
        for low, high in zip((0.0, *edges), (*edges, math.inf), strict=True)
    )


def _of(device_results: DeviceResults, quantity: str, low: float, high: float) -> Stratum:
    def inside(value: float) -> bool:
        return low <= value < high if quantity == "diameter_mm" else low < value <= high

    matching = [
        target
        for target in device_results.targets
        if target.truth.has_inclusion and inside(target.truth.values[quantity])
    ]
    decided = [item for item in matching if item.score is not None]
    count = sum(device_results.calls(item) for item in decided)
    return Stratum(
        quantity=quantity,
        low=low,
        high=high,
        detected=Proportion(successes=count, trials=len(decided)) if decided else None,
        undecided=sum(item.reading is not None and item.score is None for item in matching),
    )
