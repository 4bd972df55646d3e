"""Hardness by direct contact: the modulus with its interval, and how the contact grows with the force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.plots.posterior import BINS, POSTERIOR, TRUTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tsis.hardness import ContactTable
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
    """Draw the contact radii that the frames show over the force, and those of the estimated moduli.

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
    known = estimate.provenance["radius"]["radius_mm"]
    if known is not None:
        poisson = float(np.mean(estimate.provenance["prior"]["poisson"]))
        along = np.linspace(0.5 * forces.min(), 1.1 * forces.max(), CURVE_POINTS)
        low, high = estimate.interval(0.9)["young_kpa"]
        soft, middle, stiff = (
            np.exp(table.log_radius(young, poisson, known, along)) for young in (low, estimate.mean["young_kpa"], high)
        )
        ax.plot(along, middle, color=POSTERIOR, label=f"sphere of {estimate.mean['young_kpa']:.3g} kPa")
        ax.fill_between(along, stiff, soft, color=POSTERIOR, alpha=0.15, label="90 % interval")
    ax.set(xlabel="force F / N", ylabel="contact radius a / mm")
    ax.legend(frameon=False)
    return ax
