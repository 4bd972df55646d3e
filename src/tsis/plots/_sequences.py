"""Figures of sequences: path and sum of the light over time, and repeated relative readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.inclusion.mobility import Mobility
    from tsis.inclusion.relative import Repeats


def light_path(transformed: Mobility, ax: Axes) -> Axes:
    """Draw the positions of the light in mm from the probe's axis, joined in the order of time (6.14)."""
    x, y = transformed.position_mm.T
    ax.plot(x, y, "-", linewidth=0.8, color="0.6")
    shown = ax.scatter(x, y, c=np.arange(len(x)), cmap="viridis", s=14, zorder=3)
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(shown, ax=ax, label="frame", fraction=0.04, pad=0.02)
    ax.set(xlabel="x / mm", ylabel="y / mm", aspect="equal")
    ax.invert_yaxis()  # y runs down the image
    ax.grid(visible=True, alpha=0.3)
    return ax


def light_over_time(time_s: NDArray[np.float64], total_grey: NDArray[np.float64], ax: Axes) -> Axes:
    """Draw the sum of grey levels over the time in seconds."""
    ax.plot(time_s, total_grey, ".-", linewidth=0.8, markersize=4)
    ax.set(xlabel="time / s", ylabel="sum of grey levels")
    ax.grid(visible=True, alpha=0.3)
    return ax


HERE, PRINTED = "#0072b2", "#d55e00"  # distinct without red-green vision
BAR_OFFSET = 0.12  # distance of the two bars of one target, in targets


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
