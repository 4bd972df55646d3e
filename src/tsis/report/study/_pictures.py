"""Pictures of a study."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tsis.plots import (
    TRIAL_COLOURS,
    agreement_limits,
    detected_by_size_and_depth,
    read_over_true,
    reliability_diagram,
    roc_curve,
    scores_by_truth,
)
from tsis.report._page import Picture, on_axes
from tsis.report.study._text import counted, ends, labelled, method_of, small

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from tsis.study.analysis import DeviceAnalysis, DeviceComparison, SizeErrors, StudyAnalysis


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
        for item, colour in zip(shown, TRIAL_COLOURS * len(shown), strict=False):
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
                f"{labelled(error.quantity)}: rms error {error.rmse:.2f}" for error in device_analysis.errors
            ),
            caption="Inclusions that were found. On the grey line reading and truth agree"
            + ("; bars are 90 % intervals." if any(error.covered for error in device_analysis.errors) else "."),
            wide=True,
        )


def _draw_detected(device_analysis: DeviceAnalysis, figure: Figure) -> None:
    targets = device_analysis.results.targets
    inside = [target for target in targets if target.truth.has_inclusion and target.reading is not None]
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
        read_over_true(error.true, error.read, ax, label=labelled(error.quantity), errors=bars)


def _limits(comparison: DeviceComparison) -> Picture:
    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, len(comparison.limits), squeeze=False)[0]
        for (name, limit), ax in zip(comparison.limits.items(), axes, strict=True):
            agreement_limits(limit, ax, label=labelled(name))

    text = "; ".join(f"{labelled(name)}: bias {limit.bias:+.2f}" for name, limit in comparison.limits.items())
    return Picture(
        title=f"{comparison.first} less {comparison.second}",
        draw=draw,
        size=(10.5, 3.6),
        alt=text,
        caption="After Bland and Altman: bias, and dashed the limits between which 95 % of differences lie.",
        wide=True,
    )
