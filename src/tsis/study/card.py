"""A probe's performance card: its precision on reference phantoms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.__about__ import LARGEST_SEED
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.errors import CalibrationError, InputError, RecordsError
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.model.phantom import Inclusion
from tsis.model.require import require_integer
from tsis.study.agreement import bland_altman
from tsis.study.analysis import DeviceResults
from tsis.study.folder import new_study, read_seal, unblind, verify_study
from tsis.study.plan import QUANTITIES, TargetTruth, first_readings, require_short_name
from tsis.study.precision import linearity, repeatability, reproducibility
from tsis.study.readings import StudyInstrument, press_study
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from datetime import datetime

    from numpy.typing import NDArray

    from tsis.calibration.frames import UsableCalibration
    from tsis.study.agreement import BlandAltman
    from tsis.study.folder import Study
    from tsis.study.plan import DeviceReading
    from tsis.study.precision import Linearity, Repeatability, Reproducibility
    from tsis.study.proportions import Interval


LEAST_COMPLETE = 3  # targets, below which nothing is computed
OPERATORS, PROBES = "operators", "probes"


@dataclass(frozen=True, slots=True, kw_only=True)
class Precision:
    """Precision of one quantity, in its unit, on the inclusions that were read completely.

    A reading is complete where the device measured the quantity; a target, where every operator has all repeats of it.
    """

    quantity: str  #: diameter, depth or modulus by its name
    device: str  #: whose readings; both names where two devices are compared
    over: str  #: what differs between conditions: `OPERATORS`, or `PROBES` with one operator
    conditions: tuple[str, ...]  #: names of the operators, or of the devices
    #: complete, incomplete: codes of the targets used, and of those that lack a reading of this quantity
    complete: tuple[str, ...]
    incomplete: tuple[str, ...]
    repeats: int  #: readings of each target in each condition
    within: Repeatability  #: repeatability, pooled over targets and conditions
    between: Reproducibility | None  #: reproducibility over the conditions; None with a single one
    #: limits of agreement of the first readings, by pairs of conditions, first minus second
    limits: Mapping[tuple[str, str], BlandAltman]
    errors: BlandAltman  #: target means less the true values; their bias is that of the readings
    line: Linearity | None  #: line of the target means over the true values; None where these are too few or too equal

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

    Raises `RecordsError` when the study is blind, or asks for one reading of each target.
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
    for reading in sorted(readings, key=lambda reading: reading.repeat):
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


CHANCE = 0.05  # that one of the statistical checks of a faultless probe fails


@dataclass(frozen=True, slots=True, kw_only=True)
class CardCheck:
    """A check: what was found beside what is required; ``passed`` is None where nothing was given to check."""

    name: str
    found: str
    required: str
    passed: bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class PerformanceCard:
    """Numbers of one device in a study of reference phantoms, and its checks.

    ``covered`` counts the first readings of a phantom by an operator whose 90 % interval holds the true value, and all
    of them, by quantity; ``stated`` is the root mean square of the standard deviations of all readings.
    """

    study: Study
    device: str
    results: tuple[Precision, ...]
    missing: tuple[str, ...]
    decisions: DeviceResults
    covered: dict[str, tuple[int, int]]
    stated: dict[str, float]
    calibration: UsableCalibration | None
    checks: tuple[CardCheck, ...]

    @property
    def passed(self) -> bool:
        """Whether no check failed."""
        return all(check.passed is not False for check in self.checks)


def performance_card(
    study: Study, *, now: datetime, device: str | None = None, calibration: UsableCalibration | None = None
) -> PerformanceCard:
    """Card of a device, by default the first, in an unblinded study of reference phantoms with repeats.

    Bias and slope may miss by what the readings state as their standard deviation: an error of the probe is the same in
    all of them. The statistical checks share a chance of 5 % that one fails a faultless probe.

    Errors as `analyse_precision`.
    """
    analysis = analyse_precision(study)
    name = device or study.devices[0]
    truths = read_seal(study)[0].truths
    results = tuple(item for item in analysis.results if item.device == name and item.over == OPERATORS)
    decisions = DeviceResults.of(name, study.threshold_of(name), study.readings, truths, study.plan.codes)
    covered: dict[str, tuple[int, int]] = {}
    for reading in first_readings(study.readings):
        for quantity, (low, high) in reading.interval_90.items():
            true = truths[reading.code].values.get(quantity)
            if reading.device == name and reading.score is not None and true is not None:
                hits, count = covered.get(quantity, (0, 0))
                covered[quantity] = hits + (low <= true <= high), count + 1
    stated = _stated(study, name)
    checks = (*_records(study, now, calibration), *_statistics(results, covered, stated))
    missing = tuple(f"{quantity}: {why}" for (of, quantity), why in analysis.missing.items() if of == name)
    return PerformanceCard(
        study=study,
        device=name,
        results=results,
        missing=missing,
        decisions=decisions,
        covered=covered,
        stated=stated,
        calibration=calibration,
        checks=checks,
    )


def _stated(study: Study, device: str) -> dict[str, float]:
    """Root mean square of the standard deviations that the device states with its readings, by quantity."""
    sds = {name: [r.sd[name] for r in study.readings if r.device == device and name in r.sd] for name in QUANTITIES}
    return {name: float(np.sqrt(np.mean(np.square(values)))) for name, values in sds.items() if values}


def _records(study: Study, now: datetime, calibration: UsableCalibration | None) -> Iterator[CardCheck]:
    faults = verify_study(study.folder).faults
    yield CardCheck(
        name="files and log as they were written",
        found=f"{len(faults)} changes",
        required="none",
        passed=not faults,
    )
    if calibration is None:
        yield CardCheck(name="calibration", found="not given", required="valid today", passed=None)
        return
    stored, refusal = calibration.calibration, ""
    try:
        stored.require_usable(now, probe=study.plan.probe)
    except CalibrationError as error:
        refusal = str(error)
    until = "no end" if stored.expires is None else f"until {stored.expires:%Y-%m-%d}"
    yield CardCheck(
        name="calibration", found=refusal or until, required="valid today, of this probe", passed=not refusal
    )


def _statistics(
    results: tuple[Precision, ...], covered: Mapping[str, tuple[int, int]], stated: Mapping[str, float]
) -> Iterator[CardCheck]:
    lines = sum(item.line is not None for item in results)
    level = 1 - CHANCE / max(len(results) + 2 * lines + len(covered), 1)
    for item in results:
        sd = stated.get(item.quantity, 0.0)
        yield _near(item, "bias", item.errors.bias_interval(level), 0.0, sd)
        if item.line is not None:
            true = float((item.errors.means - item.errors.differences / 2).mean())
            yield _near(item, "slope of the line", item.line.slope_interval(level), 1.0, sd / true)
            p = item.line.curvature_p
            yield CardCheck(
                name=f"{item.quantity}: curvature",
                found=f"p = {p:.2g}",
                required=f"p >= {1 - level:.1g}",
                passed=not p < 1 - level,
            )
    for quantity, (hits, count) in covered.items():
        least = int(scipy.stats.binom.ppf(1 - level, count, INTERVAL_LEVEL))
        yield CardCheck(
            name=f"{quantity}: 90 % intervals that hold the truth",
            found=f"{hits} of {count}",
            required=f"at least {least}",
            passed=hits >= least,
        )


def _near(item: Precision, what: str, interval: Interval, right: float, allowed: float) -> CardCheck:
    """Whether an interval comes within the stated standard deviation of what is right."""
    low, high = interval
    return CardCheck(
        name=f"{item.quantity}: {what}",
        found=f"{low:+.2g} to {high:+.2g}" if right == 0 else f"{low:.2f} to {high:.2f}",
        required=f"meets {right:g} ± {allowed:.2g}",
        passed=low <= right + allowed and high >= right - allowed,
    )


# Well inside the default prior: phantoms of the catalog at 4 mm, 40 and 120 kPa lie on the ends of what is believed,
# where no interval of 90 % holds the truth.
REFERENCES = {  # diameter and depth in mm, modulus in kPa
    "diameter 7": (7.0, 6.0, 80.0),
    "diameter 13": (13.0, 6.0, 80.0),
    "depth 5": (10.0, 5.0, 80.0),
    "depth 9": (10.0, 9.0, 80.0),
    "modulus 55": (10.0, 6.0, 55.0),
    "modulus 80": (10.0, 6.0, 80.0),
    "modulus 105": (10.0, 6.0, 105.0),
}
BLANKS = 2


def reference_targets() -> tuple[TargetTruth, ...]:
    """Seven phantoms that vary in size, depth and modulus, and two blanks, in the tissue of ``plain``.

    Examples
    --------
    >>> sum(target.has_inclusion for target in reference_targets()), len(reference_targets())
    (7, 9)
    """
    tissue = replace(load_phantom("plain"), name="", assumed=())
    stiff = {
        label: Inclusion(diameter_mm=diameter, depth_mm=depth, young_kpa=young, poisson=tissue.poisson)
        for label, (diameter, depth, young) in REFERENCES.items()
    }
    targets = [TargetTruth(label=label, phantom=replace(tissue, inclusion=lump)) for label, lump in stiff.items()]
    return (*targets, *[TargetTruth(label="plain", phantom=tissue)] * BLANKS)


def rehearse_reference_run(
    folder: str | os.PathLike[str],
    *,
    probe: str = "tsis-domed",
    operators: Sequence[str] = ("A", "B"),
    repeats: int = 3,
    seed: int = 1,
    strain: str = "finite",
    preparing: Callable[[int, int], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Let ``operators`` read the reference phantoms in turn with one virtual probe, in a new folder, and unblind.

    The errors of the ``probe`` of the catalog follow from the ``seed``; an operator reads each phantom ``repeats``
    times, 2 or more. ``strain``, ``"finite"`` or ``"small"``, is the mechanics of presses and estimates. ``preparing``
    and ``progress`` are called with (done, total). Raises `InputError` when a value lies outside its range, and
    `RecordsError` when the folder exists or cannot be created.
    """
    require_integer("repeats", repeats, 2, 100, hint="a card shows how well readings repeat")
    require_integer("seed", seed, 0, LARGEST_SEED)
    names = [require_short_name("operator", name) for name in operators]
    virtual = VirtualProbe(load_probe(probe), rng=np.random.default_rng(seed), strain=strain)
    study = new_study(folder, reference_targets(), seed=seed, probe=probe, repeats=repeats)
    return press_by_operators(
        study, virtual=virtual, operators=names, seed=seed, strain=strain, preparing=preparing, progress=progress
    )


def press_by_operators(
    study: Study,
    *,
    virtual: VirtualProbe,
    operators: Sequence[str],
    seed: int,
    strain: str = "finite",
    preparing: Callable[[int, int], None] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Let operators read all targets of a blind study in turn with one ``virtual`` probe, and unblind.

    Readings that the study holds already are not taken again; all errors of readings follow from the ``seed``. The rest
    is as for `rehearse_reference_run`.
    """
    readings = len(study.plan.codes) * study.plan.repeats
    for number, name in enumerate(operators):

        def advance(done: int, _: int, start: int = number * readings) -> None:
            if progress is not None:
                progress(start + done, len(operators) * readings)

        study = press_study(
            study,
            operator=name,
            seed=seed,
            strain=strain,
            instrument=StudyInstrument(virtual=virtual),
            preparing=preparing if number == 0 else None,
            progress=advance,
        ).study
    return unblind(study, by=operators[0])
