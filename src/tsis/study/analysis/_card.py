"""A probe's performance card: its numbers on reference phantoms, and the checks that they pass or fail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import CalibrationError
from tsis.model import INTERVAL_LEVEL
from tsis.study._folder import read_seal
from tsis.study._values import QUANTITIES
from tsis.study._verification import verify_study
from tsis.study.analysis._precision import OPERATORS, DeviceResults, analyse_precision, device_results

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from datetime import datetime

    from tsis.calibration import UsableCalibration
    from tsis.detection import Interval
    from tsis.study._folder import Study
    from tsis.study.analysis._precision import Precision


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
    decisions = device_results(name, study.threshold_of(name), study.readings, truths, study.plan.codes)
    covered: dict[str, tuple[int, int]] = {}
    for reading in study.readings:
        for quantity, (low, high) in reading.interval_90.items():
            true = truths[reading.code].values.get(quantity)
            if reading.device == name and reading.repeat == 1 and reading.score is not None and true is not None:
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
