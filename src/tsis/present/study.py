"""The report of a blinded study: texts of its numbers, tables, pictures, page, JSON, and the files."""

from __future__ import annotations

import hashlib
import itertools
import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError
from tsis.files.canonical_json import json_bytes
from tsis.files.result_folder import free_folder, require_room, write_folder
from tsis.files.tables import table_bytes
from tsis.present.document import envelope
from tsis.present.figures import (
    agreement_limits,
    detected_by_size_and_depth,
    read_over_true,
    reliability_diagram,
    roc_curve,
    scores_by_truth,
)
from tsis.present.html import html_bytes
from tsis.present.labels import counted, quantity_of
from tsis.present.page import Card, Page, Picture, Table, on_axes
from tsis.study.analysis import FEW, unblind_and_analyse
from tsis.study.folder import ANALYSED, enter_analysis
from tsis.study.plan import ANALYSED_READING, QUANTITIES
from tsis.study.proportions import Interval, Proportion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from matplotlib.figure import Figure

    from tsis.study.agreement import BlandAltman
    from tsis.study.analysis import (
        Agreement,
        AgreementValue,
        DeviceAnalysis,
        DeviceComparison,
        DeviceResults,
        SizeErrors,
        StudyAnalysis,
        TargetResult,
    )
    from tsis.study.folder import Study, StudyVerification
    from tsis.study.probabilities import Recalibration, ReliabilityCurve
    from tsis.study.proportions import Counts
    from tsis.study.roc import OperatingPoint, Roc


DEVICE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # distinct without red-green vision
METHODS = {
    "wilson": "Wilson",
    "newcombe": "Newcombe",
    "delong": "DeLong",
    "bootstrap": "bootstrap",
    "f": "F",
    "chi-square": "chi-square",
    "modified large samples": "Graybill and Wang",
    "wald": "Wald",
    "t": "Student",
    "exact": "Carkeet, exact",
}
LEAST_SHOWN = 5e-4


def ends(interval: Interval | None, digits: int = 3) -> str:
    """Text of an interval; a dash where there is none."""
    if interval is None:
        return "-"
    low, high = (f"{end:.{digits}f}" if math.isfinite(end) else "no end" for end in interval)
    return f"{low} to {high}"


def method_of(interval: Interval | None) -> str:
    """Method of an interval; empty where there is none."""
    return "" if interval is None else METHODS.get(interval.method, interval.method)


def fraction_text(proportion: Proportion | None) -> str:
    """A proportion in per cent.

    Examples
    --------
    >>> from tsis.study.proportions import Proportion
    >>> fraction_text(Proportion(successes=6, trials=8))
    '75 % (6 of 8)'
    """
    if proportion is None:
        return "none"
    value = 100 * proportion.value
    return f"{value:.3g} % ({proportion.successes} of {proportion.trials})"


def interval_text(proportion: Proportion | None) -> str:
    """The Wilson interval in per cent."""
    if proportion is None:
        return "-"
    low, high = (100 * end for end in proportion.interval())
    return f"{low:.1f} to {high:.1f} %"


def small(value: float, digits: int = 3) -> str:
    """A non-negative number, shown as 0 only where it is 0.

    Examples
    --------
    >>> small(0.01234), small(0.00001), small(0.0)
    ('0.012', 'below 0.001', '0.000')
    """
    least = 10.0**-digits
    return f"below {least:g}" if 0 < value < LEAST_SHOWN * least / 1e-3 else f"{value:.{digits}f}"


def score_text(score: float, *, probability: bool) -> str:
    """A score; a probability is never shown as 0 or 1.

    Examples
    --------
    >>> score_text(1.0, probability=True), score_text(0.25, probability=True), score_text(1.0, probability=False)
    ('above 0.999', '0.250', '1')
    """
    if not probability:
        return f"{score:.4g}"
    return "above 0.999" if score > 0.9995 else "below 0.001" if score < 0.0005 else f"{score:.3f}"


def record_notes(analysis: StudyAnalysis) -> tuple[str, ...]:
    """Result of the verification, and the head of the log for later verifications."""
    result = analysis.verification
    head = (
        f"Unblinded {result.unblinded}. The log has {result.lines} lines; its head is {result.head}. Keep the head "
        "elsewhere: tsis study verify --head tells from it whether the log was cut short or written anew."
    )
    if result.sound:
        return ("Plan, sealed truth and every line of the log are as they were written.", head)
    return (
        "NOT AS IT WAS WRITTEN, in these places:",
        *(str(fault) for fault in result.faults),
        head,
    )


def few_notes(device_analysis: DeviceAnalysis) -> tuple[str, ...]:
    """Notes on the limits of a small study."""
    if not device_analysis.few:
        return ()
    inside = sum(target.truth.has_inclusion for target in device_analysis.results.decided)
    outside = len(device_analysis.results.decided) - inside
    return (
        f"{device_analysis.results.device}: judged on {counted(inside, 'target')} with an inclusion and "
        f"{outside} without. With "
        f"fewer than {FEW} of a class a study says little: read the intervals, not the values.",
    )


def undecided_notes(device_analysis: DeviceAnalysis) -> tuple[str, ...]:
    """Missing readings and decisions, and their possible effect."""
    notes = []
    results, wrong = device_analysis.results, device_analysis.counts_if_wrong
    if results.undecided and wrong is not None:
        sensitivity = fraction_text(wrong.sensitivity) if wrong.present else "none"
        specificity = fraction_text(wrong.specificity) if wrong.absent else "none"
        area = "" if device_analysis.auc_if_wrong is None else f", area {device_analysis.auc_if_wrong:.3f}"
        notes.append(
            f"{results.device}: {counted(len(results.undecided), 'target')} undecided, left out of the "
            f"numbers. Taken as "
            f"the wrong answer: sensitivity {sensitivity}, specificity {specificity}{area}."
        )
    if results.unread:
        notes.append(f"{results.device}: {counted(len(results.unread), 'target')} not read, left out of the numbers.")
    later = sum(target.reading is not None and target.reading.repeat > 1 for target in results.targets)
    if later:
        notes.append(f"{results.device}: {counted(later, 'target')} judged by a later repeat, as repeat 1 is missing.")
    return tuple(notes)


def study_document(analysis: StudyAnalysis) -> dict[str, Any]:
    """The results of a study as JSON values; null where a value is unknown."""
    plan = analysis.study.plan
    scores = {
        device.results.device: {target.code: target.score for target in device.results.targets}
        for device in analysis.devices
    }
    return envelope(
        "study analyse",
        study={
            "name": plan.name,
            "made": plan.made.isoformat(),
            "targets": len(plan.codes),
            "present": sum(truth.has_inclusion for truth in analysis.truths.values()),
            **_fields(plan, "probe", "forces_n", "with_reference", "repeats", "threshold"),
        },
        verification=study_verification_document(analysis.verification),
        devices=[_device(device) for device in analysis.devices],
        comparisons=[_comparison(comparison) for comparison in analysis.comparisons],
        targets=[
            {
                "code": code,
                "present": truth.has_inclusion,
                **truth.json_values(),
                "scores": {device: by_code[code] for device, by_code in scores.items()},
            }
            for code, truth in analysis.truths.items()
        ],
    )


def study_verification_document(study_verification: StudyVerification) -> dict[str, Any]:
    """Result of the verification of a study."""
    faults = [str(fault) for fault in study_verification.faults]
    return {
        "sound": study_verification.sound,
        "faults": faults,
        **_fields(study_verification, "head", "lines", "unblinded"),
    }


def _device(device_analysis: DeviceAnalysis) -> dict[str, Any]:
    results, curve = device_analysis.results, device_analysis.curve
    return {
        "device": results.device,
        "threshold": results.threshold,
        **_fields(device_analysis, "readings", "undecided_readings"),
        "decided_targets": len(results.decided),
        "undecided_targets": [target.code for target in results.undecided],
        "unread_targets": [target.code for target in results.unread],
        "counts": _counts(device_analysis.counts),
        "counts_if_undecided_are_wrong": _counts(device_analysis.counts_if_wrong),
        "ranked_by": "log_bayes_factor" if results.is_ranked else "score",
        "auc": None if curve is None else curve.auc,
        **_fields(device_analysis, "auc_interval"),
        "auc_if_undecided_are_wrong": device_analysis.auc_if_wrong,
        "roc": None if curve is None else _roc(curve),
        "operating_points_optimistic": [_point(point) for point in device_analysis.points],
        "held_out_counts": _counts(device_analysis.held_out),
        "reliability": None if device_analysis.reliability is None else _reliability(device_analysis.reliability),
        **_fields(device_analysis, "brier_interval"),
        "recalibration": _recalibration(device_analysis.recalibration),
        "errors": [_errors_document(error) for error in device_analysis.errors],
        "found_by": [
            _fields(item, "quantity", "low", "high", "undecided") | {"found": _json_value(item.detected)}
            for item in device_analysis.strata
        ],
        "agreement": [_agreement(agreement) for agreement in device_analysis.agreements],
        "missing": dict(device_analysis.missing),
    }


def _fields(value: object, *names: str) -> dict[str, Any]:
    """The named fields as JSON values; null for a number that is not finite."""
    return {name: _json_value(getattr(value, name)) for name in names}


def _json_value(value: Any) -> Any:
    match value:
        case Interval():
            return interval_document(value)
        case Proportion():
            return proportion_document(value)
        case tuple():
            return [_json_value(item) for item in value]
        case float() if not math.isfinite(value):
            return None
    return value


def interval_document(interval: Interval | None) -> dict[str, Any] | None:
    """Both ends, the level and the method; null for an infinite end."""
    if interval is None:
        return None
    low, high = (end if math.isfinite(end) else None for end in interval)
    return {"low": low, "high": high, "level": interval.level, "method": interval.method}


def proportion_document(fraction: Proportion | None) -> dict[str, Any] | None:
    """A proportion with its interval."""
    if fraction is None:
        return None
    results = {"successes": fraction.successes, "trials": fraction.trials, "value": fraction.value}
    return {**results, "interval": interval_document(fraction.interval())}


def _counts(counts: Counts | None) -> dict[str, Any] | None:
    if counts is None:
        return None
    return {
        **_fields(counts, "true_positives", "false_negatives", "true_negatives", "false_positives"),
        "sensitivity": proportion_document(counts.sensitivity if counts.present else None),
        "specificity": proportion_document(counts.specificity if counts.absent else None),
        **_fields(counts, "accuracy"),
    }


def _roc(curve: Roc) -> dict[str, Any]:
    return {
        "thresholds": [None if math.isinf(threshold) else float(threshold) for threshold in curve.thresholds],
        "true_positive_rate": curve.true_positive_rate.tolist(),
        "false_positive_rate": curve.false_positive_rate.tolist(),
    }


def _point(point: OperatingPoint) -> dict[str, Any]:
    return {**_fields(point, "rule", "threshold"), "counts": _counts(point.counts)}


def _reliability(curve: ReliabilityCurve) -> dict[str, Any]:
    return {
        "brier": curve.brier.score,
        **_fields(curve.brier, "reliability", "resolution", "uncertainty"),
        **_fields(curve, "expected_calibration_error"),
        "bins": [_fields(item, "low", "high", "probability", "observed") for item in curve.bins],
    }


def _recalibration(recalibration: Recalibration | None) -> dict[str, Any] | None:
    if recalibration is None:
        return None
    fitted = {name: getattr(recalibration, name) for name in ("slope", "intercept", "in_the_large")}
    return {
        name: {"value": item.value, "interval": interval_document(item.interval())} for name, item in fitted.items()
    }


def _errors_document(errors: SizeErrors) -> dict[str, Any]:
    return {
        "quantity": errors.quantity,
        "targets": len(errors.codes),
        **_fields(errors, "bias", "bias_interval", "rmse", "largest"),
        "covered_by_90_percent_intervals": proportion_document(errors.covered),
        "not_identified": errors.not_identified,
    }


def _agreement(agreement: Agreement) -> dict[str, Any]:
    return {
        **_fields(agreement, "quantity", "between", "targets", "operators", "repeats", "form"),
        "correlation": _fields(agreement.correlation, "value", "interval", "remark"),
        "coefficient": _fields(agreement.coefficient, "value", "interval", "remark"),
    }


def _comparison(device_comparison: DeviceComparison) -> dict[str, Any]:
    areas = ("first_auc", "second_auc", "difference", "interval", "p", "method", "remark")
    return {
        **_fields(device_comparison, "first", "second", "targets", "remark"),
        "areas": None if device_comparison.areas is None else _fields(device_comparison.areas, *areas),
        "limits_of_agreement": {name: limits_document(limit) for name, limit in device_comparison.limits.items()},
    }


def limits_document(bland_altman: BlandAltman) -> dict[str, Any]:
    """Bias and limits of agreement with their intervals."""
    bias, limits = limit_intervals(bland_altman)
    return {
        **_fields(bland_altman, "targets", "bias"),
        "bias_interval": interval_document(bias),
        "limits": list(bland_altman.limits()),
        "limit_intervals": [interval_document(limit) for limit in limits],
    }


def limit_intervals(bland_altman: BlandAltman) -> tuple[Interval | None, tuple[Interval | None, Interval | None]]:
    """Intervals of the bias and of both limits; None where all differences are equal."""
    try:
        return bland_altman.bias_interval(), bland_altman.limit_intervals()
    except InputError:
        return None, (None, None)


NUMBERS = ("", "value", "95 % interval", "method")


def device_tables(device_analysis: DeviceAnalysis) -> Iterator[Table]:
    """All tables of a device, the most important first."""
    device = device_analysis.results.device
    title = f"{device}: at the threshold {device_analysis.results.threshold:g}, which was fixed beforehand"
    yield Table(title=title, columns=NUMBERS, values=tuple(_at_threshold(device_analysis)))
    if device_analysis.points:
        ranked = device_analysis.results.is_ranked
        threshold = "threshold of the logarithm of the Bayes factor" if ranked else "threshold"
        yield Table(
            title=f"{device}: other thresholds, chosen on these very targets and so optimistic",
            columns=("rule", threshold, "sensitivity", "95 % interval", "specificity", "95 % interval"),
            values=tuple(_points(device_analysis)),
        )
    if device_analysis.reliability is not None:
        yield Table(
            title=f"{device}: scores taken for probabilities", columns=NUMBERS, values=tuple(_probable(device_analysis))
        )
    if device_analysis.errors:
        yield Table(
            title=f"{device}: what was read of inclusions that were found, less what is true",
            columns=("", "targets", "mean error", "95 % interval", "rms error", "largest",
                      "90 % intervals that hold the truth", "not identified"),
            values=tuple(_errors(device_analysis)),
        )  # fmt: skip
    yield Table(
        title=f"{device}: found by size and by depth",
        columns=("inclusions", "found", "95 % interval", "undecided"),
        values=tuple(_strata(device_analysis)),
    )
    if device_analysis.agreements:
        yield Table(
            title=f"{device}: how well readings of the same target agree",
            columns=("quantity", "", "rests on", "correlation", "95 % interval", "two readings differ by less than",
                      "95 % interval"),
            values=tuple(_agreements(device_analysis)),
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
        yield (quantity_of(error.quantity).heading, str(len(error.codes)), *numbers, stored, str(error.not_identified))


def _strata(device_analysis: DeviceAnalysis) -> Iterator[tuple[str, ...]]:
    for item in device_analysis.strata:
        name, unit = quantity_of(item.quantity).label, quantity_of(item.quantity).unit
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
        form, unit = agreement.form, quantity_of(agreement.quantity).unit
        yield (
            quantity_of(agreement.quantity).label,
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
        remark = areas.remark or ends(areas.interval)
        by = method_of(areas.interval) + ("" if areas.p is None else f", p = {areas.p:.2g}")
        rows.append(("difference of areas", f"{areas.difference:+.3f}", remark, by))
    for name, limit in device_comparison.limits.items():
        rows += limit_rows(name, limit)
    devices = f"{device_comparison.second} beside {device_comparison.first}"
    title = f"{devices}, on {device_comparison.targets} targets that both decided"
    return Table(title=title, columns=NUMBERS, values=tuple(rows))


def limit_rows(name: str, bland_altman: BlandAltman) -> list[tuple[str, str, str, str]]:
    """Bias, lower and upper limit of agreement of a quantity, each with its interval."""
    bias, limits = limit_intervals(bland_altman)
    what = f"{quantity_of(name).heading}: bias, {bland_altman.targets} inclusions"
    rows = [(what, f"{bland_altman.bias:+.2f}", ends(bias, 2), method_of(bias))]
    for side, limit, interval in zip(("lower", "upper"), bland_altman.limits(), limits, strict=True):
        rows.append(
            (f"{quantity_of(name).heading}: {side} limit", f"{limit:+.2f}", ends(interval, 2), method_of(interval))
        )
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
    return Table(title="Every target", columns=headings, values=tuple(rows))


def _decision_text(device: DeviceResults, target: TargetResult) -> str:
    if target.reading is None:
        return "not read"
    if target.score is None:
        return f"undecided: {target.reading.reason}"
    right = device.calls(target) == target.truth.has_inclusion
    return f"{score_text(target.score, probability=device.are_probabilities)} {'right' if right else 'WRONG'}"


SQUARE = (4.6, 4.2)


def study_pictures(analysis: StudyAnalysis) -> Iterator[Picture]:
    """Curves of all devices, the results of each, then comparisons."""
    if any(device.curve is not None for device in analysis.devices):
        yield _curves(analysis)
    for device in analysis.devices:
        yield from _of_device(device)
    for comparison in analysis.comparisons:
        if comparison.limits:
            yield _limits(comparison)


def _curves(analysis: StudyAnalysis) -> Picture:
    shown = [device for device in analysis.devices if device.curve is not None]
    text = "; ".join(
        f"{item.results.device}: area {item.curve.auc:.3f}, 95 % interval {ends(item.auc_interval)} "
        f"({method_of(item.auc_interval)})"
        for item in shown
        if item.curve is not None
    )

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        for item, colour in zip(shown, DEVICE_COLOURS * len(shown), strict=False):
            if item.curve is not None:
                whole = item.counts is not None and item.counts.present and item.counts.absent
                counts = item.counts if whole else None
                roc_curve(item.curve, ax, label=item.results.device, counts=counts, colour=colour)
        ax.legend(frameon=False, fontsize=8, loc="lower right")

    return Picture(
        title="Sensitivity over 1 - specificity",
        draw=draw,
        size=SQUARE,
        alt=f"Curve of each of {counted(len(shown), 'device')}",
        caption=f"{text}. The point is the threshold that was fixed, with both Wilson intervals; grey is chance.",
    )


def _of_device(device_analysis: DeviceAnalysis) -> Iterator[Picture]:
    device, results = device_analysis.results.device, device_analysis.results
    scores, present = results.scores()
    if len(scores):
        yield Picture(
            title=f"{device}: scores",
            draw=on_axes(scores_by_truth, scores, present, threshold=results.threshold),
            size=SQUARE,
            alt=f"Scores of {int(present.sum())} targets with an inclusion and {int((~present).sum())} blanks",
            caption="Each dot is a target, by its first reading.",
        )
    if device_analysis.reliability is not None:
        yield Picture(
            title=f"{device}: are its probabilities right?",
            draw=on_axes(reliability_diagram, device_analysis.reliability),
            size=SQUARE,
            alt="Fractions that came true over probabilities; Brier score "
            f"{small(device_analysis.reliability.brier.score)}, 95 % interval {ends(device_analysis.brier_interval)}",
            caption="On the grey line they are. Bars are Wilson intervals, numbers count targets.",
        )
    if any(target.truth.has_inclusion for target in results.targets):
        yield Picture(
            title=f"{device}: found and missed",
            draw=partial(_draw_detected, device_analysis),
            size=SQUARE,
            alt=f"Inclusions over size and depth; {len(results.detected)} were found. See the table of targets.",
            caption="Each mark is an inclusion, deep ones below.",
        )
    if device_analysis.errors:
        yield Picture(
            title=f"{device}: what it read, beside what is true",
            draw=partial(_draw_errors, device_analysis.errors, device_analysis),
            size=(10.5, 3.6),
            alt="; ".join(
                f"{quantity_of(error.quantity).heading}: rms error {error.rmse:.2f}" for error in device_analysis.errors
            ),
            caption="Inclusions that were found. On the grey line reading and truth agree"
            + ("; bars are 90 % intervals." if any(error.covered for error in device_analysis.errors) else "."),
            wide=True,
        )


def _draw_detected(device_analysis: DeviceAnalysis, figure: Figure) -> None:
    inside = [
        target
        for target in device_analysis.results.targets
        if target.truth.has_inclusion and target.reading is not None
    ]
    detected_by_size_and_depth(
        [target.truth.values["diameter_mm"] for target in inside],
        [target.truth.values["depth_mm"] for target in inside],
        [None if target.score is None else device_analysis.results.calls(target) for target in inside],
        figure.subplots(),
    )


def _draw_errors(errors: tuple[SizeErrors, ...], device_analysis: DeviceAnalysis, figure: Figure) -> None:
    readings = {target.code: target.reading for target in device_analysis.results.detected}
    for error, ax in zip(errors, figure.subplots(1, len(errors), squeeze=False)[0], strict=True):
        both = [readings[code] for code in error.codes]
        intervals = [None if reading is None else reading.interval_90.get(error.quantity) for reading in both]
        bars = None
        if all(interval is not None for interval in intervals):
            outer = np.array([interval for interval in intervals if interval is not None])
            bars = np.maximum([error.read - outer[:, 0], outer[:, 1] - error.read], 0.0)
        read_over_true(error.true, error.read, ax, label=quantity_of(error.quantity).heading, errors=bars)


def _limits(comparison: DeviceComparison) -> Picture:
    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, len(comparison.limits), squeeze=False)[0]
        for (name, limit), ax in zip(comparison.limits.items(), axes, strict=True):
            agreement_limits(limit, ax, label=quantity_of(name).heading)

    text = "; ".join(
        f"{quantity_of(name).heading}: bias {limit.bias:+.2f}" for name, limit in comparison.limits.items()
    )
    return Picture(
        title=f"{comparison.first} less {comparison.second}",
        draw=draw,
        size=(10.5, 3.6),
        alt=text,
        caption="After Bland and Altman: bias, and dashed the limits between which 95 % of differences lie.",
        wide=True,
    )


ANALYSIS, READINGS, PAGE, PAPER = "analysis.json", "readings.csv", "report.html", "report.pdf"
NOT_REPORTED = (
    (
        "The virtual probe",
        "Its presses, its light and its camera follow the same laws as the estimator, on a finer mesh and with errors "
        "of the sizes that the calibration states. What real gel, skin, hands and cameras add is not in these numbers.",
    ),
    (
        "The prior",
        "Before it saw a frame the estimator believed the ranges of size, depth and modulus that the provenance tells, "
        "and an inclusion in one target of two. Where inclusions are rarer, the same press gives a lower probability.",
    ),
    (
        "These targets",
        "Rates hold for targets like these, found where the probe was put. Nobody searched for them.",
    ),
    (
        "Chosen thresholds",
        "A threshold that was chosen on these targets looks better here than it will on others.",
    ),
    ("Blindness", "The seal keeps people from reading the truth by accident. It does not keep out who opens its file."),
)


def study_page(analysis: StudyAnalysis) -> Page:
    """The page of the results with intervals and limitations."""
    plan, devices = analysis.study.plan, analysis.devices
    present = sum(truth.has_inclusion for truth in analysis.truths.values())
    forces = " and ".join(f"{force:g}" for force in plan.forces_n)
    pressed = f"{plan.probe}, {forces} N, " + ("each with a press on plain tissue" if plan.with_reference else "alone")
    return Page(
        title=f"Study {plan.name}",
        subtitle=f"{present} targets with an inclusion and {len(plan.codes) - present} without, read blind, in "
        f"an order by chance; {', '.join(device.results.device for device in devices)}",
        cards=(
            _record_card(analysis),
            *(card for device in devices for card in _cards(device, several=len(devices) > 1)),
        ),
        notes=(
            *record_notes(analysis),
            *(note for device in devices for note in (*few_notes(device), *undecided_notes(device))),
            f"What counts is {ANALYSED_READING}: the lowest repeat of the operator who began with it. Repeats serve to "
            "tell how well readings agree. Intervals hold 95 %, unless said otherwise, for each number by itself.",
        ),
        pictures=tuple(study_pictures(analysis)),
        tables=(
            *(table for device in devices for table in device_tables(device)),
            *(comparison_table(comparison) for comparison in analysis.comparisons),
            targets_table(analysis),
            Table(title="What this study does not tell", columns=("of", "why"), values=NOT_REPORTED),
        ),
        provenance=_provenance(analysis, pressed),
    )


def study_files(analysis: StudyAnalysis) -> dict[str, bytes]:
    """The files of the report by name: HTML, PDF, JSON, and a table of all readings."""
    from tsis.present.pdf import pdf_bytes

    page = study_page(analysis)
    return {
        PAGE: html_bytes(page),
        PAPER: pdf_bytes(page),
        ANALYSIS: json_bytes(study_document(analysis)),
        READINGS: table_bytes(_reading_rows(analysis)),
    }


def _record_card(analysis: StudyAnalysis) -> Card:
    result = analysis.verification
    if result.sound:
        return Card(title="The record", value="as written", detail=f"head {result.head[:16]}, {result.lines} lines")
    count = len(result.faults)
    return Card(
        title="The record",
        value="CHANGED",
        detail=f"{count} {'place differs' if count == 1 else 'places differ'} from what was written; see below",
        doubtful=True,
    )


def _cards(device_analysis: DeviceAnalysis, *, several: bool) -> tuple[Card, ...]:
    of = f", {device_analysis.results.device}" if several else ""
    counts, cards = device_analysis.counts, []
    rates = {}
    if counts is not None and counts.present:
        rates["Sensitivity"] = counts.sensitivity
    if counts is not None and counts.absent:
        rates["Specificity"] = counts.specificity
    for name, rate in rates.items():
        detail = f"{rate.successes} of {rate.trials}; {interval_text(rate)}, Wilson"
        cards.append(Card(title=f"{name}{of}", value=f"{100 * rate.value:.3g} %", detail=detail))
    if device_analysis.curve is not None:
        detail = f"{ends(device_analysis.auc_interval)}, {method_of(device_analysis.auc_interval)}"
        area = f"{device_analysis.curve.auc:.3f}"
        cards.append(Card(title=f"Area under the curve{of}", value=area, detail=detail))
    if device_analysis.reliability is not None:
        interval = device_analysis.brier_interval
        detail = "no interval" if interval is None else f"{ends(interval)}, {method_of(interval)}"
        score = small(device_analysis.reliability.brier.score)
        cards.append(Card(title=f"Brier score{of}", value=score, detail=detail))
    return tuple(cards)


def _provenance(analysis: StudyAnalysis, pressed: str) -> dict[str, Any]:
    plan, study = analysis.study.plan, analysis.study
    prior = next((reading.evidence["prior"] for reading in study.readings if "prior" in reading.evidence), None)
    return {
        "study": {"name": plan.name, "made": plan.made.isoformat(), "tsis": plan.tsis},
        "virtual probe": pressed,
        "seed": "in the seal" if plan.seed is None else plan.seed,
        "threshold fixed beforehand": plan.threshold,
        "sealed truth (SHA-256)": plan.commitment,
        **({} if prior is None else {"prior of the virtual probe": prior}),
        "head of the log": analysis.verification.head,
        "unblinded": analysis.verification.unblinded,
    }


def _reading_rows(analysis: StudyAnalysis) -> list[list[Any]]:
    headings = ["code", "label", "present", *(f"true_{name}" for name in QUANTITIES), "device", "operator", "repeat"]
    rows: list[list[Any]] = [
        [*headings, "score", *QUANTITIES, *(f"sd_{name}" for name in QUANTITIES), "flags", "reason"]
    ]
    for reading in analysis.study.readings:
        truth = analysis.truths[reading.code]
        existing = [truth.values.get(name) for name in QUANTITIES]
        messages = [
            reading.score,
            *(reading.values.get(name) for name in QUANTITIES),
            *(reading.sd.get(name) for name in QUANTITIES),
        ]
        by = [reading.device, reading.operator, reading.repeat]
        of = [reading.code, truth.label, truth.has_inclusion]
        rows.append([*of, *existing, *by, *messages, " ".join(reading.flags), reading.reason])
    return rows


FOLDER = "analysis"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PublishedStudy:
    """A written report: the analysis, the study with the entry of this analysis, and the folder of the files."""

    analysis: StudyAnalysis
    study: Study
    folder: Path


def publish_study(
    study: Study, *, by: str, out: Path | None = None, progress: Callable[[int, int], None] | None = None
) -> PublishedStudy:
    """Analyse a study with readings, unblind it if it is still blind, and write the report.

    The analysis is computed, and its report drawn, before the unblinding is entered: what fails leaves the study blind.
    The folder, by default ``analysis`` in the study, gets a number where it exists. ``progress`` is called with (done,
    total) devices.

    Raises
    ------
    FileInputError
        When the folder cannot be written.
    RecordsError
        When there is no reading, or the truth cannot be read.
    """
    position = _study_path(study) if out is None else free_folder(out)
    require_room(position)  # before the irreversible unblinding
    for device in study.devices:
        study.threshold_of(device)
    analysis = unblind_and_analyse(study, by=by, publish=study_files, progress=progress)
    files = study_files(analysis)
    folder = write_folder(position, files)
    inside = folder.name if folder.parent == study.folder.resolve() else ""
    entries = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    return PublishedStudy(
        analysis=analysis, study=enter_analysis(analysis.study, by=by, folder=inside, files=entries), folder=folder
    )


def _study_path(study: Study) -> Path:
    """A new folder in the study whose name is not in the log, even of a deleted report."""
    existing = [entry.content.get("folder") for entry in study.chain.entries if entry.action == ANALYSED]
    names = itertools.chain([FOLDER], (f"{FOLDER}-{number}" for number in itertools.count(2)))
    return next(study.folder / name for name in names if name not in existing and not (study.folder / name).exists())
