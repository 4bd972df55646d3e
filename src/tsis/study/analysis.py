"""The analysis of an unblinded study: readings against the truth, for each device, and devices against the first."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import numpy as np

from tsis.errors import InputError, RecordsError, import_extra
from tsis.study.agreement import bland_altman, intraclass_correlation
from tsis.study.folder import open_study, read_seal, unblind, verify_study
from tsis.study.plan import QUANTITIES, first_readings, require_short_name
from tsis.study.precision import repeatability, reproducibility
from tsis.study.probabilities import brier_interval, recalibration, reliability_curve
from tsis.study.proportions import Counts, Proportion
from tsis.study.readings import quantity_columns
from tsis.study.roc import (
    Roc,
    at_sensitivity,
    at_specificity,
    bootstrap_compare_detectors,
    compare_detectors,
    held_out_counts,
    youden_point,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from tsis.study.agreement import BlandAltman
    from tsis.study.folder import Study, StudyVerification
    from tsis.study.plan import DeviceReading, TargetTruth
    from tsis.study.probabilities import Recalibration, ReliabilityCurve
    from tsis.study.proportions import Interval
    from tsis.study.roc import Comparison, OperatingPoint


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

    @classmethod
    def of(
        cls,
        device: str,
        threshold: float,
        readings: Sequence[DeviceReading],
        truths: Mapping[str, TargetTruth],
        codes: Sequence[str],
    ) -> DeviceResults:
        """Pair the first of the ``readings`` of every target by a device with the truth of its code.

        That is the lowest repeat of the operator who began with the device, or of the next who read the target.
        """
        own = [reading for reading in readings if reading.device == device]
        began = {name: place for place, name in enumerate(dict.fromkeys(reading.operator for reading in own))}
        first: dict[str, DeviceReading] = {}
        for reading in sorted(first_readings(own), key=lambda reading: began[reading.operator]):
            first.setdefault(reading.code, reading)
        targets = tuple(TargetResult(code=code, truth=truths[code], reading=first.get(code)) for code in codes)
        return cls(device=device, threshold=threshold, targets=targets)

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
        _stratum(device_results, quantity, low, high)
        for quantity, edges in EDGES_MM.items()
        for low, high in zip((0.0, *edges), (*edges, math.inf), strict=True)
    )


def _stratum(device_results: DeviceResults, quantity: str, low: float, high: float) -> Stratum:
    def inside(value: float) -> bool:
        return low <= value < high if quantity == "diameter_mm" else low < value <= high

    inclusions = [
        target
        for target in device_results.targets
        if target.truth.has_inclusion and inside(target.truth.values[quantity])
    ]
    decided = [item for item in inclusions if item.score is not None]
    count = sum(device_results.calls(item) for item in decided)
    return Stratum(
        quantity=quantity,
        low=low,
        high=high,
        detected=Proportion(successes=count, trials=len(decided)) if decided else None,
        undecided=sum(item.reading is not None and item.score is None for item in inclusions),
    )


SCORE = "score"
LEAST_TARGETS = 3  # below, an agreement says nothing
WITHIN, BETWEEN = "within an operator", "between operators"


@dataclass(frozen=True, slots=True, kw_only=True)
class AgreementValue:
    """A number with its interval, or a remark why one is missing."""

    value: float | None
    interval: Interval | None
    remark: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Agreement of repeated readings of one quantity, ``"score"`` or one of an inclusion.

    ``between`` is `WITHIN` an operator or `BETWEEN` operators. ``targets`` counts those that all operators read
    ``repeats`` times with a result. ``form`` of the intraclass correlation is ``"ICC(1,1)"`` of repeats, ``"ICC(2,1)"``
    of operators. ``coefficient`` is the difference that two readings of a target stay below with a probability of 95 %,
    in the quantity's unit.
    """

    quantity: str
    between: str
    targets: int
    operators: int
    repeats: int
    form: str
    correlation: AgreementValue
    coefficient: AgreementValue


def agreements(device_results: DeviceResults, readings: Sequence[DeviceReading]) -> tuple[Agreement, ...]:
    """Agreement of repeats, by the operator with most readings, and of operators, if any.

    Sizes, depths and moduli are compared on inclusions alone.
    """
    own = [reading for reading in readings if reading.device == device_results.device]
    own.sort(key=lambda reading: reading.repeat)
    inside = {target.code for target in device_results.targets if target.truth.has_inclusion}
    tables = {name: _table(own, name, None if name == SCORE else inside) for name in (SCORE, *QUANTITIES)}
    found = (of(name, table) for name, table in tables.items() for of in (_within, _between))
    return tuple(item for item in found if item is not None)


Table = dict[str, dict[str, list[float]]]  # values by operator and code


def _table(readings: Sequence[DeviceReading], quantity: str, codes: set[str] | None) -> Table:
    table: Table = {}
    for reading in readings:
        value = reading.score if quantity == SCORE else reading.values.get(quantity)
        if value is not None and reading.score is not None and (codes is None or reading.code in codes):
            table.setdefault(reading.operator, {}).setdefault(reading.code, []).append(value)
    return table


def _within(quantity: str, table: Table) -> Agreement | None:
    repeated = {name: [row for row in rows.values() if len(row) > 1] for name, rows in table.items()}
    rows = max(repeated.values(), key=len, default=[])
    if len(rows) < LEAST_TARGETS:
        return None
    repeats = min(map(len, rows))
    whole = [row[:repeats] for row in rows]
    size = {"targets": len(rows), "operators": 1, "repeats": repeats}
    return _agreement(quantity, WITHIN, size, "ICC(1,1)", whole, lambda: repeatability(rows))


def _between(quantity: str, table: Table) -> Agreement | None:
    if len(table) < 2:
        return None
    common = [code for code in next(iter(table.values())) if all(code in rows for rows in table.values())]
    if len(common) < LEAST_TARGETS:
        return None
    repeats = min(len(rows[code]) for rows in table.values() for code in common)
    cube = [[rows[code][:repeats] for rows in table.values()] for code in common]
    first = [[repeats_of[0] for repeats_of in target] for target in cube]
    size = {"targets": len(common), "operators": len(table), "repeats": repeats}
    return _agreement(quantity, BETWEEN, size, "ICC(2,1)", first, lambda: reproducibility(cube))


def _agreement(
    quantity: str,
    between: str,
    size: dict[str, int],
    form: Literal["ICC(1,1)", "ICC(2,1)"],
    rows: list[list[float]],
    coefficient: Callable[[], Any],
) -> Agreement:
    return Agreement(
        quantity=quantity,
        between=between,
        form=form,
        correlation=_number(lambda: intraclass_correlation(rows, form), "value"),
        coefficient=_number(coefficient, "coefficient"),
        **size,
    )


def _number(of: Callable[[], Any], name: str) -> AgreementValue:
    value, interval, remark = None, None, ""
    try:
        result = of()
        value = getattr(result, name)
        interval = result.interval()
    except InputError as error:
        remark = str(error)
    return AgreementValue(value=value, interval=interval, remark=remark)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SizeErrors:
    """Readings of one quantity with their true values."""

    quantity: str  #: its name
    codes: tuple[str, ...]  #: of the targets
    #: read, true: shape (targets,), in the unit of the quantity
    read: NDArray[np.float64]
    true: NDArray[np.float64]
    #: fraction of the device's 90 % intervals that contain the truth; None without intervals
    covered: Proportion | None
    not_identified: int  #: number of readings whose data added hardly anything to the prior

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


def _size_errors(device_results: DeviceResults, quantity: str) -> SizeErrors | None:
    """Errors of a quantity on the inclusions that the device detected; None where it measured none."""
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
    """Analysis of one device; for a value of None ``missing`` gives the reason."""

    results: DeviceResults  #: its targets
    #: readings, undecided_readings: number of its readings, and of the undecided ones
    readings: int
    undecided_readings: int
    counts: Counts | None  #: at the fixed threshold, without undecided targets
    counts_if_wrong: Counts | None  #: with undecided targets as errors
    #: curve, auc_interval: of the decided targets by `DeviceResults.ranks`; thresholds are in the unit of the
    #: ranks
    curve: Roc | None
    auc_interval: Interval | None
    auc_if_wrong: float | None  #: area with undecided targets as errors
    points: tuple[OperatingPoint, ...]  #: operating points, selected on the same targets and therefore optimistic
    #: counts at thresholds of the largest Youden index, each selected without the target that it decides
    held_out: Counts | None
    #: reliability, brier_interval, recalibration: of scores as probabilities, where all lie in [0, 1]
    reliability: ReliabilityCurve | None
    brier_interval: Interval | None
    recalibration: Recalibration | None
    errors: tuple[SizeErrors, ...]  #: of size, depth and modulus of detected inclusions
    strata: tuple[Stratum, ...]  #: detected inclusions by size and by depth
    agreements: tuple[Agreement, ...]  #: of repeats and operators
    missing: Mapping[str, str] = field(default_factory=dict)  #: reason of each missing value, by its name

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
        curve = _or_missing("curve", missing, lambda: Roc.of(ranks, present))
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
        auc_if_wrong=_or_missing("auc_if_wrong", missing, lambda: Roc.of(*device_results.ranks_if_wrong()).auc),
        points=points,
        held_out=_or_missing("held_out", missing, lambda: held_out_counts(ranks, present, youden_point)),
        reliability=reliability,
        brier_interval=brier,
        recalibration=recalibrated,
        errors=tuple(item for name in QUANTITIES if (item := _size_errors(device_results, name)) is not None),
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


ENOUGH = 30  # targets of each kind for DeLong's test


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DeviceComparison:
    """Two devices on the targets that both decided.

    ``areas`` compares their areas under the curve, paired; None with a ``remark``. ``limits`` has Bland and Altman's
    comparison, first minus second, of each quantity on inclusions that both measured.
    """

    first: str
    second: str
    targets: int
    areas: Comparison | None
    remark: str
    limits: Mapping[str, BlandAltman]


def device_comparison(first: DeviceResults, second: DeviceResults, rng: np.random.Generator) -> DeviceComparison:
    """Compare two devices; with fewer than 30 targets of a kind by the bootstrap, else by DeLong's test."""
    both = [
        (target, other)
        for target, other in zip(first.targets, second.targets, strict=True)
        if target.score is not None and other.score is not None
    ]
    scores = _ranks(first, [item for item, _ in both]), _ranks(second, [other for _, other in both])
    present = [item.truth.has_inclusion for item, _ in both]
    areas, remark = None, ""
    try:
        if min(sum(present), len(present) - sum(present)) >= ENOUGH:
            areas = compare_detectors(*scores, present)
        else:
            areas = bootstrap_compare_detectors(*scores, present, rng=rng)
    except InputError as error:
        remark = str(error)
    return DeviceComparison(
        first=first.device,
        second=second.device,
        targets=len(both),
        areas=areas,
        remark=remark,
        limits={name: result for name in QUANTITIES if (result := _limits(first, second, name)) is not None},
    )


def _ranks(device: DeviceResults, targets: Sequence[TargetResult]) -> list[float]:
    """Ranks of some of the targets that a device decided."""
    by_code = dict(zip((item.code for item in device.decided), device.ranks()[0].tolist(), strict=True))
    return [by_code[target.code] for target in targets]


def _limits(first: DeviceResults, second: DeviceResults, quantity: str) -> BlandAltman | None:
    pairs = [
        (target.reading.values[quantity], other.reading.values[quantity])
        for target, other in zip(first.targets, second.targets, strict=True)
        if target.truth.has_inclusion and target.reading and other.reading
        if quantity in target.reading.values and quantity in other.reading.values
    ]
    if len(pairs) < 2:
        return None
    return bland_altman([item for item, _ in pairs], [other for _, other in pairs])


BOOTSTRAP = 20_110  # seed, so that an analysis is reproducible to the digit


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyAnalysis:
    """The analysis of an unblinded study: truths by code, faults of its files and log, and devices.

    Devices are in the order of their first reading; ``comparisons`` are of every further device with the first.
    """

    study: Study
    truths: Mapping[str, TargetTruth]
    verification: StudyVerification
    devices: tuple[DeviceAnalysis, ...]
    comparisons: tuple[DeviceComparison, ...]


def analyse(study: Study, *, progress: Callable[[int, int], None] | None = None) -> StudyAnalysis:
    """Analyse an unblinded study; faults of a changed study are in ``verification``.

    The first reading of each target by a device counts; repeats serve for the agreement. Random numbers are the same
    each time, so the same study gives the same result. ``progress`` is called with (done, total) devices.

    `RecordsError` when the study is blind, or its truth cannot be read.
    """
    if study.unblinded is None:
        raise RecordsError("a study must be unblinded before it is analysed; this one is blind")
    return _analysed(study, progress)


def unblind_and_analyse(
    study: Study,
    *,
    by: str,
    publish: Callable[[StudyAnalysis], object] = lambda _analysis: None,
    progress: Callable[[int, int], None] | None = None,
) -> StudyAnalysis:
    """Analyse a study, then enter its unblinding: a failure before leaves it blind.

    ``publish`` is called with the analysis of a study that is still blind, to find out whether it can be published;
    nobody may see the result. Of a study that is unblinded already it is `analyse`. Errors as `unblind`.
    """
    before = open_study(study.folder)
    if before.unblinded is not None or not before.readings:
        return analyse(unblind(before, by=by), progress=progress)
    require_short_name("by", by)
    done = _analysed(before, progress)
    publish(done)
    after = unblind(before, by=by)
    if after.readings != before.readings:  # others entered some meanwhile
        return analyse(after)
    return replace(done, study=after, verification=verify_study(after.folder))


def _analysed(study: Study, progress: Callable[[int, int], None] | None) -> StudyAnalysis:
    """The analysis of a study, blind or not."""
    seal, _ = read_seal(study)
    truths = {code: seal.truths[code] for code in study.plan.codes}
    entries = [
        DeviceResults.of(device, study.threshold_of(device), study.readings, truths, study.plan.codes)
        for device in study.devices
    ]
    devices = []
    for number, item in enumerate(entries):
        if progress is not None:
            progress(number, len(entries))
        devices.append(device_analysis(item, study.readings, np.random.default_rng([BOOTSTRAP, number])))
    comparisons = [
        device_comparison(entries[0], item, np.random.default_rng([BOOTSTRAP, number, 1]))
        for number, item in enumerate(entries[1:], start=1)
    ]
    if progress is not None:
        progress(len(entries), len(entries))
    return StudyAnalysis(
        study=study,
        truths=truths,
        verification=verify_study(study.folder),
        devices=tuple(devices),
        comparisons=tuple(comparisons),
    )


def results_table(analysis: StudyAnalysis) -> Any:
    """Every target of every device as a ``pandas.DataFrame``: its truth, and the first reading of it.

    The columns are device, code, label, has_inclusion, the true values ``true_...``, score, called (whether the score
    reaches the device's threshold), undecided and unread, and value, standard deviation and 90 % interval of each
    quantity as in `tsis.study.readings.readings_table`. Raises `MissingExtraError` without the extra ``analysis``.
    """
    pandas = import_extra("pandas", feature="a table of results", extra="analysis")
    rows = [
        {
            "device": device.results.device,
            "code": item.code,
            "label": item.truth.label,
            "has_inclusion": item.truth.has_inclusion,
            **{f"true_{name}": item.truth.values.get(name, math.nan) for name in QUANTITIES},
            "score": math.nan if item.score is None else item.score,
            "called": device.results.calls(item),
            "undecided": item.reading is not None and item.score is None,
            "unread": item.reading is None,
            **quantity_columns(item.reading),
        }
        for device in analysis.devices
        for item in device.results.targets
    ]
    return pandas.DataFrame(rows)
