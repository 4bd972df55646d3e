"""Figures of gel sensors: the contact over its frame, and a depth map."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.patches import Ellipse

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.imaging import GelContact


GOOD, REFUSED = "#ffffff", "#e69f00"


def gel_contact(frame: NDArray[Any], contact: GelContact, ax: Axes) -> Axes:
    """Draw a frame with its contact: a full line where it is good, a broken one and the reasons where it is not."""
    levels = np.asarray(frame)
    ax.imshow(levels if levels.ndim == 3 else levels.astype(float), cmap="gray", interpolation="nearest")
    title = f"{contact.name}: quality {contact.quality:.2f}"
    if np.isfinite(contact.radius_px):
        colour, line = (GOOD, "-") if contact.good else (REFUSED, "--")
        width, height = (2 * axis for axis in contact.semi_axes_px)
        ax.add_patch(
            Ellipse(contact.centre_px, width, height, angle=contact.angle_deg, fill=False, color=colour, linestyle=line)
        )
        ax.plot(*contact.centre_px, "+", color=colour, markersize=10)
        if contact.radius_mm is not None:
            title += f", radius {contact.radius_mm:.2f} mm"
    ax.set_title(title if contact.good else f"{title}\n{', '.join(contact.reasons)}", fontsize=8)
    ax.set_axis_off()
    return ax


def gel_depth(depth_mm: NDArray[np.float64], ax: Axes, *, mm_per_pixel: tuple[float, float], label: str) -> Axes:
    """Draw a map over the face with a colour bar, axes in mm."""
    rows, columns = depth_mm.shape
    extent = (0.0, columns * mm_per_pixel[0], rows * mm_per_pixel[1], 0.0)
    shown = ax.imshow(depth_mm, cmap="viridis", extent=extent, interpolation="nearest")
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(shown, ax=ax, label=label, fraction=0.04, pad=0.02)
    ax.set(xlabel="x / mm", ylabel="y / mm")
    return ax
