"""Figures 5.2 to 5.4 of the source for any calibration: cross-sections, sums over the force, residuals and loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.calibration.force.curves import common_forces, run_of
from tsis.model.errors import InputError
from tsis.plots.force_curve import MILLION
from tsis.plots.hardness_figures import contact_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.calibration.force.line import ForceLine
    from tsis.calibration.force.loading import Loading
    from tsis.model import TactileImage

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")  # told apart without red-green vision
BAND_POINTS = 60


def cross_sections(images: Sequence[TactileImage], ax: Axes) -> Axes:
    """Draw grey levels along the row of the brightest place of the last frame, one curve a force (figure 5.2).

    Parameters
    ----------
    images
        Corrected frames of one tip in the order of their forces, which they must know, of one scale.
    ax
        Where to draw.
    """
    forces = [image.force_n for image in images]
    if not images or any(force is None for force in forces):
        raise InputError("images must hold frames that know their force_n; got some without")
    row, column = np.unravel_index(int(images[-1].grey.argmax()), images[-1].grey.shape)
    place_mm = np.asarray((np.arange(images[-1].grey.shape[1]) - column) * images[-1].scale()[0], dtype=np.float64)
    return contact_rows(
        place_mm, np.array([image.grey[row] for image in images]), np.array(forces, dtype=np.float64), ax
    )


def force_sums(loadings: Sequence[Loading], line: ForceLine, ax: Axes) -> Axes:
    """Draw sums of grey levels over the force, loading and unloading, and the line with its band (figures 5.3, 5.4).

    Parameters
    ----------
    loadings
        What the line was fitted to.
    line
        The line; the band is where 95 % of new frames should lie.
    ax
        Where to draw.
    """
    for loading, colour in _coloured(loadings):
        _presses(loading, loading.total_grey / MILLION, ax, colour)
    force = np.linspace(line.least_n, line.most_n, BAND_POINTS)
    slope, intercept = line.slope_grey_per_n.value, line.intercept_grey.value
    ends = np.array([line.uncertain(float(one)).interval() for one in force])
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
    """Draw loading less unloading over the force, in per cent of each run's largest sum, one curve a run.

    Runs without unloading have none; where no run has one, the axes say so.
    """
    for loading, colour in _coloured(loadings):
        run = run_of(loading)
        if not run.has_both_branches:
            continue
        force = common_forces([run])
        width = 100 * (run.at(force, rising=True) - run.at(force, rising=False)) / run.total_grey.max()
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
    """Loadings with one colour a tip."""
    tips = sorted({one.tip_radius_mm for one in loadings})
    return [(one, COLOURS[tips.index(one.tip_radius_mm) % len(COLOURS)]) for one in loadings]


def _presses(loading: Loading, values: NDArray[np.float64], ax: Axes, colour: str) -> None:
    """A ring for every press of loading, a cross for every one of unloading."""
    for rising, mark in ((True, "o"), (False, "x")):
        here = loading.touched & (loading.rising == rising)
        name = _name(loading) if rising else None
        ax.plot(loading.load_n[here], values[here], mark, color=colour, ms=4, markerfacecolor="none", label=name)


def _name(loading: Loading) -> str | None:
    """What the legend calls a tip, once."""
    return f"{loading.tip_radius_mm:g} mm tip" if loading.run == 1 else None
