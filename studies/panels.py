"""Panels of the dissertation's figures that no result of tsis has: its readings, sums and trials beside the printed."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from tsis.inclusion.relative import Repeats

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # distinct without red-green vision
HERE, PRINTED = COLOURS[:2]
LEVEL_STYLES = ("-", "--", ":", "-.")
MARKS = "oxs"
MILLION = 1e6
BAR_OFFSET = 0.12  # distance of the two bars of one target, in targets


def modulus_readings(
    young_kpa: NDArray[np.float64], ax: Axes, *, truth_kpa: float, label: str, series: int = 0
) -> Axes:
    """Draw repeated readings of one object's modulus, kPa, shape (n,), and a line at its true one (figure 5.23).

    Several objects may share the axes; ``series``, from 0, selects the colour and mark of each.
    """
    colour, mark = COLOURS[series % 3], MARKS[series % len(MARKS)]
    number = np.arange(1, len(young_kpa) + 1)
    ax.plot(number, young_kpa, mark, color=colour, markerfacecolor="none", label=label)
    ax.axhline(truth_kpa, color=colour, linewidth=1, linestyle="--", label=f"{label}, {truth_kpa:g} kPa")
    highest = max(float(ax.dataLim.y1), truth_kpa)
    ax.set(xlabel="reading", ylabel="modulus E / kPa", ylim=(0.0, 1.1 * highest))
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False, fontsize="small")
    return ax


def grey_sums(
    force_n: NDArray[np.float64], sums: NDArray[np.float64], ax: Axes, *, label: str = "", marker: str = "o"
) -> Axes:
    """Draw sums of grey levels, in millions, over forces in newtons, and the least-squares line from 0 N.

    Both have shape (presses,), at least two; the line has no label.
    """
    (drawn,) = ax.plot(force_n, sums / MILLION, marker, markersize=4, label=label)
    slope, intercept = np.polyfit(force_n, sums / MILLION, 1)
    ends = np.array([0.0, force_n.max()])
    ax.plot(ends, intercept + slope * ends, linewidth=0.8, color=drawn.get_color())
    ax.set(xlabel="force / N", ylabel="sum of grey levels / 10⁶")
    ax.set(xlim=(0.0, 1.05 * ax.dataLim.x1), ylim=(0.0, 1.05 * ax.dataLim.y1))  # of all that was drawn so far
    ax.grid(visible=True, alpha=0.3)
    return ax


def repeated_readings(
    targets: Sequence[Repeats],
    ax: Axes,
    *,
    printed_mean: Sequence[float] | None = None,
    printed_sd: Sequence[float | None] | None = None,
    label: str = "virtual presses",
) -> Axes:
    """Draw mean and standard deviation of each target, and published ones beside them (figures 6.5, 6.11 and 6.15).

    All readings are of one kind; published values are in their unit, one for each target, without a bar where the
    deviation is None.
    """
    position = np.arange(len(targets), dtype=float)
    shift = 0.0 if printed_mean is None else BAR_OFFSET
    means, deviations = [target.mean for target in targets], [target.sd for target in targets]
    ax.errorbar(position - shift, means, yerr=np.nan_to_num(deviations), fmt="o", capsize=5, color=HERE, label=label)
    if printed_mean is not None:
        bars = [sd or 0.0 for sd in printed_sd or [None] * len(targets)]
        ax.errorbar(position + shift, printed_mean, yerr=bars, fmt="s", capsize=5, color=PRINTED, label="printed")
    reading = targets[0].readings[0]
    ax.set(xlim=(-0.5, len(targets) - 0.5), ylabel=f"{reading.quantity} / {reading.unit}")
    ax.set_xticks(position, [target.label for target in targets])
    ax.set_ylim(bottom=0.0)
    ax.grid(visible=True, axis="y", alpha=0.3)
    return ax


def trial_errors(
    errors: Mapping[str, ArrayLike],
    ax: Axes,
    *,
    levels: Mapping[str, float],
    error_label: str,
    top: float | None = None,
) -> Axes:
    """Draw the error of each trial, a colour for each method, with horizontal lines at published errors.

    ``errors`` has shape (trials,) by method, ``levels`` the values of the lines by name. Errors beyond ``top`` are
    drawn there as triangles; by default the axis shows all.
    """
    for colour, (name, values) in zip(itertools.cycle(COLOURS), errors.items(), strict=False):
        shown = np.asarray(values, dtype=float)
        trial = np.arange(1, len(shown) + 1)
        beyond = np.zeros(shown.shape, dtype=bool) if top is None else shown > top
        ax.plot(trial[~beyond], shown[~beyond], ".", color=colour, markersize=4, label=name)
        if beyond.any():
            ax.plot(trial[beyond], np.full(beyond.sum(), top), "^", color=colour, markersize=5, clip_on=False)
    for style, (name, level) in zip(itertools.cycle(LEVEL_STYLES), levels.items(), strict=False):
        ax.axhline(level, color="0.25", linestyle=style, linewidth=1.2, label=name)
    ax.set(xlabel="trial", ylabel=error_label)
    ax.set_ylim(bottom=0.0, top=top)
    return ax
