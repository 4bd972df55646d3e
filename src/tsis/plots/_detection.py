"""Figures of detection studies: curves, scores, reliability, detected inclusions, and agreement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from tsis.study.agreement import BlandAltman
    from tsis.study.drift import ControlChart
    from tsis.study.probabilities import ReliabilityCurve
    from tsis.study.proportions import Counts
    from tsis.study.roc import Roc
    from tsis.study.search import ScanPlan


BLUE, WARM, GREY = "#0072b2", "#d55e00", "0.45"
FAR = 4.0  # tolerances beyond that many half widths of the limits are not drawn


def roc_curve(curve: Roc, ax: Axes, *, label: str = "", counts: Counts | None = None, colour: str = BLUE) -> Axes:
    """Draw a ROC curve, the diagonal of chance, and the fixed threshold with both Wilson intervals.

    ``label`` names the detector; ``counts`` are its decisions at the fixed threshold.
    """
    ax.plot([0, 1], [0, 1], color="0.75", linewidth=1, zorder=1)
    style: dict[str, Any] = {"color": colour, "clip_on": False}
    rates = curve.false_positive_rate, curve.true_positive_rate
    ax.plot(*rates, drawstyle="steps-post", label=label or None, linewidth=1.8, **style)
    if counts is not None:
        result, false = counts.sensitivity, 1 - counts.specificity.value
        low, high = result.interval()
        least, most = counts.specificity.interval()
        across = [[max(false - (1 - most), 0.0)], [max(1 - least - false, 0.0)]]
        upwards = [[max(result.value - low, 0.0)], [max(high - result.value, 0.0)]]
        ax.errorbar(
            false, result.value, xerr=across, yerr=upwards, fmt="o", markersize=6, capsize=3, linewidth=1, **style
        )
    ax.set(xlim=(0, 1), ylim=(0, 1), xlabel="1 - specificity", ylabel="sensitivity", aspect="equal")
    return ax


def scores_by_truth(scores: ArrayLike, present: ArrayLike, ax: Axes, *, threshold: float) -> Axes:
    """Draw scores of targets with and without inclusion, both of shape (targets,), and the threshold."""
    values, truth = np.asarray(scores, dtype=float), np.asarray(present, dtype=bool)
    for index, (kind, colour) in enumerate(((False, GREY), (True, BLUE))):
        own = np.sort(values[truth == kind])
        beside = 0.5 * (np.arange(len(own)) / max(len(own) - 1, 1) - 0.5)
        ax.plot(index + beside, own, "o", color=colour, markersize=5, alpha=0.8, clip_on=False)
    ax.axhline(threshold, color=WARM, linestyle="--", linewidth=1.2, label=f"threshold {threshold:g}")
    ax.set(xlim=(-0.5, 1.5), ylabel="score")
    ax.set_xticks([0, 1], ["blank", "inclusion"])
    if len(values) and values.min() >= 0 and values.max() <= 1:
        ax.set_ylim(-0.02, 1.02)
    ax.legend(frameon=False, fontsize=8)
    return ax


def reliability_diagram(curve: ReliabilityCurve, ax: Axes) -> Axes:
    """Draw observed fractions over predicted probabilities by bin, with Wilson intervals; the diagonal is ideal."""
    ax.plot([0, 1], [0, 1], color="0.75", linewidth=1)
    predicted = np.array([item.probability for item in curve.bins])
    observed = np.array([item.observed.value for item in curve.bins])
    ends = np.array([tuple(item.observed.interval()) for item in curve.bins])
    errors = np.maximum([observed - ends[:, 0], ends[:, 1] - observed], 0.0)
    ax.errorbar(predicted, observed, yerr=errors, fmt="o-", color=BLUE, capsize=3, linewidth=1.2, clip_on=False)
    for item, x, y in zip(curve.bins, predicted, observed, strict=True):
        above = y < 0.5  # inside the frame
        ax.annotate(
            str(item.observed.trials), (x, y), xytext=(5, 5 if above else -11), textcoords="offset points", fontsize=7.5
        )
    ax.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="predicted probability", ylabel="fraction with an inclusion")
    ax.set_aspect("equal")
    return ax


def detected_by_size_and_depth(
    diameter_mm: ArrayLike, depth_mm: ArrayLike, result: Sequence[bool | None], ax: Axes
) -> Axes:
    """Draw inclusions over size and depth, deep ones below: found, missed and undecided.

    All have shape (inclusions,); ``result`` is None without a decision.
    """
    size, depth = np.asarray(diameter_mm, dtype=float), np.asarray(depth_mm, dtype=float)
    for response, marker, colour, label in (
        (True, "o", BLUE, "found"),
        (False, "X", WARM, "missed"),
        (None, "s", GREY, "undecided"),
    ):
        own = np.array([item is response for item in result], dtype=bool)
        if own.any():
            ax.plot(size[own], depth[own], marker, color=colour, label=label, markersize=7, alpha=0.85)
    ax.set(xlabel="diameter / mm", ylabel="depth / mm")
    ax.margins(0.12)
    ax.invert_yaxis()
    if ax.lines:
        ax.legend(frameon=False, fontsize=8)
    return ax


def read_over_true(true: ArrayLike, read: ArrayLike, ax: Axes, *, label: str, errors: ArrayLike | None = None) -> Axes:
    """Draw readings over true values, shape (targets,); on the diagonal they agree.

    ``label`` gives name and unit; ``errors`` the distances of both ends of an interval from the reading, shape (2,
    targets).
    """
    true_values, readings = np.asarray(true, dtype=float), np.asarray(read, dtype=float)
    both = np.concatenate([true_values, readings])
    room = 0.05 * float(np.ptp(both) or 1.0)
    ends = float(both.min()) - room, float(both.max()) + room
    ax.plot(ends, ends, color="0.75", linewidth=1)
    if errors is not None:
        ax.errorbar(true_values, readings, yerr=errors, fmt="none", color="0.65", linewidth=0.8)
    ax.plot(true_values, readings, "o", color=BLUE, markersize=5, alpha=0.85)
    ax.set(xlabel=f"true {label}", ylabel=f"read {label}")
    return ax


def agreement_limits(bland_altman: BlandAltman, ax: Axes, *, label: str) -> Axes:
    """Draw differences over means of two methods, with the bias and both limits of agreement.

    ``label`` gives name and unit of the quantity.
    """
    ax.plot(bland_altman.means, bland_altman.differences, "o", color=BLUE, markersize=5, alpha=0.85)
    ax.axhline(0.0, color="0.75", linewidth=1)
    ax.axhline(bland_altman.bias, color=WARM, linewidth=1.2, label="bias")
    for limit in bland_altman.limits():
        ax.axhline(limit, color=WARM, linewidth=1.2, linestyle="--")
    ax.set(xlabel=f"mean {label}", ylabel=f"difference of {label}")
    return ax


def drift_chart(chart: ControlChart, ax: Axes, *, label: str, tolerance: float) -> Axes:
    """Draw a control chart: values, their EWMA, both kinds of limits, and the tolerance on each side of the centre."""
    count, end = np.arange(1, len(chart.values) + 1), max(len(chart.values), chart.baseline + 1) + 0.5
    ax.axvspan(0.5, chart.baseline + 0.5, color="0.94", zorder=0, label="baseline")
    ax.plot(count, chart.values, "o", color=GREY, markersize=3.5, label="check")
    ax.plot(count, chart.ewma, "-", color=BLUE, linewidth=1.6, label="EWMA")
    for sign, shown in ((1, ("EWMA limits", "Shewhart limits", "out of tolerance")), (-1, (None, None, None))):
        ax.plot(count, chart.centre + sign * chart.ewma_half, ":", color=BLUE, linewidth=1.3, label=shown[0])
        edge = [chart.centre + sign * chart.shewhart] * 2
        ax.plot([chart.baseline + 0.5, end], edge, "--", color="0.25", linewidth=1.1, label=shown[1])
        if tolerance < FAR * chart.shewhart:
            ax.axhline(chart.centre + sign * tolerance, color=WARM, linewidth=1.2, label=shown[2])
    marked = chart.beyond_shewhart | chart.beyond_ewma
    ax.plot(count[marked], chart.values[marked], "o", color=WARM, markersize=4.5, label="beyond a limit")
    ax.set(xlabel="check", ylabel=label, xlim=(0.5, end))
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.legend(frameon=False, fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.18))
    return ax


FACE, RANGE, PATH, WORST = "#999999", "#0072b2", "#333333", "#d55e00"  # distinct without red-green vision


def draw_scan_plan(plan: ScanPlan, ax: Axes, *, extent_mm: float | None = None) -> Axes:
    """Draw the area, the face at each press, the path of the presses, and a point farthest from any press.

    Both axes get one scale. ``extent_mm`` is the detection range beside a press, drawn as filled discs.
    """
    from matplotlib.patches import Rectangle  # loaded with the first figure

    positions = plan.positions_mm
    if extent_mm is not None and extent_mm > 0:
        _discs(plan, ax, extent_mm, facecolor=RANGE, alpha=0.25)
        ax.plot([], [], "o", color=RANGE, alpha=0.25, label=f"within {extent_mm:.3g} mm of a press")
    _discs(plan, ax, plan.radius_mm, facecolor="none", edgecolor=FACE, linewidth=0.6)
    ax.plot([], [], "o", color=FACE, markerfacecolor="none", label="face of the probe")
    ax.add_patch(Rectangle((0.0, 0.0), plan.width_mm, plan.height_mm, fill=False, linewidth=1.5, label="area"))
    ax.plot(*positions.T, "-", color=PATH, linewidth=0.8, marker=".", markersize=4, label="path of the presses")
    ax.plot(*positions[0], "o", color=PATH, markersize=6, label="first press")
    at = positions[0] + (plan.strip_spacing_mm / 2, plan.press_spacing_mm / 2)
    farthest = f"farthest from any press, {plan.worst_distance_mm:.3g} mm"
    ax.plot(*at, "x", color=WORST, markersize=8, markeredgewidth=2, label=farthest)
    margin = max(plan.radius_mm, *plan.overhang_mm, 1.0)
    ax.set(
        xlim=(-margin, plan.width_mm + margin),
        ylim=(-margin, plan.height_mm + margin),
        aspect="equal",
        xlabel="across strips / mm",
        ylabel="along strips / mm",
    )
    return ax


def _discs(plan: ScanPlan, ax: Axes, radius_mm: float, **view: object) -> None:
    """Draw a disc around each press as one artist without legend: a plan may have thousands."""
    from matplotlib.collections import EllipseCollection

    size = [2 * radius_mm]
    discs = EllipseCollection(
        size, size, [0.0], units="xy", offsets=plan.positions_mm, transOffset=ax.transData, **view
    )  # fmt: skip
    ax.add_collection(discs)
