"""Hardness by direct contact: the modulus with its interval, and how the contact grows with the force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.plots._estimate import POSTERIOR, TRUTH, draw_posterior

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.hardness import ContactTable
    from tsis.model import Estimate


CURVE_POINTS = 60


def modulus(estimate: Estimate, ax: Axes, *, truth_kpa: float | None = None) -> Axes:
    """Draw the posterior density of a touched object's modulus with its 90 % interval, and the truth if known."""
    draw_posterior(estimate, "young_kpa", ax, truth_kpa)
    ax.set(xlabel="modulus E / kPa", yticks=[])
    ax.legend(frameon=False)
    return ax


def contact_growth(estimate: Estimate, ax: Axes, *, table: ContactTable) -> Axes:
    """Draw measured contact radii over the force, and those of the estimated moduli where the estimate is trusted.

    The provenance of the estimate, of `tsis.hardness.estimate`, holds the presses; ``table`` is that of the probe.
    """
    presses = [press for press in estimate.provenance["presses"] if press["ball_radius_mm"] is None]
    forces = np.array([press["force_n"] for press in presses])
    radii = np.array([press["seen"]["radius_mm"] for press in presses])
    ax.plot(forces, radii, "o", color=TRUTH, label="frames")
    radius_mm = estimate.provenance["radius"]["radius_mm"]
    if radius_mm is not None and estimate.trusted:
        poisson = float(np.mean(estimate.provenance["prior"]["poisson"]))
        along = np.linspace(0.5 * forces.min(), 1.1 * forces.max(), CURVE_POINTS)
        low, high = estimate.interval(0.9)["young_kpa"]

        def radius(young_kpa: float) -> NDArray[np.float64]:
            return np.asarray(np.exp(table.log_radius(young_kpa, poisson, radius_mm, along)))

        soft, stiff = radius(low), radius(high)
        if "young_kpa" in estimate.mean:
            mean = estimate.mean["young_kpa"]
            ax.plot(along, radius(mean), color=POSTERIOR, label=f"sphere of {mean:.3g} kPa")
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
    """Draw grey levels along a line through the contact, a curve for each force (figure 5.2).

    Shapes: positions along the line ``row_mm`` (columns,), grey levels ``rows`` (forces, columns), ascending forces
    ``force_n`` (forces,).
    """
    from matplotlib import colormaps  # loaded with the first figure

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
    """Draw repeated readings of one object's modulus, kPa, shape (n,), and a line at its true one (figure 5.23).

    Several objects may share the axes; ``series``, from 0, selects the colour and mark of each.
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
