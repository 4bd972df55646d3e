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
    """Draw the expected errors of two parameters, a point for each design; nearer to the corner is better.

    Filled circles keep every limit, crosses break one.

    Parameters
    ----------
    designs
        What to draw, each labelled by its protocol's name.
    names
        The parameters along x and y.
    ax
        Where to draw.
    """
    first, second = names
    for design in designs:
        x, y = design.information.rmse[first], design.information.rmse[second]
        breaks = bool(design.limits.broken)
        ax.plot(x, y, "x" if breaks else "o", color=BREAKS if breaks else KEEPS)
        ax.annotate(design.protocol.name, (x, y), xytext=(5, 3), textcoords="offset points", fontsize=7)
    ax.margins(0.15)
    ax.set(xlabel=f"expected error of {LABELS[first]}", ylabel=f"expected error of {LABELS[second]}")
    return ax
