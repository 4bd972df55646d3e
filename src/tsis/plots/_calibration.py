"""Sum of grey levels against the force of the press, with the straight line through it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.force import common_forces, fit_run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.calibration.force import ForceLine, Loading
    from tsis.calibration.scale import DotDiagnostics, PixelScale
    from tsis.model import TactileImage


MILLION = 1e6


def grey_sums(
    force_n: NDArray[np.float64], sums: NDArray[np.float64], ax: Axes, *, label: str = "", marker: str = "o"
) -> Axes:
    """Draw sums of grey levels, in millions, over forces in newtons, and the least-squares line from 0 N.

    Both have shape (presses,), at least two; the line has no label.
    """
    (drawn,) = ax.plot(force_n, sums / MILLION, marker, markersize=4, label=label)
    slope, intercept = np.polyfit(force_n, sums / MILLION, 1)
    ends = np.array([0.0, force_n.max()])
    ax.plot(ends, intercept + slope * ends, linewidth=0.8, color=drawn.get_color())
    ax.set(xlabel="force / N", ylabel="sum of grey levels / 10⁶")
    ax.set(xlim=(0.0, 1.05 * ax.dataLim.x1), ylim=(0.0, 1.05 * ax.dataLim.y1))  # of all that was drawn so far
    ax.grid(visible=True, alpha=0.3)
    return ax


COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")  # told apart without red-green vision
BAND_POINTS = 60


def force_sums(loadings: Sequence[Loading], line: ForceLine, ax: Axes) -> Axes:
    """Draw sums of grey levels over the force, loading and unloading, and the fitted line (figures 5.3, 5.4).

    The band around the line is where 95 % of new frames should lie.
    """
    for loading, colour in _coloured(loadings):
        _presses(loading, loading.total_grey / MILLION, ax, colour)
    force = np.linspace(line.least_n, line.most_n, BAND_POINTS)
    slope, intercept = line.slope_grey_per_n.value, line.intercept_grey.value
    ends = np.array([line.with_uncertainty(float(item)).interval() for item in force])
    ax.plot(force, (intercept + slope * force) / MILLION, color="black", linewidth=0.8)
    low, high = ((intercept + slope * end) / MILLION for end in ends.T)
    ax.fill_between(force, low, high, color="black", alpha=0.12, linewidth=0, label="95 % of new frames")
    ax.set(xlabel="force / N", ylabel="sum of grey levels / 10⁶", xlim=(0.0, None), ylim=(0.0, None))
    ax.legend(frameon=False, fontsize="small")
    ax.grid(visible=True, alpha=0.3)
    return ax


def force_residuals(loadings: Sequence[Loading], line: ForceLine, ax: Axes) -> Axes:
    """Draw what the mean line leaves of each press, in per cent of the line's rise over its range of force."""
    rise = line.slope_grey_per_n.value * line.most_n
    for loading, colour in _coloured(loadings):
        expected = line.intercept_grey.value + line.slope_grey_per_n.value * loading.load_n
        _presses(loading, 100 * (loading.total_grey - expected) / rise, ax, colour)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set(xlabel="force / N", ylabel="departure from the line / % of range")
    ax.legend(frameon=False, fontsize="small")
    ax.grid(visible=True, alpha=0.3)
    return ax


def hysteresis_loops(loadings: Sequence[Loading], ax: Axes) -> Axes:
    """Draw loading less unloading over the force, in per cent of each run's largest sum, a curve for each run.

    Runs without unloading have no curve; the axes say so where none has one.
    """
    for loading, colour in _coloured(loadings):
        run = fit_run(loading)
        if not run.has_both_branches:
            continue
        force = common_forces([run])
        width = 100 * (run.sums_at(force, rising=True) - run.sums_at(force, rising=False)) / run.total_grey.max()
        ax.plot(force, width, color=colour, linewidth=1, label=_name(loading))
    if not ax.get_lines():
        ax.text(0.5, 0.5, "no tip was unloaded", ha="center", va="center", transform=ax.transAxes)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set(xlabel="force / N", ylabel="loading less unloading / % of range")
    if ax.get_legend_handles_labels()[1]:
        ax.legend(frameon=False, fontsize="small")
    ax.grid(visible=True, alpha=0.3)
    return ax


def _coloured(loadings: Sequence[Loading]) -> list[tuple[Loading, str]]:
    """Loadings with a colour for each tip."""
    tips = sorted({loading.tip_radius_mm for loading in loadings})
    return [(loading, COLOURS[tips.index(loading.tip_radius_mm) % len(COLOURS)]) for loading in loadings]


def _presses(loading: Loading, values: NDArray[np.float64], ax: Axes, colour: str) -> None:
    """Draw rings for loading and crosses for unloading."""
    for rising, mark in ((True, "o"), (False, "x")):
        here = loading.touched & (loading.rising == rising)
        name = _name(loading) if rising else None
        ax.plot(loading.load_n[here], values[here], mark, color=colour, ms=4, markerfacecolor="none", label=name)


def _name(loading: Loading) -> str | None:
    """Label of a tip, for its first run."""
    return f"{loading.tip_radius_mm:g} mm tip" if loading.run == 1 else None


DOT, LATTICE, RESIDUAL, STRAY = "#0072b2", "0.75", "#d55e00", "#cc79a7"  # distinct without red-green vision


def dot_board(
    dot_diagnostics: DotDiagnostics,
    ax: Axes,
    *,
    image: TactileImage | None = None,
    scale: PixelScale | None = None,
    magnified: float | None = None,
) -> Axes:
    """Draw the dots of a board, their lattice, and their residuals from the fit, in pixels with y downwards.

    Parameters
    ----------
    dot_diagnostics
        Diagnostics of `scale_from_dots`.
    image
        The frame below the dots, or None.
    scale
        The scale, for the title and the mark of its position, or None.
    magnified
        Factor of the residuals; by default the largest is as long as a third of the spacing of the dots.
    """
    if image is not None:
        ax.imshow(image.grey, cmap="gray", interpolation="antialiased")
    positions = dot_diagnostics.centres_px
    steps = _steps(dot_diagnostics)
    ax.plot(*_broken_lines(steps), color=LATTICE, linewidth=0.8, label="lattice")
    ax.plot(*positions.T, "o", color=DOT, markersize=3, label=f"dots ({len(positions)})")
    factor = _magnification(dot_diagnostics, steps) if magnified is None else magnified
    tips = positions + factor * dot_diagnostics.residuals_px
    label = f"residuals, {factor:.0f} times"
    ax.plot(*_broken_lines(np.stack([positions, tips], axis=1)), color=RESIDUAL, linewidth=1.4, label=label)
    if len(dot_diagnostics.strays_px):
        ax.plot(*dot_diagnostics.strays_px.T, "x", color=STRAY, label=f"no dots ({len(dot_diagnostics.strays_px)})")
    if scale is not None:
        ax.plot(*scale.at_px, "+", color="black", markersize=12, label="position of the scale")
        ax.set_title(", ".join(f"{axis}: {size}" for axis, size in zip("xy", _sizes(scale), strict=True)), fontsize=9)
    ax.set(xlabel="x / px", ylabel="y / px", aspect="equal")
    if image is None:
        ax.invert_yaxis()
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, fontsize=7)  # beside the dots
    return ax


def _sizes(scale: PixelScale) -> list[str]:
    return [f"{size.value:.5f} ± {size.sd:.5f} mm/px" for size in (scale.mm_per_pixel_x, scale.mm_per_pixel_y)]


def _steps(dot_diagnostics: DotDiagnostics) -> NDArray[np.float64]:
    """Ends of the lines between neighbours, shape (lines, 2, 2), pixels."""
    centres = {
        (round(i), round(j)): centre_px
        for (i, j), centre_px in zip(dot_diagnostics.cells, dot_diagnostics.centres_px, strict=True)
    }
    ends = [
        (position, centres[other])
        for (i, j), position in centres.items()
        for other in ((i + 1, j), (i, j + 1))
        if other in centres
    ]
    return np.array(ends, dtype=float).reshape(-1, 2, 2)


def _broken_lines(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates x and y of lines as one curve with gaps, shape (2, 3 * lines)."""
    gap = np.full((len(ends), 1, 2), np.nan)
    return np.concatenate([ends, gap], axis=1).reshape(-1, 2).T


def _magnification(dot_diagnostics: DotDiagnostics, steps: NDArray[np.float64]) -> float:
    longest = float(np.linalg.norm(dot_diagnostics.residuals_px, axis=1).max())
    if longest == 0.0 or not len(steps):
        return 1.0
    distance = float(np.median(np.linalg.norm(steps[:, 1] - steps[:, 0], axis=1)))
    return max(1.0, round(distance / 3 / longest))
