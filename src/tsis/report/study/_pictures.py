"""Pictures of a study."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tsis.plots import (
    TRIAL_COLOURS,
    agreement_limits,
    found_by_place,
    read_over_true,
    reliability_diagram,
    roc_curve,
    scores_by_truth,
)
from tsis.report._page import Picture
from tsis.report.study._text import counted, ends, labelled, method_of, small

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from tsis.study.analysis import DeviceAnalysis, DeviceComparison, FoundErrors, StudyAnalysis


SQUARE = (4.6, 4.2)


def study_pictures(analysis: StudyAnalysis) -> Iterator[Picture]:
    """Curves of all devices, then what each said, then comparisons."""
    if any(one.curve is not None for one in analysis.devices):
        yield _curves(analysis)
    for one in analysis.devices:
        yield from _of_device(one)
    for comparison in analysis.comparisons:
        if comparison.limits:
            yield _limits(comparison)


def _curves(analysis: StudyAnalysis) -> Picture:
    shown = [one for one in analysis.devices if one.curve is not None]
    words = "; ".join(
        f"{one.judged.device}: area {one.curve.auc:.3f}, 95 % interval {ends(one.auc_interval)} "
        f"({method_of(one.auc_interval)})"
        for one in shown
        if one.curve is not None
    )

    def draw(figure: Figure) -> None:
        ax = figure.subplots()
        for one, colour in zip(shown, TRIAL_COLOURS * len(shown), strict=False):
            if one.curve is not None:
                whole = one.counts is not None and one.counts.present and one.counts.absent
                counts = one.counts if whole else None
                roc_curve(one.curve, ax, label=one.judged.device, counts=counts, colour=colour)
        ax.legend(frameon=False, fontsize=8, loc="lower right")

    return Picture(
        title="Sensitivity over 1 - specificity",
        draw=draw,
        size=SQUARE,
        alt=f"Curve of each of {counted(len(shown), 'device')}",
        caption=f"{words}. The point is the threshold that was fixed, with both Wilson intervals; grey is chance.",
    )


def _of_device(one: DeviceAnalysis) -> Iterator[Picture]:
    device, judged = one.judged.device, one.judged
    scores, present = judged.scores()
    if len(scores):
        yield Picture(
            title=f"{device}: scores",
            draw=lambda figure: _draw_scores(figure, one),
            size=SQUARE,
            alt=f"Scores of {int(present.sum())} targets with an inclusion and {int((~present).sum())} blanks",
            caption="Each dot is a target, by its first reading.",
        )
    if one.reliability is not None:
        yield Picture(
            title=f"{device}: are its probabilities right?",
            draw=partial(_draw_reliability, one),
            size=SQUARE,
            alt=f"Shares that came true over probabilities; Brier score {small(one.reliability.brier.score)}, 95 % "
            f"interval {ends(one.brier_interval)}",
            caption="On the grey line they are. Bars are Wilson intervals, numbers count targets.",
        )
    if any(target.truth.has_inclusion for target in judged.targets):
        yield Picture(
            title=f"{device}: found and missed",
            draw=partial(_draw_found, one),
            size=SQUARE,
            alt=f"Inclusions over size and depth; {len(judged.found)} were found. See the table of targets.",
            caption="Each mark is an inclusion, deep ones below.",
        )
    if one.errors:
        yield Picture(
            title=f"{device}: what it read, beside what is true",
            draw=partial(_draw_errors, one.errors, one),
            size=(10.5, 3.6),
            alt="; ".join(f"{labelled(each.quantity)}: rms error {each.rmse:.2f}" for each in one.errors),
            caption="Inclusions that were found. On the grey line reading and truth agree"
            + ("; bars are 90 % intervals." if any(each.covered for each in one.errors) else "."),
            wide=True,
        )


def _draw_scores(figure: Figure, one: DeviceAnalysis) -> None:
    scores_by_truth(*one.judged.scores(), figure.subplots(), threshold=one.judged.threshold)


def _draw_reliability(one: DeviceAnalysis, figure: Figure) -> None:
    assert one.reliability is not None
    reliability_diagram(one.reliability, figure.subplots())


def _draw_found(one: DeviceAnalysis, figure: Figure) -> None:
    inside = [target for target in one.judged.targets if target.truth.has_inclusion and target.reading is not None]
    found_by_place(
        [target.truth.values["diameter_mm"] for target in inside],
        [target.truth.values["depth_mm"] for target in inside],
        [None if target.score is None else one.judged.calls(target) for target in inside],
        figure.subplots(),
    )


def _draw_errors(errors: tuple[FoundErrors, ...], one: DeviceAnalysis, figure: Figure) -> None:
    readings = {target.code: target.reading for target in one.judged.found}
    for each, ax in zip(errors, figure.subplots(1, len(errors), squeeze=False)[0], strict=True):
        both = [readings[code] for code in each.codes]
        intervals = [
            None if one_reading is None else one_reading.interval_90.get(each.quantity) for one_reading in both
        ]
        bars = None
        if all(interval is not None for interval in intervals):
            outer = np.array([interval for interval in intervals if interval is not None])
            bars = np.maximum([each.read - outer[:, 0], outer[:, 1] - each.read], 0.0)
        read_over_true(each.true, each.read, ax, label=labelled(each.quantity), errors=bars)


def _limits(comparison: DeviceComparison) -> Picture:
    def draw(figure: Figure) -> None:
        axes = figure.subplots(1, len(comparison.limits), squeeze=False)[0]
        for (name, found), ax in zip(comparison.limits.items(), axes, strict=True):
            agreement_limits(found, ax, label=labelled(name))

    words = "; ".join(f"{labelled(name)}: bias {found.bias:+.2f}" for name, found in comparison.limits.items())
    return Picture(
        title=f"{comparison.first} less {comparison.second}",
        draw=draw,
        size=(10.5, 3.6),
        alt=words,
        caption="After Bland and Altman: bias, and dashed the limits between which 95 % of differences lie.",
        wide=True,
    )
