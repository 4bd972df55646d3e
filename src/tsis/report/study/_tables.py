"""Tables of a study."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tsis.report._page import Table
from tsis.report.study._document import limit_intervals
from tsis.report.study._text import NAMES, counted, ends, labelled, method_of, score_words, share, share_ends, small

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.detection import BlandAltman, Counts, Interval, Proportion
    from tsis.study.analysis import (
        AgreementValue,
        DeviceAnalysis,
        DeviceComparison,
        DeviceResults,
        StudyAnalysis,
        TargetResult,
    )


NUMBERS = ("", "value", "95 % interval", "method")


def device_tables(one: DeviceAnalysis) -> Iterator[Table]:
    """Everything of one device, the most wanted first."""
    device = one.judged.device
    title = f"{device}: at the threshold {one.judged.threshold:g}, which was fixed beforehand"
    yield Table(title=title, headings=NUMBERS, rows=tuple(_at_threshold(one)))
    if one.points:
        yield Table(
            title=f"{device}: other thresholds, chosen on these very targets and so optimistic",
            headings=("rule", _unit_of_threshold(one), "sensitivity", "95 % interval", "specificity", "95 % interval"),
            rows=tuple(_points(one)),
        )
    if one.reliability is not None:
        yield Table(title=f"{device}: scores taken for probabilities", headings=NUMBERS, rows=tuple(_probable(one)))
    if one.errors:
        yield Table(
            title=f"{device}: what was read of inclusions that were found, less what is true",
            headings=("", "targets", "mean error", "95 % interval", "rms error", "largest",
                      "90 % intervals that hold the truth", "not identified"),
            rows=tuple(_errors(one)),
        )  # fmt: skip
    yield Table(
        title=f"{device}: found by size and by depth",
        headings=("inclusions", "found", "95 % interval", "undecided"),
        rows=tuple(_strata(one)),
    )
    if one.agreements:
        yield Table(
            title=f"{device}: how well readings of the same target agree",
            headings=("quantity", "", "rests on", "correlation", "95 % interval", "two readings differ by less than",
                      "95 % interval"),
            rows=tuple(_agreements(one)),
        )  # fmt: skip


def _at_threshold(one: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    counts = one.counts
    if counts is not None:
        yield from _shares(counts)
        if counts.present and counts.absent:
            youden = counts.youden
            yield ("Youden's index", f"{youden.value:.3f}", ends(youden.interval()), method_of(youden.interval()))
    if one.curve is not None:
        yield ("area under the curve", f"{one.curve.auc:.3f}", ends(one.auc_interval), method_of(one.auc_interval))
    else:
        yield ("area under the curve", "none", one.missing.get("curve", ""), "")
    yield ("readings", f"{one.readings}", f"{one.undecided_readings} of them undecided", "")
    wrong = one.counts_if_wrong
    if one.judged.undecided and wrong is not None:
        for name, value, interval, method in _shares(wrong):
            yield (f"{name}, undecided as wrong", value, interval, method)


def _shares(counts: Counts) -> Iterator[tuple[str, str, str, str]]:
    inside, outside = (counts.sensitivity if counts.present else None), (counts.specificity if counts.absent else None)
    yield ("sensitivity", share(inside), share_ends(inside), "Wilson" if inside else "")
    yield ("specificity", share(outside), share_ends(outside), "Wilson" if outside else "")
    yield ("accuracy", share(counts.accuracy), share_ends(counts.accuracy), "Wilson")


def _points(one: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for point in one.points:
        inside, outside = point.counts.sensitivity, point.counts.specificity
        at = (
            "none"
            if point.threshold == math.inf
            else "all"
            if point.threshold == -math.inf
            else f"{point.threshold:.4g}"
        )
        yield (point.rule, at, _of(inside), share_ends(inside), _of(outside), share_ends(outside))
    if one.held_out is not None:
        inside, outside = one.held_out.sensitivity, one.held_out.specificity
        rule = "the first, each chosen without the target that it decides on"
        yield (rule, "varies", _of(inside), share_ends(inside), _of(outside), share_ends(outside))


def _unit_of_threshold(one: DeviceAnalysis) -> str:
    return "threshold of the logarithm of the Bayes factor" if one.judged.is_ranked else "threshold"


def _of(rate: Proportion) -> str:
    return f"{rate.successes} of {rate.trials}"


def _probable(one: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    curve = one.reliability
    if curve is None:
        return
    interval = one.brier_interval
    why = "" if interval is not None else one.missing.get("brier_interval", "")
    yield ("Brier score, 0 at best", small(curve.brier.score), ends(interval) if interval else why, method_of(interval))
    yield ("expected calibration error", small(curve.expected_calibration_error), "-", "")
    if one.recalibration is None:
        yield ("calibration slope, 1 is right", "none", one.missing.get("recalibration", ""), "")
        return
    for name, fitted in (
        ("calibration slope, 1 is right", one.recalibration.slope),
        ("calibration intercept, 0 is right", one.recalibration.intercept),
    ):
        yield (name, f"{fitted.value:.3f}", ends(fitted.interval()), method_of(fitted.interval()))


def _errors(one: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for each in one.errors:
        held = "no intervals given" if each.covered is None else f"{share(each.covered)}, {share_ends(each.covered)}"
        numbers = (f"{each.bias:+.2f}", ends(each.bias_interval, 2), f"{each.rmse:.2f}", f"{each.largest:.2f}")
        yield (labelled(each.quantity), str(len(each.codes)), *numbers, held, str(each.not_identified))


def _strata(one: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for each in one.strata:
        name, unit = NAMES[each.quantity]
        low, high, sizes = f"{each.low:g}", f"{each.high:g}", each.quantity == "diameter_mm"
        if each.low == 0:
            where = f"below {high} {unit}" if sizes else f"up to {high} {unit}"
        elif math.isinf(each.high):
            where = f"of {low} {unit} and more" if sizes else f"more than {low} {unit}"
        else:
            where = f"{low} to below {high} {unit}" if sizes else f"more than {low}, up to {high} {unit}"
        yield (f"{name} {where}", share(each.found), share_ends(each.found), str(each.undecided))


def _agreements(one: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for each in one.agreements:
        many = [(each.targets, "target"), (each.operators, "operator"), (each.repeats, "repeat")]
        rests = ", ".join(counted(number, what) for number, what in many if number > 1)
        form, unit = each.form, NAMES[each.quantity][1]
        yield (
            NAMES[each.quantity][0],
            each.between,
            rests,
            _told(each.correlation, form, ""),
            _interval_told(each.correlation),
            _told(each.coefficient, "", unit),
            _interval_told(each.coefficient),
        )


def _told(number: AgreementValue, form: str, unit: str) -> str:
    if number.value is None:
        return "none"
    return " ".join(part for part in (form, f"{number.value:.3g}", unit) if part)


def _interval_told(number: AgreementValue) -> str:
    interval: Interval | None = number.interval
    return number.remark or "-" if interval is None else f"{ends(interval)} ({method_of(interval)})"


def comparison_table(one: DeviceComparison) -> Table:
    """A device beside the first."""
    rows = []
    if one.areas is None:
        rows.append(("difference of areas", "none", one.remark, ""))
    else:
        areas = one.areas
        rows.append((f"area of {one.first}", f"{areas.first_auc:.3f}", "", ""))
        rows.append((f"area of {one.second}", f"{areas.second_auc:.3f}", "", ""))
        told = areas.remark or ends(areas.interval)
        by = method_of(areas.interval) + ("" if areas.p is None else f", p = {areas.p:.2g}")
        rows.append(("difference of areas", f"{areas.difference:+.3f}", told, by))
    for name, found in one.limits.items():
        rows += _limits(name, found)
    title = f"{one.second} beside {one.first}, on {one.targets} targets that both decided"
    return Table(title=title, headings=NUMBERS, rows=tuple(rows))


def _limits(name: str, found: BlandAltman) -> list[tuple[str, str, str, str]]:
    bias, limits = limit_intervals(found)
    rows = [
        (f"{labelled(name)}: bias, {found.targets} inclusions", f"{found.bias:+.2f}", ends(bias, 2), method_of(bias))
    ]
    for side, limit, interval in zip(("lower", "upper"), found.limits(), limits, strict=True):
        rows.append((f"{labelled(name)}: {side} limit", f"{limit:+.2f}", ends(interval, 2), method_of(interval)))
    return rows


def targets_table(analysis: StudyAnalysis) -> Table:
    """Every target with what is true and what each device said first."""
    devices = [one.judged for one in analysis.devices]
    rows = []
    for place, (code, truth) in enumerate(analysis.truths.items()):
        lump = truth.phantom.inclusion
        sizes = (
            ("", "", "")
            if lump is None
            else (f"{lump.diameter_mm:.3g}", f"{lump.depth_mm:.3g}", f"{lump.young_kpa:.3g}")
        )
        said = [_said(one, one.targets[place]) for one in devices]
        rows.append((code, truth.label, "inclusion" if lump else "blank", *sizes, *said))
    headings = ("code", "label", "truth", "d / mm", "h / mm", "E / kPa", *(one.device for one in devices))
    return Table(title="Every target", headings=headings, rows=tuple(rows))


def _said(device: DeviceResults, target: TargetResult) -> str:
    if target.reading is None:
        return "not read"
    if target.score is None:
        return f"undecided: {target.reading.reason}"
    right = device.calls(target) == target.truth.has_inclusion
    return f"{score_words(target.score, probability=device.are_probabilities)} {'right' if right else 'WRONG'}"
