"""Hardness by direct contact: the modulus with its interval, and how the contact grows with the force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps

from tsis.plots._estimate import BINS, POSTERIOR, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.hardness import ContactTable, PrintedHardness
    from tsis.model import Estimate


CURVE_POINTS = 60


def modulus(estimate: Estimate, ax: Axes, *, truth_kpa: float | None = None) -> Axes:
    """Draw the posterior density of a touched object's modulus with its 90 % interval, and the truth if known.

    Parameters
    ----------
    estimate
        Of ``young_kpa``.
    ax
        Where to draw.
    truth_kpa
        The true modulus, of a virtual sphere for instance.
    """
    left, right = estimate.interval(0.9)["young_kpa"]
    ax.hist(estimate.samples["young_kpa"], bins=BINS, density=True, color=POSTERIOR, alpha=0.75, label="posterior")
    ax.axvspan(left, right, color=POSTERIOR, alpha=0.15, label="90 % interval")
    if truth_kpa is not None:
        ax.axvline(truth_kpa, color=TRUTH, linestyle="--", linewidth=2, label="truth")
    ax.set(xlabel="modulus E / kPa", yticks=[])
    ax.legend(frameon=False)
    return ax


def contact_growth(estimate: Estimate, ax: Axes, *, table: ContactTable) -> Axes:
    """Draw measured contact radii over the force, and those of the estimated moduli.

    Parameters
    ----------
    estimate
        Of `tsis.hardness.estimate`, whose provenance holds the presses.
    ax
        Where to draw.
    table
        Contact radii of the probe that pressed.
    """
    presses = [press for press in estimate.provenance["presses"] if press["ball_radius_mm"] is None]
    forces = np.array([press["force_n"] for press in presses])
    radii = np.array([press["seen"]["radius_mm"] for press in presses])
    ax.plot(forces, radii, "o", color=TRUTH, label="frames")
    radius_mm = estimate.provenance["radius"]["radius_mm"]
    if radius_mm is not None:
        poisson = float(np.mean(estimate.provenance["prior"]["poisson"]))
        along = np.linspace(0.5 * forces.min(), 1.1 * forces.max(), CURVE_POINTS)
        low, high = estimate.interval(0.9)["young_kpa"]
        soft, middle, stiff = (
            np.exp(table.log_radius(young, poisson, radius_mm, along))
            for young in (low, estimate.mean["young_kpa"], high)
        )
        ax.plot(along, middle, color=POSTERIOR, label=f"sphere of {estimate.mean['young_kpa']:.3g} kPa")
        ax.fill_between(along, stiff, soft, color=POSTERIOR, alpha=0.15, label="90 % interval")
    ax.set(xlabel="force F / N", ylabel="contact radius a / mm")
    ax.legend(frameon=False)
    return ax


LABELLED = 5  # rows in the legend
COLOURS = ("#0072b2", "#d55e00", "#009e73")  # distinct without red-green vision
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
    for index, (row, force, shade) in enumerate(zip(rows, force_n, shades, strict=True)):
        ax.plot(row_mm, row, color=shade, linewidth=1, label=f"{force:g} N" if index in named else None)
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
    depth_mm_per_grey: NDArray[np.float64], responses: list[PrintedHardness], ax: Axes, *, truth_kpa: float, label: str
) -> Axes:
    """Draw the mean strain of the printed pipeline over the depth of a grey level, and the strain that E would need.

    Parameters
    ----------
    depth_mm_per_grey
        Depths that a grey level was taken for, mm, shape (n,).
    responses
        What they gave, as many.
    ax
        Where to draw.
    truth_kpa
        The true modulus, which stress over strain should give.
    label
        Of the object.
    """
    (drawn,) = ax.plot(
        depth_mm_per_grey, [abs(item.mean_strain) for item in responses], "o-", markersize=4, label=label
    )
    needed = float(np.mean([item.stress_kpa for item in responses])) / truth_kpa
    ax.axhline(needed, color=drawn.get_color(), linestyle="--", linewidth=1, label=f"{label}: stress / E")
    highest = max(float(ax.dataLim.y1), needed)
    ax.set(xscale="log", xlabel="depth of a grey level / mm", ylabel="mean strain", ylim=(0.0, 1.1 * highest))
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False, fontsize="small")
    return ax
