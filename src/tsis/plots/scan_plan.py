"""Where a scan plan presses, and the place that it sees worst."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.collections import EllipseCollection
from matplotlib.patches import Rectangle

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tsis.detection import ScanPlan

FACE, REACH, WAY, WORST = "#999999", "#0072b2", "#333333", "#d55e00"  # told apart without red-green vision


def draw_scan_plan(plan: ScanPlan, ax: Axes, *, reach_mm: float | None = None) -> Axes:
    """Draw the area, the face at each press, the way between presses, and a place that is farthest from any press.

    Parameters
    ----------
    plan
        Where is pressed.
    ax
        Where to draw; both axes get one scale.
    reach_mm
        How far beside a press an inclusion is found; discs of that radius are filled.
    """
    places = plan.positions_mm
    if reach_mm is not None and reach_mm > 0:
        _discs(plan, ax, reach_mm, facecolor=REACH, alpha=0.25)
        ax.plot([], [], "o", color=REACH, alpha=0.25, label=f"within {reach_mm:.3g} mm of a press")
    _discs(plan, ax, plan.radius_mm, facecolor="none", edgecolor=FACE, linewidth=0.6)
    ax.plot([], [], "o", color=FACE, markerfacecolor="none", label="face of the probe")
    ax.add_patch(Rectangle((0.0, 0.0), plan.width_mm, plan.height_mm, fill=False, linewidth=1.5, label="area"))
    ax.plot(*places.T, "-", color=WAY, linewidth=0.8, marker=".", markersize=4, label="way of the presses")
    ax.plot(*places[0], "o", color=WAY, markersize=6, label="first press")
    at = places[0] + (plan.strip_spacing_mm / 2, plan.press_spacing_mm / 2)
    farthest = f"farthest from any press, {plan.worst_distance_mm:.3g} mm"
    ax.plot(*at, "x", color=WORST, markersize=8, markeredgewidth=2, label=farthest)
    margin = max(plan.radius_mm, *plan.overhang_mm, 1.0)
    ax.set(
        xlim=(-margin, plan.width_mm + margin),
        ylim=(-margin, plan.height_mm + margin),
        aspect="equal",
        xlabel="across strips / mm",
        ylabel="along strips / mm",
    )
    return ax


def _discs(plan: ScanPlan, ax: Axes, radius_mm: float, **look: object) -> None:
    """A disc around each press, all of them one artist, of which legends know nothing: a plan may have thousands."""
    size = [2 * radius_mm]
    discs = EllipseCollection(
        size, size, [0.0], units="xy", offsets=plan.positions_mm, transOffset=ax.transData, **look
    )  # fmt: skip
    ax.add_collection(discs)
