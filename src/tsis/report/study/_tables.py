"""Tables of a study."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tsis.report._page import Table
from tsis.report.study._document import (
    NAMES,
    counted,
    ends,
    fraction_text,
    interval_text,
    labelled,
    limit_intervals,
    method_of,
    score_text,
    small,
)
from tsis.study.plan import QUANTITIES

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.study.agreement import BlandAltman
    from tsis.study.analysis import (
        AgreementValue,
        DeviceAnalysis,
        DeviceComparison,
        DeviceResults,
        StudyAnalysis,
        TargetResult,
    )
    from tsis.study.proportions import Counts, Interval, Proportion


NUMBERS = ("", "value", "95 % interval", "method")


def device_tables(device_analysis: DeviceAnalysis) -> Iterator[Table]:
    """All tables of a device, the most important first."""
    device = device_analysis.results.device
    title = f"{device}: at the threshold {device_analysis.results.threshold:g}, which was fixed beforehand"
    yield Table(title=title, headings=NUMBERS, rows=tuple(_at_threshold(device_analysis)))
    if device_analysis.points:
        ranked = device_analysis.results.is_ranked
        threshold = "threshold of the logarithm of the Bayes factor" if ranked else "threshold"
        yield Table(
            title=f"{device}: other thresholds, chosen on these very targets and so optimistic",
            headings=("rule", threshold, "sensitivity", "95 % interval", "specificity", "95 % interval"),
            rows=tuple(_points(device_analysis)),
        )
    if device_analysis.reliability is not None:
        yield Table(
            title=f"{device}: scores taken for probabilities", headings=NUMBERS, rows=tuple(_probable(device_analysis))
        )
    if device_analysis.errors:
        yield Table(
            title=f"{device}: what was read of inclusions that were found, less what is true",
            headings=("", "targets", "mean error", "95 % interval", "rms error", "largest",
                      "90 % intervals that hold the truth", "not identified"),
            rows=tuple(_errors(device_analysis)),
        )  # fmt: skip
    yield Table(
        title=f"{device}: found by size and by depth",
        headings=("inclusions", "found", "95 % interval", "undecided"),
        rows=tuple(_strata(device_analysis)),
    )
    if device_analysis.agreements:
        yield Table(
            title=f"{device}: how well readings of the same target agree",
            headings=("quantity", "", "rests on", "correlation", "95 % interval", "two readings differ by less than",
                      "95 % interval"),
            rows=tuple(_agreements(device_analysis)),
        )  # fmt: skip


def _at_threshold(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    counts = device_analysis.counts
    if counts is not None:
        yield from _fractions(counts)
        if counts.present and counts.absent:
            youden = counts.youden
            yield ("Youden's index", f"{youden.value:.3f}", ends(youden.interval()), method_of(youden.interval()))
    if device_analysis.curve is not None:
        area = device_analysis.auc_interval
        yield ("area under the curve", f"{device_analysis.curve.auc:.3f}", ends(area), method_of(area))
    else:
        yield ("area under the curve", "none", device_analysis.missing.get("curve", ""), "")
    yield ("readings", f"{device_analysis.readings}", f"{device_analysis.undecided_readings} of them undecided", "")
    wrong = device_analysis.counts_if_wrong
    if device_analysis.results.undecided and wrong is not None:
        for name, value, interval, method in _fractions(wrong):
            yield (f"{name}, undecided as wrong", value, interval, method)


def _fractions(counts: Counts) -> Iterator[tuple[str, str, str, str]]:
    inside, outside = (counts.sensitivity if counts.present else None), (counts.specificity if counts.absent else None)
    yield ("sensitivity", fraction_text(inside), interval_text(inside), "Wilson" if inside else "")
    yield ("specificity", fraction_text(outside), interval_text(outside), "Wilson" if outside else "")
    yield ("accuracy", fraction_text(counts.accuracy), interval_text(counts.accuracy), "Wilson")


def _points(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for point in device_analysis.points:
        inside, outside = point.counts.sensitivity, point.counts.specificity
        at = {math.inf: "none", -math.inf: "all"}.get(point.threshold, f"{point.threshold:.4g}")
        yield (point.rule, at, _of(inside), interval_text(inside), _of(outside), interval_text(outside))
    if device_analysis.held_out is not None:
        inside, outside = device_analysis.held_out.sensitivity, device_analysis.held_out.specificity
        rule = "the first, each chosen without the target that it decides on"
        yield (rule, "varies", _of(inside), interval_text(inside), _of(outside), interval_text(outside))


def _of(rate: Proportion) -> str:
    return f"{rate.successes} of {rate.trials}"


def _probable(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    curve = device_analysis.reliability
    if curve is None:
        return
    interval = device_analysis.brier_interval
    why = "" if interval is not None else device_analysis.missing.get("brier_interval", "")
    yield ("Brier score, 0 at best", small(curve.brier.score), ends(interval) if interval else why, method_of(interval))
    yield ("expected calibration error", small(curve.expected_calibration_error), "-", "")
    if device_analysis.recalibration is None:
        yield ("calibration slope, 1 is right", "none", device_analysis.missing.get("recalibration", ""), "")
        return
    for name, fitted in (
        ("calibration slope, 1 is right", device_analysis.recalibration.slope),
        ("calibration intercept, 0 is right", device_analysis.recalibration.intercept),
    ):
        yield (name, f"{fitted.value:.3f}", ends(fitted.interval()), method_of(fitted.interval()))


def _errors(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for error in device_analysis.errors:
        covered = f"{fraction_text(error.covered)}, {interval_text(error.covered)}"
        stored = "no intervals given" if error.covered is None else covered
        numbers = (f"{error.bias:+.2f}", ends(error.bias_interval, 2), f"{error.rmse:.2f}", f"{error.largest:.2f}")
        yield (labelled(error.quantity), str(len(error.codes)), *numbers, stored, str(error.not_identified))


def _strata(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for item in device_analysis.strata:
        name, unit = NAMES[item.quantity]
        low, high, sizes = f"{item.low:g}", f"{item.high:g}", item.quantity == "diameter_mm"
        if item.low == 0:
            where = f"below {high} {unit}" if sizes else f"up to {high} {unit}"
        elif math.isinf(item.high):
            where = f"of {low} {unit} and more" if sizes else f"more than {low} {unit}"
        else:
            where = f"{low} to below {high} {unit}" if sizes else f"more than {low}, up to {high} {unit}"
        yield (f"{name} {where}", fraction_text(item.detected), interval_text(item.detected), str(item.undecided))


def _agreements(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for agreement in device_analysis.agreements:
        many = [(agreement.targets, "target"), (agreement.operators, "operator"), (agreement.repeats, "repeat")]
        rests = ", ".join(counted(number, what) for number, what in many if number > 1)
        form, unit = agreement.form, NAMES[agreement.quantity][1]
        yield (
            NAMES[agreement.quantity][0],
            agreement.between,
            rests,
            _value_text(agreement.correlation, form, ""),
            _interval_text(agreement.correlation),
            _value_text(agreement.coefficient, "", unit),
            _interval_text(agreement.coefficient),
        )


def _value_text(number: AgreementValue, form: str, unit: str) -> str:
    if number.value is None:
        return "none"
    return " ".join(part for part in (form, f"{number.value:.3g}", unit) if part)


def _interval_text(number: AgreementValue) -> str:
    interval: Interval | None = number.interval
    return number.remark or "-" if interval is None else f"{ends(interval)} ({method_of(interval)})"


def comparison_table(device_comparison: DeviceComparison) -> Table:
    """A comparison of a device with the first."""
    rows = []
    if device_comparison.areas is None:
        rows.append(("difference of areas", "none", device_comparison.remark, ""))
    else:
        areas = device_comparison.areas
        rows.append((f"area of {device_comparison.first}", f"{areas.first_auc:.3f}", "", ""))
        rows.append((f"area of {device_comparison.second}", f"{areas.second_auc:.3f}", "", ""))
        reported = areas.remark or ends(areas.interval)
        by = method_of(areas.interval) + ("" if areas.p is None else f", p = {areas.p:.2g}")
        rows.append(("difference of areas", f"{areas.difference:+.3f}", reported, by))
    for name, limit in device_comparison.limits.items():
        rows += limit_rows(name, limit)
    devices = f"{device_comparison.second} beside {device_comparison.first}"
    title = f"{devices}, on {device_comparison.targets} targets that both decided"
    return Table(title=title, headings=NUMBERS, rows=tuple(rows))


def limit_rows(name: str, bland_altman: BlandAltman) -> list[tuple[str, str, str, str]]:
    """Bias, lower and upper limit of agreement of a quantity, each with its interval."""
    bias, limits = limit_intervals(bland_altman)
    what = f"{labelled(name)}: bias, {bland_altman.targets} inclusions"
    rows = [(what, f"{bland_altman.bias:+.2f}", ends(bias, 2), method_of(bias))]
    for side, limit, interval in zip(("lower", "upper"), bland_altman.limits(), limits, strict=True):
        rows.append((f"{labelled(name)}: {side} limit", f"{limit:+.2f}", ends(interval, 2), method_of(interval)))
    return rows


def targets_table(analysis: StudyAnalysis) -> Table:
    """Every target with its truth and the first reading of each device."""
    devices = [device.results for device in analysis.devices]
    rows = []
    for index, (code, truth) in enumerate(analysis.truths.items()):
        lump = truth.phantom.inclusion
        sizes = [f"{truth.values[name]:.3g}" if lump else "" for name in QUANTITIES]
        messages = [_decision_text(device, device.targets[index]) for device in devices]
        rows.append((code, truth.label, "inclusion" if lump else "blank", *sizes, *messages))
    headings = ("code", "label", "truth", "d / mm", "h / mm", "E / kPa", *(device.device for device in devices))
    return Table(title="Every target", headings=headings, rows=tuple(rows))


def _decision_text(device: DeviceResults, target: TargetResult) -> str:
    if target.reading is None:
        return "not read"
    if target.score is None:
        return f"undecided: {target.reading.reason}"
    right = device.calls(target) == target.truth.has_inclusion
    return f"{score_text(target.score, probability=device.are_probabilities)} {'right' if right else 'WRONG'}"
