"""Repeatability, reproducibility, agreement and linearity of what a study's devices read of inclusions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection import Counts, Proportion, bland_altman, linearity, repeatability, reproducibility
from tsis.errors import InputError, RecordsError
from tsis.study._folder import read_seal
from tsis.study._values import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.detection import BlandAltman, Linearity, Repeatability, Reproducibility
    from tsis.study._folder import Study
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


LEAST_COMPLETE = 3  # targets, below which nothing is computed
OPERATORS, PROBES = "operators", "probes"


@dataclass(frozen=True, slots=True, kw_only=True)
class Precision:
    """Precision of one quantity, in its unit, on the inclusions that were read completely.

    A reading is complete where the device measured the quantity; a target, where every operator has all repeats of it.

    Attributes
    ----------
    quantity
        Diameter, depth or modulus by its name.
    device
        Whose readings; both names where two devices are compared.
    over
        What differs between conditions: `OPERATORS`, or `PROBES` with one operator.
    conditions
        Names of the operators, or of the devices.
    complete, incomplete
        Codes of the targets used, and of those that lack a reading of this quantity.
    repeats
        Readings of each target in each condition.
    within
        Repeatability, pooled over targets and conditions.
    between
        Reproducibility over the conditions; None with a single one.
    limits
        Limits of agreement of the first readings, by pairs of conditions, first minus second.
    errors
        Target means less the true values; their bias is that of the readings.
    line
        Line of the target means over the true values; None where these are too few or too equal.
    """

    quantity: str
    device: str
    over: str
    conditions: tuple[str, ...]
    complete: tuple[str, ...]
    incomplete: tuple[str, ...]
    repeats: int
    within: Repeatability
    between: Reproducibility | None
    limits: Mapping[tuple[str, str], BlandAltman]
    errors: BlandAltman
    line: Linearity | None

    @property
    def relative_bias(self) -> float:
        """Mean of the error over the true value."""
        true = self.errors.means - self.errors.differences / 2
        return float((self.errors.differences / true).mean())


@dataclass(frozen=True, slots=True, kw_only=True)
class PrecisionAnalysis:
    """Precision of all quantities of a study; ``missing`` says by device and quantity why one is not there."""

    study: Study
    results: tuple[Precision, ...]
    missing: Mapping[tuple[str, str], str]


def analyse_precision(study: Study) -> PrecisionAnalysis:
    """Analyse the repeats, operators and devices of an unblinded study on its inclusions.

    Every device is a probe. Devices are compared on the readings of the operator who read most with all of them.

    Raises
    ------
    RecordsError
        When the study is blind, or asks for one reading of each target.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before its repeatability is analysed; run tsis study analyse")
    if study.plan.repeats < 2:
        raise RecordsError(
            "a study of repeatability must ask for at least 2 repeats; this one asks for 1: make one with "
            "tsis study new --repeats 3"
        )
    truths = read_seal(study)[0].truths
    true = {code: truth.values for code, truth in truths.items() if truth.has_inclusion}
    results, missing = list[Precision](), dict[tuple[str, str], str]()
    for quantity in QUANTITIES:
        expected = {code: values[quantity] for code, values in true.items()}
        tables = {device: _table(study.readings, device, quantity) for device in study.devices}
        for device, table in tables.items():
            _add(results, missing, study.plan.repeats, quantity, device, OPERATORS, table, expected)
        if len(tables) > 1 and (operator := _shared_operator(tables, expected)):
            probes = {device: table[operator] for device, table in tables.items()}
            name = f"{' and '.join(tables)}, operator {operator}"
            _add(results, missing, study.plan.repeats, quantity, name, PROBES, probes, expected)
    return PrecisionAnalysis(study=study, results=tuple(results), missing=missing)


Values = dict[str, list[float]]  # of each code, in the order of the repeats


def _table(readings: Sequence[DeviceReading], device: str, quantity: str) -> dict[str, Values]:
    """Values of a device by operator and code."""
    table: dict[str, Values] = {}
    for reading in readings:
        if reading.device == device:
            row = table.setdefault(reading.operator, {}).setdefault(reading.code, [])
            if reading.score is not None and quantity in reading.values:
                row.append(reading.values[quantity])
    return table


def _shared_operator(tables: Mapping[str, Mapping[str, Values]], expected: Mapping[str, float]) -> str | None:
    """The operator with most readings of inclusions among those who used every device."""
    names = set.intersection(*(set(table) for table in tables.values()))
    counts = {name: sum(len(t[name].get(code, ())) for t in tables.values() for code in expected) for name in names}
    return max(sorted(counts), key=counts.__getitem__, default=None)


def _add(
    results: list[Precision],
    missing: dict[tuple[str, str], str],
    repeats: int,
    quantity: str,
    device: str,
    over: str,
    table: Mapping[str, Values],
    expected: Mapping[str, float],
) -> None:
    complete = [code for code in expected if all(len(rows.get(code, ())) >= repeats for rows in table.values())]
    if len(complete) < LEAST_COMPLETE:
        missing[device, quantity] = (
            f"{len(complete)} of {len(expected)} inclusions were read completely; at least {LEAST_COMPLETE} are needed"
        )
        return
    cube = np.array([[rows[code][:repeats] for rows in table.values()] for code in complete])
    means, true = cube.mean(axis=(1, 2)), [expected[code] for code in complete]
    try:
        line = linearity(means, true)
    except InputError:
        line = None
    results.append(
        Precision(
            quantity=quantity,
            device=device,
            over=over,
            conditions=tuple(table),
            complete=tuple(complete),
            incomplete=tuple(code for code in expected if code not in complete),
            repeats=repeats,
            within=repeatability(list(cube.reshape(-1, repeats))),
            between=reproducibility(cube) if len(table) > 1 else None,
            limits=_limits(cube, tuple(table)),
            errors=bland_altman(means, true),
            line=line,
        )
    )


def _limits(cube: NDArray[np.float64], conditions: tuple[str, ...]) -> dict[tuple[str, str], BlandAltman]:
    """Limits of agreement of the first readings of each pair of conditions."""
    return {
        (conditions[first], conditions[second]): bland_altman(cube[:, first, 0], cube[:, second, 0])
        for first, second in combinations(range(len(conditions)), 2)
    }
