"""Figures 5.2 and 5.23 of the source: grey levels across a contact, and repeated readings of known moduli."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.hardness import PrintedHardness

LABELLED = 5  # rows that the legend names
COLOURS = ("#0072b2", "#d55e00", "#009e73")  # told apart without red-green vision
MARKS = "oxs"


def contact_rows(
    row_mm: NDArray[np.float64], rows: NDArray[np.float64], force_n: NDArray[np.float64], ax: Axes
) -> Axes:
    """Draw grey levels along a line through the contact, one curve a force (figure 5.2).

    Parameters
    ----------
    row_mm
        Places along the line, mm, shape (columns,).
    rows
        Grey levels, shape (forces, columns).
    force_n
        Ascending forces, N, shape (forces,).
    ax
        Where to draw.
    """
    named = set(np.linspace(0, len(force_n) - 1, min(LABELLED, len(force_n))).round().astype(int).tolist())
    shades = colormaps["viridis"](np.linspace(0.0, 0.9, len(force_n)))
    for place, (row, force, shade) in enumerate(zip(rows, force_n, shades, strict=True)):
        ax.plot(row_mm, row, color=shade, linewidth=1, label=f"{force:g} N" if place in named else None)
    ax.set(xlabel="x / mm", ylabel="grey level")
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False)
    return ax


def modulus_readings(
    young_kpa: NDArray[np.float64], ax: Axes, *, truth_kpa: float, label: str, series: int = 0
) -> Axes:
    """Draw repeated readings of one object's modulus and a line at its true one (figure 5.23).

    Parameters
    ----------
    young_kpa
        Readings, kPa, shape (n,).
    ax
        Where to draw; several objects may share it.
    truth_kpa
        The true modulus.
    label
        Of the object.
    series
        Which colour and mark it takes, from 0.
    """
    colour, mark = COLOURS[series % len(COLOURS)], MARKS[series % len(MARKS)]
    number = np.arange(1, len(young_kpa) + 1)
    ax.plot(number, young_kpa, mark, color=colour, markerfacecolor="none", label=label)
    ax.axhline(truth_kpa, color=colour, linewidth=1, linestyle="--", label=f"{label}, {truth_kpa:g} kPa")
    highest = max(float(ax.dataLim.y1), truth_kpa)
    ax.set(xlabel="reading", ylabel="modulus E / kPa", ylim=(0.0, 1.1 * highest))
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False, fontsize="small")
    return ax


def strain_over_depth(
    depth_mm_per_grey: NDArray[np.float64], answers: list[PrintedHardness], ax: Axes, *, truth_kpa: float, label: str
) -> Axes:
    """Draw the mean strain of the printed pipeline over the depth of a grey level, and the strain that E would need.

    Parameters
    ----------
    depth_mm_per_grey
        Depths that a grey level was taken for, mm, shape (n,).
    answers
        What they gave, as many.
    ax
        Where to draw.
    truth_kpa
        The true modulus, which stress over strain should give.
    label
        Of the object.
    """
    (drawn,) = ax.plot(depth_mm_per_grey, [abs(one.mean_strain) for one in answers], "o-", markersize=4, label=label)
    needed = float(np.mean([one.stress_kpa for one in answers])) / truth_kpa
    ax.axhline(needed, color=drawn.get_color(), linestyle="--", linewidth=1, label=f"{label}: stress / E")
    highest = max(float(ax.dataLim.y1), needed)
    ax.set(xscale="log", xlabel="depth of a grey level / mm", ylabel="mean strain", ylim=(0.0, 1.1 * highest))
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False, fontsize="small")
    return ax
