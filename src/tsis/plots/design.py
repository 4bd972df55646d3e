"""What designs would tell, and which of them keep their limits."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.plots.posterior import LABELS

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from tsis.inclusion import Design

KEEPS, BREAKS = "#0072b2", "#d55e00"  # told apart without red-green vision, and by the marker too


def design_errors(designs: Sequence[Design], names: tuple[str, str], ax: Axes) -> Axes:
    """Draw the expected errors of two parameters, a numbered point for each design; nearer to the corner is better.

    Filled circles keep every limit, crosses break one. The legend's entries say which number is which design.

    Parameters
    ----------
    designs
        What to draw, numbered from 1 in their order.
    names
        The parameters along x and y.
    ax
        Where to draw.
    """
    first, second = names
    for number, design in enumerate(designs, start=1):
        x, y = design.information.rmse[first], design.information.rmse[second]
        marker, colour = ("x", BREAKS) if design.limits.broken else ("o", KEEPS)
        ax.plot(x, y, marker, color=colour, markersize=5, label=f"{number}  {design.protocol.name}")
        ax.annotate(str(number), (x, y), xytext=(4, 3), textcoords="offset points", fontsize=7)
    ax.margins(0.1)
    ax.set(xlabel=f"expected error of {LABELS[first]}", ylabel=f"expected error of {LABELS[second]}")
    return ax
