"""A dot board as it was read: dots, lattice, and residuals large enough to be seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.calibration.scale import DotDiagnostics, PixelScale
    from tsis.model import TactileImage

DOT, LATTICE, MISS, STRAY = "#0072b2", "0.75", "#d55e00", "#cc79a7"  # told apart without red-green vision


def dot_board(
    found: DotDiagnostics,
    ax: Axes,
    *,
    image: TactileImage | None = None,
    scale: PixelScale | None = None,
    magnified: float | None = None,
) -> Axes:
    """Draw the dots of a board, the lattice they lie on, and how far each is from its fitted place.

    Parameters
    ----------
    found
        What `scale_from_dots` found beside the scale.
    ax
        Where to draw; image coordinates in pixels, y downwards.
    image
        The frame, drawn below; None draws none.
    scale
        The scale, written above and marked where it holds; None writes nothing.
    magnified
        By what factor residuals are drawn; by default so that the largest is as long as a third of the dots' distance.

    Returns
    -------
    Axes
        ``ax``.
    """
    if image is not None:
        ax.imshow(image.grey, cmap="gray", interpolation="antialiased")
    places = found.centres_px
    steps = _steps(found)
    ax.plot(*_broken_lines(steps), color=LATTICE, linewidth=0.8, label="lattice")
    ax.plot(*places.T, "o", color=DOT, markersize=3, label=f"dots ({len(places)})")
    factor = _magnification(found, steps) if magnified is None else magnified
    tips = places + factor * found.residuals_px
    label = f"residuals, {factor:.0f} times"
    ax.plot(*_broken_lines(np.stack([places, tips], axis=1)), color=MISS, linewidth=1.4, label=label)
    if len(found.strays_px):
        ax.plot(*found.strays_px.T, "x", color=STRAY, label=f"no dots ({len(found.strays_px)})")
    if scale is not None:
        ax.plot(*scale.at_px, "+", color="black", markersize=12, label="the scale's place")
        ax.set_title(", ".join(f"{axis}: {size}" for axis, size in zip("xy", _sizes(scale), strict=True)), fontsize=9)
    ax.set(xlabel="x / px", ylabel="y / px", aspect="equal")
    if image is None:
        ax.invert_yaxis()
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, fontsize=7)  # beside the dots
    return ax


def _sizes(scale: PixelScale) -> list[str]:
    return [f"{size.value:.5f} ± {size.sd:.5f} mm/px" for size in (scale.mm_per_pixel_x, scale.mm_per_pixel_y)]


def _steps(found: DotDiagnostics) -> NDArray[np.float64]:
    """Ends of the lines between neighbours, shape (lines, 2, 2), pixels."""
    place_of = {(round(i), round(j)): place for (i, j), place in zip(found.cells, found.centres_px, strict=True)}
    ends = [
        (place, place_of[other])
        for (i, j), place in place_of.items()
        for other in ((i + 1, j), (i, j + 1))
        if other in place_of
    ]
    return np.array(ends, dtype=float).reshape(-1, 2, 2)


def _broken_lines(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates x and y of lines as one curve with gaps, shape (2, 3 * lines)."""
    gap = np.full((len(ends), 1, 2), np.nan)
    return np.concatenate([ends, gap], axis=1).reshape(-1, 2).T


def _magnification(found: DotDiagnostics, steps: NDArray[np.float64]) -> float:
    longest = float(np.linalg.norm(found.residuals_px, axis=1).max())
    if longest == 0.0 or not len(steps):
        return 1.0
    distance = float(np.median(np.linalg.norm(steps[:, 1] - steps[:, 0], axis=1)))
    return max(1.0, round(distance / 3 / longest))
