"""Texts for the numbers of a study."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tsis.study.analysis import FEW

if TYPE_CHECKING:
    from tsis.detection import Interval, Proportion
    from tsis.study.analysis import DeviceAnalysis, StudyAnalysis


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
    >>> from tsis.detection import Proportion
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
