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
        FoundErrors,
        StudyAnalysis,
    )


def study_document(analysis: StudyAnalysis) -> dict[str, Any]:
    """All of it, as plain values with the names of Python; null where something could not be told."""
    plan = analysis.study.plan
    scores = {one.judged.device: {each.code: each.score for each in one.judged.targets} for one in analysis.devices}
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
        devices=[_device(one) for one in analysis.devices],
        comparisons=[_comparison(one) for one in analysis.comparisons],
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


def study_verification_document(found: StudyVerification) -> dict[str, Any]:
    """Whether a study is as it was written."""
    return {
        "sound": found.sound,
        "faults": [str(fault) for fault in found.faults],
        "head": found.head,
        "lines": found.lines,
        "unblinded": found.unblinded,
    }


def _device(one: DeviceAnalysis) -> dict[str, Any]:
    judged = one.judged
    return {
        "device": judged.device,
        "threshold": judged.threshold,
        "readings": one.readings,
        "undecided_readings": one.undecided_readings,
        "decided_targets": len(judged.decided),
        "undecided_targets": [target.code for target in judged.undecided],
        "unread_targets": [target.code for target in judged.unread],
        "counts": _counts(one.counts),
        "counts_if_undecided_are_wrong": _counts(one.counts_if_wrong),
        "ranked_by": "log_bayes_factor" if judged.is_ranked else "score",
        "auc": None if one.curve is None else one.curve.auc,
        "auc_interval": interval_document(one.auc_interval),
        "auc_if_undecided_are_wrong": one.auc_if_wrong,
        "roc": None
        if one.curve is None
        else {
            "thresholds": [None if math.isinf(each) else float(each) for each in one.curve.thresholds],
            "true_positive_rate": one.curve.true_positive_rate.tolist(),
            "false_positive_rate": one.curve.false_positive_rate.tolist(),
        },
        "operating_points_optimistic": [_point(each) for each in one.points],
        "held_out_counts": _counts(one.held_out),
        "reliability": None if one.reliability is None else _reliability(one.reliability),
        "brier_interval": interval_document(one.brier_interval),
        "recalibration": None if one.recalibration is None else _recalibration(one.recalibration),
        "errors": [_errors(each) for each in one.errors],
        "found_by": [
            {
                "quantity": each.quantity,
                "low": each.low,
                "high": None if math.isinf(each.high) else each.high,
                "found": proportion_document(each.found),
                "undecided": each.undecided,
            }
            for each in one.strata
        ],
        "agreement": [_agreement(each) for each in one.agreements],
        "missing": dict(one.missing),
    }


def interval_document(interval: Interval | None) -> dict[str, Any] | None:
    """Both ends, the level and the method; an end that nothing bounds is null."""
    if interval is None:
        return None
    low, high = (end if math.isfinite(end) else None for end in interval)
    return {"low": low, "high": high, "level": interval.level, "method": interval.method}


def proportion_document(share: Proportion | None) -> dict[str, Any] | None:
    """So many of so many, and the interval."""
    if share is None:
        return None
    found = {"successes": share.successes, "trials": share.trials, "value": share.value}
    return {**found, "interval": interval_document(share.interval())}


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
                "low": one.low,
                "high": one.high,
                "probability": one.probability,
                "observed": proportion_document(one.observed),
            }
            for one in curve.bins
        ],
    }


def _recalibration(found: Recalibration) -> dict[str, Any]:
    named = {"slope": found.slope, "intercept": found.intercept, "in_the_large": found.in_the_large}
    return {
        name: {"value": fitted.value, "interval": interval_document(fitted.interval())}
        for name, fitted in named.items()
    }


def _errors(errors: FoundErrors) -> dict[str, Any]:
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


def _agreement(one: Agreement) -> dict[str, Any]:
    return {
        "quantity": one.quantity,
        "between": one.between,
        "targets": one.targets,
        "operators": one.operators,
        "repeats": one.repeats,
        "form": one.form,
        "correlation": _number(one.correlation),
        "coefficient": _number(one.coefficient),
    }


def _comparison(one: DeviceComparison) -> dict[str, Any]:
    areas = one.areas
    return {
        "first": one.first,
        "second": one.second,
        "targets": one.targets,
        "remark": one.remark,
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
        "limits_of_agreement": {name: _limits(found) for name, found in one.limits.items()},
    }


def _limits(found: BlandAltman) -> dict[str, Any]:
    bias, limits = limit_intervals(found)
    return {
        "targets": found.targets,
        "bias": found.bias,
        "bias_interval": interval_document(bias),
        "limits": list(found.limits()),
        "limit_intervals": [interval_document(limit) for limit in limits],
    }


def limit_intervals(found: BlandAltman) -> tuple[Interval | None, tuple[Interval | None, Interval | None]]:
    """Intervals of the bias and of both limits; None where all differences are equal."""
    try:
        return found.bias_interval(), found.limit_intervals()
    except InputError:
        return None, (None, None)
