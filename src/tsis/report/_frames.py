"""Pictures of frames: the image, its change, its surface, its ring profile."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.imaging import features, height_surface, radial_profile
from tsis.plots import relief, ring_profile, tactile_image
from tsis.report._page import Picture, on_axes

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from tsis.imaging import Features
    from tsis.model import TactileImage


MARKERS = "os^v"
FRAMES_PER_ROW, SHEET_WIDTH = 4, 9.5  # frames in a row of a sheet, and its inches


def force_of(frame: TactileImage) -> float:
    """The force in newtons, 0 where unknown."""
    return frame.force_n or 0.0


def frame_picture(image: TactileImage) -> Picture:
    """The image of a frame."""
    force = "force not measured" if image.force_n is None else f"{image.force_n:g} N"
    return Picture(
        title="Tactile image",
        draw=on_axes(tactile_image, image),
        size=(6.0, 4.0),
        alt=f"Tactile image of {image.name}, bright where the pressure is high",
        caption=f"{image.name}, {force}. Bright is high pressure; the rim is the edge of the face.",
    )


def change_picture(
    signal: TactileImage,
    result: Features | None = None,
    *,
    title: str = "What the inclusion adds",
    alt: str = "Target minus reference press, with the outline and the centroid of the bright patch",
    caption: str = "Target minus reference press on plain tissue; outline and centroid in white.",
) -> Picture:
    """The difference of two frames, with the outline of the bright patch; ``result`` has its features."""
    draw = on_axes(tactile_image, signal, features=result or features(signal), low=0.0)
    return Picture(title=title, draw=draw, size=(6.0, 4.0), alt=alt, caption=caption)


def surface_picture(signal: TactileImage) -> Picture:
    """A signal of known scale as a surface."""

    def lifted(figure: Figure) -> None:
        relief(height_surface(signal, max_points=96), figure.add_subplot(projection="3d"))

    return Picture(
        title="Surface",
        draw=lifted,
        size=(6.0, 4.2),
        vector=False,
        alt="The same signal as a surface in three dimensions",
        caption="The same as a surface; heights are grey levels, not millimetres.",
    )


def profile_picture(
    groups: Mapping[str, Sequence[TactileImage]],
    edges_mm: NDArray[np.float64],
    *,
    title: str = "The profiles that the estimate rests on",
) -> Picture:
    """Ring means of frames of known scale, by group, with a line for each press; ``edges_mm`` bound the rings."""
    shown = [
        (what, frame, marker)
        for (what, frames), marker in zip(groups.items(), MARKERS, strict=False)
        for frame in sorted(frames, key=force_of, reverse=True)
    ]

    def profiles(figure: Figure) -> None:
        ax = figure.subplots()
        for what, frame, marker in shown:
            profile = radial_profile(frame, edges_mm=edges_mm)
            ring_profile(profile, ax, label=f"{what}, {force_of(frame):g} N", marker=marker)
        ax.legend(frameon=False)

    return Picture(
        title=title,
        draw=profiles,
        size=(5.5, 3.6),
        alt="Mean grey level in rings around the probe's axis, one line a press",
        caption="Mean grey level in rings around the probe's axis, one line a press.",
    )


def sheet_picture(frames: Sequence[tuple[str, TactileImage]]) -> Picture:
    """Thumbnails of (role, frame), at least one, in one colour map."""
    rows, span = -(-len(frames) // FRAMES_PER_ROW), min(FRAMES_PER_ROW, len(frames))
    tall = max(_aspect(frame) * frame.grey.shape[0] / frame.grey.shape[1] for _, frame in frames)
    height = min(max(SHEET_WIDTH / span * tall, 0.5), 4.0) + 0.25

    def sheet(figure: Figure) -> None:
        high = max(float(frame.grey.max()) for _, frame in frames)
        axes = figure.subplots(rows, span, squeeze=False).ravel()
        for ax in axes:
            ax.set_axis_off()
        for (role, frame), ax in zip(frames, axes, strict=False):
            ax.imshow(frame.grey, cmap="viridis", vmin=0.0, vmax=high, aspect=_aspect(frame))
            force = "" if frame.force_n is None else f", {frame.force_n:g} N"
            ax.set_title(f"{role}{force}", fontsize=8)

    return Picture(
        title="Every frame",
        draw=sheet,
        size=(SHEET_WIDTH, rows * height),
        vector=False,
        wide=True,
        alt=f"{len(frames)} frames side by side in the order in which they were taken",
        caption="In one colour map, from black to the brightest level of all.",
    )


def _aspect(frame: TactileImage) -> float:
    """Height over width of a pixel."""
    return 1.0 if frame.mm_per_pixel is None else frame.mm_per_pixel[1] / frame.mm_per_pixel[0]
