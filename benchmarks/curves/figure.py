"""The curves as panels of one figure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from benchmarks.curves.curve import Curve

MARKS = "os^D"


def draw(curves: Sequence[Curve], path: Path) -> None:
    """A panel a curve, both axes logarithmic, fitted powers as thin lines."""
    figure = Figure(figsize=(9.0, 7.0), layout="constrained")
    panels = np.atleast_1d(figure.subplots(-(-len(curves) // 2), 2 if len(curves) > 1 else 1)).ravel()
    for ax, curve in zip(panels, curves, strict=False):
        for number, line in enumerate(curve.lines):
            sizes, values = np.array(line.size), np.array(line.value)
            colour = f"C{number}"
            ax.loglog(sizes, values, MARKS[number % len(MARKS)], color=colour, label=line.label)
            fitted = sizes[sizes >= line.fit_from]
            middle = np.log(values[sizes >= line.fit_from]).mean() - line.exponent * np.log(fitted).mean()
            ax.loglog(fitted, np.exp(middle) * fitted**line.exponent, "-", color=colour, linewidth=0.8)
        ax.set(title=curve.title, xlabel=curve.size_name)
        sizes = np.array(sorted({size for line in curve.lines for size in line.size}))
        if len(sizes) <= 4:
            ax.set_xticks(sizes, [f"{size:g}" for size in sizes], minor=False)
            ax.set_xticks([], minor=True)
        ax.margins(y=0.45)  # room for the legend
        ax.grid(visible=True, which="major", linewidth=0.3)
        ax.legend(fontsize=7)
    for ax in panels[len(curves) :]:
        ax.set_visible(False)
    figure.savefig(path, dpi=90)
