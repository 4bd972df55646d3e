"""Section of the tissue, to scale, with the estimated inclusion and how well its size and depth are known."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tsis.model import Estimate


DRAWN = 60  # samples of the posterior, each as a thin outline
INCLUSION, TISSUE = "#0072b2", "#f3e3d3"
MARGIN = 1.25  # half width of the section over the largest inclusion's distance
NEEDED = ("diameter_mm", "depth_mm")


def tissue_section(estimate: Estimate, ax: Axes) -> Axes:
    """Draw the tissue from its surface down, both axes in millimetres at one scale, with the inclusion in it.

    Each thin outline is one sample of the posterior, so their spread is the uncertainty of size and depth together; the
    thick one has the medians of both and is left out where a parameter is not identified. Below the deepest inclusion
    the tissue is cut off unless the prior's thickness is near. An estimate that is not trusted shows its flags and
    no number: neither outline nor scale.

    Raises
    ------
    InputError
        When the estimate has no diameter or no depth.
    """
    if missing := [name for name in NEEDED if name not in estimate.names]:
        raise InputError(f"a section needs an estimate of {' and '.join(NEEDED)}; it lacks {', '.join(missing)}")
    if not estimate.trusted:
        return withheld(estimate, ax)
    diameter, depth = (np.asarray(estimate.samples[name]) for name in NEEDED)
    chosen = np.linspace(0, len(diameter) - 1, min(DRAWN, len(diameter))).astype(int)
    for index in chosen:
        _inclusion(ax, float(diameter[index]), float(depth[index]), alpha=0.25, linewidth=0.6)
    if all(estimate.identified(name) for name in NEEDED):
        _inclusion(ax, float(np.median(diameter)), float(np.median(depth)), linewidth=2.0)
    deepest = float((diameter + depth)[chosen].max())
    half = MARGIN * max(deepest, float(diameter[chosen].max())) / 2 + 1.0
    ax.axhline(0.0, color="0.2", linewidth=1.5)
    ax.text(-half, 0.0, " surface ", va="bottom", ha="left", fontsize=7)
    ax.set(facecolor=TISSUE, xlabel="across / mm", ylabel="depth / mm", aspect="equal")
    ax.set(xlim=(-half, half), ylim=(_bottom(estimate, deepest), -0.08 * deepest))
    return ax


def withheld(estimate: Estimate, ax: Axes) -> Axes:
    """Say why the numbers of an estimate are withheld, in place of a figure: its flags, without any number."""
    reasons = "\n".join(textwrap.fill(flag.replace("_", " "), 28) for flag in estimate.flags)
    ax.set(xticks=[], yticks=[])
    ax.text(
        0.5, 0.5, f"No estimate is shown.\n\n{reasons}", ha="center", va="center", fontsize=8, transform=ax.transAxes
    )
    return ax


def _inclusion(ax: Axes, diameter_mm: float, depth_mm: float, **style: float) -> None:
    from matplotlib.patches import Circle  # loaded with the first figure

    ax.add_patch(Circle((0.0, depth_mm + diameter_mm / 2), diameter_mm / 2, fill=False, color=INCLUSION, **style))


def _bottom(estimate: Estimate, deepest_mm: float) -> float:
    """The lower end of the drawn tissue, mm: the prior's thickness where that is near the deepest inclusion."""
    prior = estimate.provenance.get("prior", {})
    thickness = prior.get("thickness_mm") if hasattr(prior, "get") else None
    cut = MARGIN * deepest_mm
    return float(thickness) if isinstance(thickness, (int, float)) and thickness < 2 * cut else cut
