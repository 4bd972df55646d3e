"""Guided modes over the layers that guide them."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

    from tsis.optics import GuidedModes

MARGIN = 0.08  # of the stack's thickness, shown on both sides
POINTS, A_ZERO = 2001, 8  # in all, and at least so many from zero to zero of a field


def mode_profiles(modes: GuidedModes, ax: Axes, *, shown: Sequence[int]) -> Axes:
    """Draw numbered electric fields, each at the height of its effective index, over the refractive index of the stack.

    Parameters
    ----------
    modes
        The modes of a stack.
    ax
        Where to draw; across is the height above the lowest face, up are indices. Fields are scaled to be seen.
    shown
        Numbers of the modes to draw.
    """
    layers = modes.layers
    faces = layers.faces_um
    margin = MARGIN * faces[-1]
    x = np.linspace(-margin, faces[-1] + margin, max(POINTS, A_ZERO * max(shown)))
    ends = np.concatenate([[-margin], faces, [faces[-1] + margin]])
    ax.stairs(layers.index, ends, baseline=None, color="black", linewidth=1.2)
    for (lower, upper), index in zip(pairwise(faces), layers.index[1:-1], strict=True):
        ax.fill_between([lower, upper], float(layers.index.min()), index, color="tab:blue", alpha=0.08, linewidth=0)
    height = 0.45 * _spacing(modes, shown)
    for number in shown:
        field = modes.profile(number, x)
        line = modes.n_eff[number] + height * field / np.abs(field).max()
        (curve,) = ax.plot(x, line, linewidth=0.9)
        ax.annotate(
            str(number),
            (1.0, float(line[-1])),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            color=curve.get_color(),
            va="center",
            fontsize="small",
        )
    ax.set(xlabel="height above the face / µm", ylabel="effective index, and field E (scaled)")
    ax.set_xlim(x[0], x[-1])
    return ax


def _spacing(modes: GuidedModes, shown: Sequence[int]) -> float:
    """Height that each curve may have, in effective index, so that most stand clear of each other."""
    span = float(modes.layers.index.max() - modes.layers.surroundings)
    return span / max(len(shown), 4)
