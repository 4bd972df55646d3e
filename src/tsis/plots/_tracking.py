"""Figures of a sequence of frames: the path of the light, and its sum over time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.inclusion.mobility import Mobility


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
