"""Ring means of grey level against distance from the axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tsis.imaging import RadialProfile


def ring_profile(profile: RadialProfile, ax: Axes, *, label: str = "", marker: str = "o") -> Axes:
    """Draw the mean grey level of each ring; rings without pixels are left out."""
    seen = profile.count > 0
    ax.plot(profile.radius_mm[seen], profile.mean_grey[seen], marker=marker, markersize=3, linewidth=1, label=label)
    ax.set(xlabel="radius / mm", ylabel="mean grey level")
    ax.grid(visible=True, alpha=0.3)
    return ax
