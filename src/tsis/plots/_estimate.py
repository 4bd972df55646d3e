"""Figures of posteriors beside priors, and of expected errors of designs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tsis.inclusion.design import Design
    from tsis.model import Estimate


LABELS = {"diameter_mm": "diameter d / mm", "depth_mm": "depth h / mm", "young_kpa": "modulus E / kPa"}
BINS = 40
TRUTH = "#d55e00"  # distinct without red-green vision
POSTERIOR = "#0072b2"


def marginal(
    estimate: Estimate, name: str, ax: Axes, *, prior_range: tuple[float, float], truth: float | None = None
) -> Axes:
    """Draw the posterior density of a parameter with its 90 % interval, the uniform prior and the truth if known.

    ``prior_range`` has the ends of the prior, which set the axis. An estimate that is not trusted raises
    `UntrustedError`.
    """
    low, high = prior_range
    ax.plot([low, low, high, high], [0, 1 / (high - low), 1 / (high - low), 0], color="0.4", label="prior")
    draw_posterior(estimate, name, ax, truth)
    margin = 0.02 * (high - low)
    ax.set(xlabel=LABELS.get(name, name), xlim=(low - margin, high + margin), yticks=[])
    return ax


def draw_posterior(estimate: Estimate, name: str, ax: Axes, truth: float | None) -> None:
    """Draw the posterior density of a parameter with its 90 % interval, and the truth if known."""
    ax.hist(estimate.samples[name], bins=BINS, density=True, color=POSTERIOR, alpha=0.75, label="posterior")
    ax.axvspan(*estimate.interval(0.9)[name], color=POSTERIOR, alpha=0.15, label="90 % interval")
    if truth is not None:
        ax.axvline(truth, color=TRUTH, linestyle="--", linewidth=2, label="truth")


def trade_off(
    estimate: Estimate, names: tuple[str, str], ax: Axes, *, truth: tuple[float, float] | None = None
) -> Axes:
    """Draw the joint posterior of two parameters as the density of its samples, with the truth if known."""
    first, second = names
    x, y = estimate.samples[first], estimate.samples[second]
    counts, x_edges, y_edges = np.histogram2d(x, y, bins=BINS)
    ax.pcolormesh(x_edges, y_edges, counts.T, cmap="Blues", rasterized=True)
    if truth is not None:
        ax.plot(*truth, "x", color=TRUTH, markersize=10, markeredgewidth=2)
    ax.set(xlabel=LABELS.get(first, first), ylabel=LABELS.get(second, second))
    return ax


def posterior(estimate: Estimate, figure: Figure | None = None) -> Figure:
    """Draw the posterior of every parameter, with its 90 % interval and its prior, side by side.

    An estimate that is not trusted shows its flags instead: it has no number to show. ``figure`` is an empty figure;
    None makes one.
    """
    names = tuple(estimate.prior_sd)
    if figure is None:
        from matplotlib.figure import Figure  # loaded with the first figure

        figure = Figure(figsize=(3.2 * len(names), 2.8), layout="constrained")
    priors = estimate.provenance.get("prior", {})
    for name, ax in zip(names, figure.subplots(1, len(names), squeeze=False)[0], strict=True):
        ax.set(xlabel=LABELS.get(name, name), yticks=[])
        if not estimate.trusted:
            ax.set(xticks=[])
            ax.text(0.5, 0.5, "\n".join(("not to be trusted", *estimate.flags)), ha="center", va="center", fontsize=7)
        elif isinstance(priors.get(name), (tuple, list)):
            marginal(estimate, name, ax, prior_range=tuple(priors[name]))
        else:
            draw_posterior(estimate, name, ax, None)
    return figure


WITHIN_LIMITS, BEYOND_LIMITS = "#0072b2", "#d55e00"  # distinct without red-green vision, and by the marker


def design_errors(designs: Sequence[Design], names: tuple[str, str], ax: Axes) -> Axes:
    """Draw the expected errors of two parameters, a numbered point for each design; nearer to the corner is better.

    Circles meet every limit, crosses break one. The legend names the designs by their number, from 1 in their order.
    ``names`` are the parameters along x and y.
    """
    first, second = names
    for number, design in enumerate(designs, start=1):
        x, y = design.information.rmse[first], design.information.rmse[second]
        marker, colour = ("x", BEYOND_LIMITS) if design.limits.broken else ("o", WITHIN_LIMITS)
        ax.plot(x, y, marker, color=colour, markersize=5, label=f"{number}  {design.protocol.name}")
        ax.annotate(str(number), (x, y), xytext=(4, 3), textcoords="offset points", fontsize=7)
    ax.margins(0.1)
    ax.set(xlabel=f"expected error of {LABELS[first]}", ylabel=f"expected error of {LABELS[second]}")
    return ax
