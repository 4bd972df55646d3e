"""What a study says, as a document for programs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from tsis.errors import InputError
from tsis.report._document import envelope

if TYPE_CHECKING:
    from tsis.detection import (
        BlandAltman,
        Counts,
        Interval,
        OperatingPoint,
        Proportion,
        Recalibration,
        ReliabilityCurve,
    )
    from tsis.study import StudyVerification
    from tsis.study.analysis import (
        Agreement,
        AgreementValue,
        DeviceAnalysis,
        DeviceComparison,
        SizeErrors,
        StudyAnalysis,
    )


def study_document(analysis: StudyAnalysis) -> dict[str, Any]:
    """All of it, as plain values with the names of Python; null where something could not be told."""
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
            "probe": plan.probe,
            "forces_n": list(plan.forces_n),
            "with_reference": plan.with_reference,
            "repeats": plan.repeats,
            "threshold": plan.threshold,
        },
        verification=study_verification_document(analysis.verification),
        devices=[_device(device) for device in analysis.devices],
        comparisons=[_comparison(comparison) for comparison in analysis.comparisons],
        targets=[
            {
                "code": code,
                "present": truth.has_inclusion,
                **truth.plain(),
                "scores": {device: by_code[code] for device, by_code in scores.items()},
            }
            for code, truth in analysis.truths.items()
        ],
    )


def study_verification_document(study_verification: StudyVerification) -> dict[str, Any]:
    """Whether a study is as it was written."""
    return {
        "sound": study_verification.sound,
        "faults": [str(fault) for fault in study_verification.faults],
        "head": study_verification.head,
        "lines": study_verification.lines,
        "unblinded": study_verification.unblinded,
    }


def _device(device_analysis: DeviceAnalysis) -> dict[str, Any]:
    results = device_analysis.results
    return {
        "device": results.device,
        "threshold": results.threshold,
        "readings": device_analysis.readings,
        "undecided_readings": device_analysis.undecided_readings,
        "decided_targets": len(results.decided),
        "undecided_targets": [target.code for target in results.undecided],
        "unread_targets": [target.code for target in results.unread],
        "counts": _counts(device_analysis.counts),
        "counts_if_undecided_are_wrong": _counts(device_analysis.counts_if_wrong),
        "ranked_by": "log_bayes_factor" if results.is_ranked else "score",
        "auc": None if device_analysis.curve is None else device_analysis.curve.auc,
        "auc_interval": interval_document(device_analysis.auc_interval),
        "auc_if_undecided_are_wrong": device_analysis.auc_if_wrong,
        "roc": None
        if device_analysis.curve is None
        else {
            "thresholds": [
                None if math.isinf(threshold) else float(threshold) for threshold in device_analysis.curve.thresholds
            ],
            "true_positive_rate": device_analysis.curve.true_positive_rate.tolist(),
            "false_positive_rate": device_analysis.curve.false_positive_rate.tolist(),
        },
        "operating_points_optimistic": [_point(point) for point in device_analysis.points],
        "held_out_counts": _counts(device_analysis.held_out),
        "reliability": None if device_analysis.reliability is None else _reliability(device_analysis.reliability),
        "brier_interval": interval_document(device_analysis.brier_interval),
        "recalibration": None
        if device_analysis.recalibration is None
        else _recalibration(device_analysis.recalibration),
        "errors": [_errors(error) for error in device_analysis.errors],
        "found_by": [
            {
                "quantity": item.quantity,
                "low": item.low,
                "high": None if math.isinf(item.high) else item.high,
                "found": proportion_document(item.detected),
                "undecided": item.undecided,
            }
            for item in device_analysis.strata
        ],
        "agreement": [_agreement(agreement) for agreement in device_analysis.agreements],
        "missing": dict(device_analysis.missing),
    }


def interval_document(interval: Interval | None) -> dict[str, Any] | None:
    """Both ends, the level and the method; an end that nothing bounds is null."""
    if interval is None:
        return None
    low, high = (end if math.isfinite(end) else None for end in interval)
    return {"low": low, "high": high, "level": interval.level, "method": interval.method}


def proportion_document(fraction: Proportion | None) -> dict[str, Any] | None:
    """So many of so many, and the interval."""
    if fraction is None:
        return None
    results = {"successes": fraction.successes, "trials": fraction.trials, "value": fraction.value}
    return {**results, "interval": interval_document(fraction.interval())}


def _counts(counts: Counts | None) -> dict[str, Any] | None:
    if counts is None:
        return None
    return {
        "true_positives": counts.true_positives,
        "false_negatives": counts.false_negatives,
        "true_negatives": counts.true_negatives,
        "false_positives": counts.false_positives,
        "sensitivity": proportion_document(counts.sensitivity if counts.present else None),
        "specificity": proportion_document(counts.specificity if counts.absent else None),
        "accuracy": proportion_document(counts.accuracy),
    }


def _point(point: OperatingPoint) -> dict[str, Any]:
    threshold = point.threshold if math.isfinite(point.threshold) else None
    return {"rule": point.rule, "threshold": threshold, "counts": _counts(point.counts)}


def _reliability(curve: ReliabilityCurve) -> dict[str, Any]:
    brier = curve.brier
    return {
        "brier": brier.score,
        "reliability": brier.reliability,
        "resolution": brier.resolution,
        "uncertainty": brier.uncertainty,
        "expected_calibration_error": curve.expected_calibration_error,
        "bins": [
            {
                "low": item.low,
                "high": item.high,
                "probability": item.probability,
                "observed": proportion_document(item.observed),
            }
            for item in curve.bins
        ],
    }


def _recalibration(recalibration: Recalibration) -> dict[str, Any]:
    named = {
        "slope": recalibration.slope,
        "intercept": recalibration.intercept,
        "in_the_large": recalibration.in_the_large,
    }
    return {
        name: {"value": fitted.value, "interval": interval_document(fitted.interval())}
        for name, fitted in named.items()
    }


def _errors(errors: SizeErrors) -> dict[str, Any]:
    return {
        "quantity": errors.quantity,
        "targets": len(errors.codes),
        "bias": errors.bias,
        "bias_interval": interval_document(errors.bias_interval),
        "rmse": errors.rmse,
        "largest": errors.largest,
        "covered_by_90_percent_intervals": proportion_document(errors.covered),
        "not_identified": errors.not_identified,
    }


def _number(number: AgreementValue) -> dict[str, Any]:
    value = number.value if number.value is not None and math.isfinite(number.value) else None
    return {"value": value, "interval": interval_document(number.interval), "remark": number.remark}


def _agreement(agreement: Agreement) -> dict[str, Any]:
    return {
        "quantity": agreement.quantity,
        "between": agreement.between,
        "targets": agreement.targets,
        "operators": agreement.operators,
        "repeats": agreement.repeats,
        "form": agreement.form,
        "correlation": _number(agreement.correlation),
        "coefficient": _number(agreement.coefficient),
    }


def _comparison(device_comparison: DeviceComparison) -> dict[str, Any]:
    areas = device_comparison.areas
    return {
        "first": device_comparison.first,
        "second": device_comparison.second,
        "targets": device_comparison.targets,
        "remark": device_comparison.remark,
        "areas": None
        if areas is None
        else {
            "first_auc": areas.first_auc,
            "second_auc": areas.second_auc,
            "difference": areas.difference,
            "interval": interval_document(areas.interval),
            "p": areas.p,
            "method": areas.method,
            "remark": areas.remark,
        },
        "limits_of_agreement": {name: _limits(limit) for name, limit in device_comparison.limits.items()},
    }


def _limits(bland_altman: BlandAltman) -> dict[str, Any]:
    bias, limits = limit_intervals(bland_altman)
    return {
        "targets": bland_altman.targets,
        "bias": bland_altman.bias,
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
