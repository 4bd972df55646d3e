"""Sum of grey levels against the force of the press, with the straight line through it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

MILLION = 1e6


def grey_sums(
    force_n: NDArray[np.float64], sums: NDArray[np.float64], ax: Axes, *, label: str = "", marker: str = "o"
) -> Axes:
    """Draw sums of grey levels, in millions, over forces in newtons, and the least-squares line from 0 N.

    Parameters
    ----------
    force_n, sums
        One value a press, shape (n,) each, at least two.
    ax
        Where to draw.
    label, marker
        Of the presses; the line bears no label.
    """
    (drawn,) = ax.plot(force_n, sums / MILLION, marker, markersize=4, label=label)
    slope, intercept = np.polyfit(force_n, sums / MILLION, 1)
    ends = np.array([0.0, force_n.max()])
    ax.plot(ends, intercept + slope * ends, linewidth=0.8, color=drawn.get_color())
    ax.set(xlabel="force / N", ylabel="sum of grey levels / 10⁶")
    ax.set(xlim=(0.0, 1.05 * ax.dataLim.x1), ylim=(0.0, 1.05 * ax.dataLim.y1))  # of all that was drawn so far
    ax.grid(visible=True, alpha=0.3)
    return ax
