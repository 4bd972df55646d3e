"""A study as texts for its numbers, and as a JSON document."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.report._document import envelope
from tsis.study.analysis import FEW
from tsis.study.proportions import Interval, Proportion

if TYPE_CHECKING:
    from tsis.study.agreement import BlandAltman
    from tsis.study.analysis import Agreement, DeviceAnalysis, DeviceComparison, SizeErrors, StudyAnalysis
    from tsis.study.folder import StudyVerification
    from tsis.study.probabilities import Recalibration, ReliabilityCurve
    from tsis.study.proportions import Counts
    from tsis.study.roc import OperatingPoint, Roc


NAMES = {
    "score": ("score", ""),
    "diameter_mm": ("diameter", "mm"),
    "depth_mm": ("depth", "mm"),
    "young_kpa": ("modulus", "kPa"),
}
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


def labelled(quantity: str) -> str:
    """Name and unit.

    Examples
    --------
    >>> labelled("depth_mm"), labelled("score")
    ('depth / mm', 'score')
    """
    name, unit = NAMES[quantity]
    return f"{name} / {unit}" if unit else name


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


def counted(count: int, what: str) -> str:
    """A number of things.

    Examples
    --------
    >>> counted(1, "target"), counted(2, "target")
    ('1 target', '2 targets')
    """
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


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
        "errors": [_errors(error) for error in device_analysis.errors],
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


def _errors(errors: SizeErrors) -> dict[str, Any]:
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
