"""Analysis of one device: detection, scores as probabilities, and errors of diameter, depth and modulus."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from tsis.detection import (
    Proportion,
    at_sensitivity,
    at_specificity,
    bland_altman,
    brier_interval,
    held_out_counts,
    recalibration,
    reliability_curve,
    roc,
    youden_point,
)
from tsis.errors import InputError
from tsis.study._values import QUANTITIES
from tsis.study.analysis._agreement import agreements
from tsis.study.analysis._precision import strata

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.detection import Counts, Interval, OperatingPoint, Recalibration, ReliabilityCurve, Roc
    from tsis.study._values import DeviceReading
    from tsis.study.analysis._agreement import Agreement
    from tsis.study.analysis._precision import DeviceResults, Stratum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SizeErrors:
    """Readings of one quantity with their true values.

    Attributes
    ----------
    quantity
        Its name.
    codes
        Of the targets.
    read, true
        Shape (targets,), in the unit of the quantity.
    covered
        Fraction of the device's 90 % intervals that contain the truth; None without intervals.
    not_identified
        Number of readings whose data added hardly anything to the prior.
    """

    quantity: str
    codes: tuple[str, ...]
    read: NDArray[np.float64]
    true: NDArray[np.float64]
    covered: Proportion | None
    not_identified: int

    @property
    def bias(self) -> float:
        """Mean of read minus true."""
        return float((self.read - self.true).mean())

    @property
    def bias_interval(self) -> Interval | None:
        """Student's interval of the bias; None for one target, or where all errors are equal."""
        try:
            return bland_altman(self.read, self.true).bias_interval()
        except InputError:
            return None

    @property
    def rmse(self) -> float:
        """Root of the mean square of read minus true, the source's (6.15)."""
        return float(np.sqrt(np.mean((self.read - self.true) ** 2)))

    @property
    def largest(self) -> float:
        """Largest absolute error."""
        return float(np.abs(self.read - self.true).max())


def size_errors(device_results: DeviceResults) -> tuple[SizeErrors, ...]:
    """Errors of every quantity on the inclusions that the device detected."""
    return tuple(errors for quantity in QUANTITIES if (errors := _of(device_results, quantity)) is not None)


def _of(device_results: DeviceResults, quantity: str) -> SizeErrors | None:
    detected = [(item, item.reading) for item in device_results.detected if item.reading]
    pairs = [(item, reading) for item, reading in detected if quantity in reading.values]
    if not pairs:
        return None
    inside = [
        reading.interval_90[quantity][0] <= target.truth.values[quantity] <= reading.interval_90[quantity][1]
        for target, reading in detected
        if quantity in reading.interval_90
    ]
    return SizeErrors(
        quantity=quantity,
        codes=tuple(target.code for target, _ in pairs),
        read=np.array([reading.values[quantity] for _, reading in pairs]),
        true=np.array([target.truth.values[quantity] for target, _ in pairs]),
        covered=Proportion(successes=sum(inside), trials=len(inside)) if inside else None,
        not_identified=sum(f"{quantity}_not_identified" in reading.flags for _, reading in detected),
    )


FEW = 5  # of a class: below, a study is inconclusive
TARGET_RATE = 0.9  # sensitivity, and specificity, of the operating points
BINS, MANY = 5, 100  # bins of the reliability curve, twice as many from this number of targets on

Value = TypeVar("Value")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeviceAnalysis:
    """Analysis of one device; for a value of None ``missing`` gives the reason.

    Attributes
    ----------
    results
        Its targets.
    readings, undecided_readings
        Number of its readings, and of the undecided ones.
    counts
        At the fixed threshold, without undecided targets.
    counts_if_wrong
        With undecided targets as errors.
    curve, auc_interval
        Of the decided targets by `DeviceResults.ranks`; thresholds are in the unit of the ranks.
    auc_if_wrong
        Area with undecided targets as errors.
    points
        Operating points, selected on the same targets and therefore optimistic.
    held_out
        Counts at thresholds of the largest Youden index, each selected without the target that it decides.
    reliability, brier_interval, recalibration
        Of scores as probabilities, where all lie in [0, 1].
    errors
        Of size, depth and modulus of detected inclusions.
    strata
        Detected inclusions by size and by depth.
    agreements
        Of repeats and operators.
    missing
        Reason of each missing value, by its name.
    """

    results: DeviceResults
    readings: int
    undecided_readings: int
    counts: Counts | None
    counts_if_wrong: Counts | None
    curve: Roc | None
    auc_interval: Interval | None
    auc_if_wrong: float | None
    points: tuple[OperatingPoint, ...]
    held_out: Counts | None
    reliability: ReliabilityCurve | None
    brier_interval: Interval | None
    recalibration: Recalibration | None
    errors: tuple[SizeErrors, ...]
    strata: tuple[Stratum, ...]
    agreements: tuple[Agreement, ...]
    missing: Mapping[str, str] = field(default_factory=dict)

    @property
    def few(self) -> bool:
        """Whether a class has too few decided targets for a conclusion."""
        present = sum(target.truth.has_inclusion for target in self.results.decided)
        return min(present, len(self.results.decided) - present) < FEW


def device_analysis(
    device_results: DeviceResults, readings: Sequence[DeviceReading], rng: np.random.Generator
) -> DeviceAnalysis:
    """Analyse one device; ``readings`` are those of all devices, ``rng`` serves the bootstrap."""
    missing: dict[str, str] = {}
    scores, present = device_results.scores()
    ranks, _ = device_results.ranks()
    inside, outside = int(present.sum()), int((~present).sum())
    curve, reliability, brier, recalibrated = None, None, None, None
    points: tuple[OperatingPoint, ...] = ()
    if inside and outside:
        curve = _or_missing("curve", missing, lambda: roc(ranks, present))
    else:
        missing["curve"] = (
            f"it needs targets of both kinds; {inside} with an inclusion and {outside} without were decided"
        )
    if curve is not None:
        points = (youden_point(curve), at_sensitivity(curve, TARGET_RATE), at_specificity(curve, TARGET_RATE))
    if device_results.are_probabilities:
        bins = BINS * (2 if len(scores) >= MANY else 1)
        reliability = _or_missing("reliability", missing, lambda: reliability_curve(scores, present, bins=bins))
        brier = _or_missing("brier_interval", missing, lambda: brier_interval(scores, present, rng=rng))
        recalibrated = _or_missing("recalibration", missing, lambda: recalibration(scores, present))
    else:
        missing["reliability"] = (
            "scores must lie in [0, 1] to be taken for probabilities" if len(scores) else "no target was decided"
        )
    own = [reading for reading in readings if reading.device == device_results.device]
    return DeviceAnalysis(
        results=device_results,
        readings=len(own),
        undecided_readings=sum(reading.undecided for reading in own),
        counts=device_results.counts(),
        counts_if_wrong=device_results.counts(undecided_wrong=True),
        curve=curve,
        auc_interval=None if curve is None else _or_missing("auc_interval", missing, curve.auc_interval),
        auc_if_wrong=_or_missing("auc_if_wrong", missing, lambda: roc(*device_results.ranks_if_wrong()).auc),
        points=points,
        held_out=_or_missing("held_out", missing, lambda: held_out_counts(ranks, present, youden_point)),
        reliability=reliability,
        brier_interval=brier,
        recalibration=recalibrated,
        errors=size_errors(device_results),
        strata=strata(device_results),
        agreements=agreements(device_results, readings),
        missing=missing,
    )


def _or_missing(name: str, missing: dict[str, str], of: Callable[[], Value]) -> Value | None:
    try:
        return of()
    except InputError as error:
        missing[name] = str(error)
        return None
