"""A signal as a relief in three dimensions."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

    from tsis.imaging import HeightSurface


def relief(surface: HeightSurface, ax: Axes3D, *, unit: str = "mm", label: str = "grey level") -> Axes3D:
    """Draw a surface on a 3-D axes; heights are grey levels of the signal, seen from the front and above."""
    x, y = np.meshgrid(surface.x_mm, surface.y_mm)
    ax.plot_surface(x, y, surface.height, cmap="viridis", rcount=96, ccount=96, linewidth=0, antialiased=True)
    ax.set(xlabel=f"x / {unit}", ylabel=f"y / {unit}", zlabel=label)
    ax.invert_yaxis()  # y runs down the image
    ax.set_box_aspect((float(np.ptp(surface.x_mm)), float(np.ptp(surface.y_mm)), 0.5 * float(np.ptp(surface.x_mm))))
    ax.view_init(elev=35, azim=-60)
    return ax
