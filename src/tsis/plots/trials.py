"""Errors over repeated trials beside levels that others reached."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

TRIAL_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")  # told apart without red-green vision
LEVEL_STYLES = ("-", "--", ":", "-.")


def trial_errors(
    errors: Mapping[str, ArrayLike],
    ax: Axes,
    *,
    levels: Mapping[str, float],
    error_label: str,
    top: float | None = None,
) -> Axes:
    """Draw one error a trial, a colour for each method, with horizontal lines at what others reached.

    Parameters
    ----------
    errors
        Errors of each method, shape (trials,).
    ax
        Where to draw.
    levels
        Values to draw lines at, with their names.
    error_label
        Name and unit of the error, e.g. ``"RMSE of diameter / mm"``.
    top
        Where the axis ends; errors beyond it are drawn there as triangles. None lets the axis hold them all.
    """
    for colour, (name, values) in zip(itertools.cycle(TRIAL_COLOURS), errors.items(), strict=False):
        shown = np.asarray(values, dtype=float)
        trial = np.arange(1, len(shown) + 1)
        beyond = np.zeros(shown.shape, dtype=bool) if top is None else shown > top
        ax.plot(trial[~beyond], shown[~beyond], ".", color=colour, markersize=4, label=name)
        if beyond.any():
            ax.plot(trial[beyond], np.full(beyond.sum(), top), "^", color=colour, markersize=5, clip_on=False)
    for style, (name, level) in zip(itertools.cycle(LEVEL_STYLES), levels.items(), strict=False):
        ax.axhline(level, color="0.25", linestyle=style, linewidth=1.2, label=name)
    ax.set(xlabel="trial", ylabel=error_label)
    ax.set_ylim(bottom=0.0, top=top)
    return ax
