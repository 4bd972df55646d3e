"""Figures of tactile images: the image with its contact, surfaces, ring profiles; contact and depth of a gel sensor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from mpl_toolkits.mplot3d import Axes3D
    from numpy.typing import NDArray

    from tsis.imaging import Features, GelContact, HeightSurface, RadialProfile
    from tsis.model import TactileImage


BAR_LENGTHS_MM = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)


def tactile_image(
    image: TactileImage,
    ax: Axes,
    *,
    features: Features | None = None,
    low: float | None = None,
    high: float | None = None,
    label: str = "grey level",
    colours: str = "viridis",
    ink: str = "white",
) -> Axes:
    """Draw an image with a colour bar, a scale bar when its scale is known, and the contact's outline and centroid.

    ``low`` and ``high`` are the grey levels of the colour map's ends, by default of the image's range. ``label``
    describes the colour bar; ``ink`` is distinct from the colours, for scale bar, outline and centroid.
    """
    rows, columns = image.grey.shape
    sx, sy = image.mm_per_pixel or (1.0, 1.0)
    extent = (-sx / 2, (columns - 0.5) * sx, (rows - 0.5) * sy, -sy / 2)
    shown = ax.imshow(image.grey, cmap=colours, extent=extent, vmin=low, vmax=high, interpolation="antialiased")
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(shown, ax=ax, label=label, fraction=0.035, pad=0.02)
    if image.mm_per_pixel is None:
        ax.set(xlabel="x / px", ylabel="y / px")
    else:
        _scale_bar(ax, ink, width_mm=columns * sx, height_mm=rows * sy)
    if features is not None and features.contact:
        outline = features.patch.contour_px
        ax.plot(outline[:, 0] * sx, outline[:, 1] * sy, color=ink, linewidth=1.0)
        if features.centroid_px is not None:
            ax.plot(features.centroid_px[0] * sx, features.centroid_px[1] * sy, "+", color=ink, markersize=12)
    return ax


def _scale_bar(ax: Axes, ink: str, *, width_mm: float, height_mm: float) -> None:
    """A scale bar of a round length, about a fifth of the picture, instead of axes."""
    ax.set_axis_off()
    length = max((bar for bar in BAR_LENGTHS_MM if bar <= width_mm / 4), default=BAR_LENGTHS_MM[0])
    left, level = 0.05 * width_mm, 0.93 * height_mm
    ax.plot([left, left + length], [level, level], color=ink, linewidth=3, solid_capstyle="butt")
    ax.text(left + length / 2, level - 0.02 * height_mm, f"{length:g} mm", color=ink, ha="center", va="bottom")
    ax.set_xlim(0, width_mm)
    ax.set_ylim(height_mm, 0)
    ax.set_aspect("equal")


def relief(surface: HeightSurface, ax: Axes3D, *, unit: str = "mm", label: str = "grey level") -> Axes3D:
    """Draw a surface on a 3-D axes; heights are grey levels of the signal, seen from the front and above."""
    x, y = np.meshgrid(surface.x_mm, surface.y_mm)
    ax.plot_surface(x, y, surface.height, cmap="viridis", rcount=96, ccount=96, linewidth=0, antialiased=True)
    ax.set(xlabel=f"x / {unit}", ylabel=f"y / {unit}", zlabel=label)
    ax.invert_yaxis()  # y runs down the image
    ax.set_box_aspect((float(np.ptp(surface.x_mm)), float(np.ptp(surface.y_mm)), 0.5 * float(np.ptp(surface.x_mm))))
    ax.view_init(elev=35, azim=-60)
    return ax


def ring_profile(profile: RadialProfile, ax: Axes, *, label: str = "", marker: str = "o") -> Axes:
    """Draw the mean grey level of each ring with pixels."""
    observed = profile.count > 0
    ax.plot(
        profile.radius_mm[observed], profile.mean_grey[observed], marker=marker, markersize=3, linewidth=1, label=label
    )
    ax.set(xlabel="radius / mm", ylabel="mean grey level")
    ax.grid(visible=True, alpha=0.3)
    return ax


GOOD, REFUSED = "#ffffff", "#e69f00"


def gel_contact(frame: NDArray[Any], contact: GelContact, ax: Axes) -> Axes:
    """Draw a frame with its contact: a full line where it is good, a broken one and the reasons where it is not."""
    from matplotlib.patches import Ellipse  # loaded with the first figure

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
