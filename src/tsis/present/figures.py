"""Figures: each function draws a value into ``ax`` and returns it."""

from __future__ import annotations

import textwrap
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.calibration.force_line import common_forces, fit_run
from tsis.errors import InputError
from tsis.present.labels import quantity_of
from tsis.present.page import GROUND

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D
    from numpy.typing import ArrayLike, NDArray

    from tsis.calibration.dot_board import DotDiagnostics
    from tsis.calibration.force_line import ForceLine, Loading
    from tsis.calibration.scale import PixelScale
    from tsis.hardness.table import ContactTable
    from tsis.imaging import Features
    from tsis.imaging.gel_contact import GelContact
    from tsis.imaging.profile import RadialProfile
    from tsis.imaging.surface import HeightSurface
    from tsis.inclusion.design.alternatives import Design
    from tsis.inclusion.mobility import Mobility
    from tsis.matching.registration import Alternative
    from tsis.model.estimate import Estimate
    from tsis.model.image import TactileImage
    from tsis.model.press import PressField
    from tsis.model.probe import Led, Probe
    from tsis.optics import GuidedModes
    from tsis.optics.propagation import Propagation
    from tsis.optics.rays.tracing import TracedLight
    from tsis.study.agreement import BlandAltman
    from tsis.study.drift import ControlChart
    from tsis.study.probabilities import ReliabilityCurve
    from tsis.study.proportions import Counts
    from tsis.study.roc import Roc
    from tsis.study.search import ScanPlan


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
NAME_LETTERS = 40  # of a frame's name above an overlay, before it goes on in a line below


def gel_contact(frame: NDArray[Any], contact: GelContact, ax: Axes) -> Axes:
    """Draw a frame with its contact: a full line where it is good, a broken one and the reasons where it is not."""
    from matplotlib.patches import Ellipse  # loaded with the first figure

    levels = np.asarray(frame)
    if levels.ndim == 3 and levels.max() > 255:  # of 16 bits, which matplotlib would cut off
        levels = (255.0 / levels.max() * levels).astype(np.uint8)
    ax.imshow(levels if levels.ndim == 3 else levels.astype(float), cmap="gray", interpolation="nearest")
    title = f"{textwrap.fill(contact.name, NAME_LETTERS)}\nquality {contact.quality:.2f}"
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
    ax.set(xlabel=quantity_of(name).axis, xlim=(low - margin, high + margin), yticks=[])
    return ax


def draw_posterior(estimate: Estimate, name: str, ax: Axes, truth: float | None) -> None:
    """Draw the posterior density of a parameter with its 90 % interval, and the truth if known."""
    drawn = estimate.samples[name]
    ax.hist(drawn, BINS, density=True, histtype="stepfilled", color=POSTERIOR, alpha=0.75, label="posterior")
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
    ax.set(xlabel=quantity_of(first).axis, ylabel=quantity_of(second).axis)
    return ax


def posterior(estimate: Estimate, figure: Figure | None = None) -> Figure:
    """Draw the posterior of every parameter, with its 90 % interval and its prior: side by side, or down a tall figure.

    An estimate that is not trusted shows its flags instead: it has no number to show. ``figure`` is an empty figure;
    None makes one.
    """
    names = estimate.names  # in the order of the cards; a stored mapping has its own
    if figure is None:
        from matplotlib.figure import Figure  # loaded with the first figure

        figure = Figure(figsize=(3.2 * len(names), 2.8), layout="constrained")
    priors = estimate.provenance.get("prior", {})
    width, height = figure.get_size_inches()
    rows, columns = (len(names), 1) if height > width else (1, len(names))
    for name, ax in zip(names, figure.subplots(rows, columns, squeeze=False).flat, strict=True):
        ax.set(xlabel=quantity_of(name).axis, yticks=[])
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
    ax.set(
        xlabel=f"expected error of {quantity_of(first).axis}", ylabel=f"expected error of {quantity_of(second).axis}"
    )
    return ax


DRAWN = 60  # samples of the posterior, each as a thin outline
INCLUSION, TISSUE = "#0072b2", "#f3e3d3"
SECTION_MARGIN = 1.25  # half width of the section over the largest inclusion's distance
NEEDED = ("diameter_mm", "depth_mm")


def tissue_section(estimate: Estimate, ax: Axes) -> Axes:
    """Draw the tissue from its surface down, both axes in millimetres at one scale, with the inclusion in it.

    Each thin outline is one sample of the posterior, so their spread is the uncertainty of size and depth together; the
    thick one has the medians of both and is left out where a parameter is not identified. Below the deepest inclusion
    the tissue is cut off unless the prior's thickness is near. An estimate that is not trusted shows its flags and
    no number: neither outline nor scale.

    Raises
    ------
    InputError
        When the estimate has no diameter or no depth.
    """
    if missing := [name for name in NEEDED if name not in estimate.names]:
        raise InputError(f"a section needs an estimate of {' and '.join(NEEDED)}; it lacks {', '.join(missing)}")
    if not estimate.trusted:
        return withheld(estimate, ax)
    diameter, depth = (np.asarray(estimate.samples[name]) for name in NEEDED)
    chosen = np.linspace(0, len(diameter) - 1, min(DRAWN, len(diameter))).astype(int)
    for index in chosen:
        _inclusion(ax, float(diameter[index]), float(depth[index]), alpha=0.25, linewidth=0.6)
    if all(estimate.identified(name) for name in NEEDED):
        _inclusion(ax, float(np.median(diameter)), float(np.median(depth)), linewidth=2.0)
    deepest = float((diameter + depth)[chosen].max())
    half = SECTION_MARGIN * max(deepest, float(diameter[chosen].max())) / 2 + 1.0
    ax.axhline(0.0, color="0.2", linewidth=1.5)
    ax.text(-half, 0.0, " surface ", va="bottom", ha="left", fontsize=7)
    ax.set(facecolor=TISSUE, xlabel="across / mm", ylabel="depth / mm", aspect="equal")
    ax.set(xlim=(-half, half), ylim=(_bottom(estimate, deepest), -0.08 * deepest))
    return ax


def withheld(estimate: Estimate, ax: Axes) -> Axes:
    """Say why the numbers of an estimate are withheld, in place of a figure: its flags, without any number."""
    reasons = "\n".join(textwrap.fill(flag.replace("_", " "), 28) for flag in estimate.flags)
    ax.set(xticks=[], yticks=[])
    ax.text(
        0.5, 0.5, f"No estimate is shown.\n\n{reasons}", ha="center", va="center", fontsize=8, transform=ax.transAxes
    )
    return ax


def _inclusion(ax: Axes, diameter_mm: float, depth_mm: float, **style: float) -> None:
    from matplotlib.patches import Circle  # loaded with the first figure

    ax.add_patch(Circle((0.0, depth_mm + diameter_mm / 2), diameter_mm / 2, fill=False, color=INCLUSION, **style))


def _bottom(estimate: Estimate, deepest_mm: float) -> float:
    """The lower end of the drawn tissue, mm: the prior's thickness where that is near the deepest inclusion."""
    prior = estimate.provenance.get("prior", {})
    thickness = prior.get("thickness_mm") if hasattr(prior, "get") else None
    cut = SECTION_MARGIN * deepest_mm
    return float(thickness) if isinstance(thickness, (int, float)) and thickness < 2 * cut else cut


CURVE_POINTS = 60


def modulus(estimate: Estimate, ax: Axes, *, truth_kpa: float | None = None) -> Axes:
    """Draw the posterior density of a touched object's modulus with its 90 % interval, and the truth if known."""
    draw_posterior(estimate, "young_kpa", ax, truth_kpa)
    ax.set(xlabel="modulus E / kPa", yticks=[])
    ax.legend(frameon=False)
    return ax


def contact_growth(estimate: Estimate, ax: Axes, *, table: ContactTable) -> Axes:
    """Draw measured contact radii over the force, and those of the estimated moduli where the estimate is trusted.

    The provenance of the estimate, of `tsis.hardness.estimate`, holds the presses; ``table`` is that of the probe.
    """
    presses = [press for press in estimate.provenance["presses"] if press["ball_radius_mm"] is None]
    forces = np.array([press["force_n"] for press in presses])
    radii = np.array([press["seen"]["radius_mm"] for press in presses])
    ax.plot(forces, radii, "o", color=TRUTH, label="frames")
    radius_mm = estimate.provenance["radius"]["radius_mm"]
    if radius_mm is not None and estimate.trusted:
        poisson = float(np.mean(estimate.provenance["prior"]["poisson"]))
        along = np.linspace(0.5 * forces.min(), 1.1 * forces.max(), CURVE_POINTS)
        low, high = estimate.interval(0.9)["young_kpa"]

        def radius(young_kpa: float) -> NDArray[np.float64]:
            return np.asarray(np.exp(table.log_radius(young_kpa, poisson, radius_mm, along)))

        soft, stiff = radius(low), radius(high)
        if "young_kpa" in estimate.mean:
            mean = estimate.mean["young_kpa"]
            ax.plot(along, radius(mean), color=POSTERIOR, label=f"sphere of {mean:.3g} kPa")
        ax.fill_between(along, stiff, soft, color=POSTERIOR, alpha=0.15, label="90 % interval")
    ax.set(xlabel="force F / N", ylabel="contact radius a / mm")
    ax.legend(frameon=False)
    return ax


LABELLED = 5  # rows in the legend


def contact_rows(
    row_mm: NDArray[np.float64], rows: NDArray[np.float64], force_n: NDArray[np.float64], ax: Axes
) -> Axes:
    """Draw grey levels along a line through the contact, a curve for each force (figure 5.2).

    Shapes: positions along the line ``row_mm`` (columns,), grey levels ``rows`` (forces, columns), ascending forces
    ``force_n`` (forces,).
    """
    from matplotlib import colormaps  # loaded with the first figure

    named = set(np.linspace(0, len(force_n) - 1, min(LABELLED, len(force_n))).round().astype(int).tolist())
    shades = colormaps["viridis"](np.linspace(0.0, 0.9, len(force_n)))
    for index, (row, force, shade) in enumerate(zip(rows, force_n, shades, strict=True)):
        ax.plot(row_mm, row, color=shade, linewidth=1, label=f"{force:g} N" if index in named else None)
    ax.set(xlabel="x / mm", ylabel="grey level")
    ax.grid(visible=True, alpha=0.3)
    ax.legend(frameon=False)
    return ax


TIP_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")  # told apart without red-green vision
BAND_POINTS = 60


MILLION = 1e6


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
    return [(loading, TIP_COLOURS[tips.index(loading.tip_radius_mm) % len(TIP_COLOURS)]) for loading in loadings]


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


def light_path(transformed: Mobility, ax: Axes) -> Axes:
    """Draw the positions of the light in mm from the probe's axis, joined in the order of time (6.14)."""
    x, y = transformed.position_mm.T
    ax.plot(x, y, "-", linewidth=0.8, color="0.6")
    shown = ax.scatter(x, y, c=np.arange(len(x)), cmap="viridis", s=14, zorder=3)
    figure = ax.get_figure()
    if figure is not None:
        figure.colorbar(shown, ax=ax, label="frame", fraction=0.04, pad=0.02)
    ax.set(xlabel="x / mm", ylabel="y / mm", aspect="equal")
    ax.invert_yaxis()  # y runs down the image
    ax.grid(visible=True, alpha=0.3)
    return ax


def light_over_time(time_s: NDArray[np.float64], total_grey: NDArray[np.float64], ax: Axes) -> Axes:
    """Draw the sum of grey levels over the time in seconds."""
    ax.plot(time_s, total_grey, ".-", linewidth=0.8, markersize=4)
    ax.set(xlabel="time / s", ylabel="sum of grey levels")
    ax.grid(visible=True, alpha=0.3)
    return ax


SOURCE, TARGET, PAIR = "#0072b2", "#d55e00", "0.65"  # distinct without red-green vision
FEW, LARGE, SMALL = 300, 18.0, 4.0  # points up to which the dots are large
MOST_DRAWN = 5000  # points of each set
GRID, GRID_LINES, GRID_SAMPLES, GRID_MARGIN = "0.8", 16, 60, 0.05


def point_sets(
    source: ArrayLike,
    target: ArrayLike,
    ax: Axes,
    *,
    matches: ArrayLike | None = None,
    source_label: str = "source",
    target_label: str = "target",
) -> Axes:
    """Draw two point sets over each other, with a line from each source point to its match.

    Shapes are (n, 2) and (m, 2), or (n, 3) and (m, 3) on an axes with the projection ``"3d"``. ``matches``, shape (n,),
    has the row of each source point's match or -1. Of more than `MOST_DRAWN` points every second, third, ... is drawn.
    """
    first, second = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
    rows, others = (np.arange(0, len(item), -(-len(item) // MOST_DRAWN)) for item in (first, second))
    surface: Any = ax  # three-dimensional axes, which the declared class does not cover
    size = LARGE if max(len(first), len(second)) <= FEW else SMALL
    if matches is not None:
        partner = np.asarray(matches)
        paired = rows[partner[rows] >= 0]
        ends = np.full((len(paired), 3, first.shape[1]), np.nan)  # a NaN ends a line
        ends[:, 0], ends[:, 1] = first[paired], second[partner[paired]]
        surface.plot(*ends.reshape(-1, first.shape[1]).T, color=PAIR, linewidth=0.7, zorder=1)
    hollow = {"facecolors": "none", "edgecolors": SOURCE}
    surface.scatter(
        *first[rows].T, s=2 * size, label=f"{source_label} ({len(first)})", linewidths=1.0, zorder=3, **hollow
    )
    surface.scatter(*second[others].T, s=size / 2, label=f"{target_label} ({len(second)})", color=TARGET, zorder=2)
    ax.set_aspect("equal")
    ax.set(xlabel="x", ylabel="y")
    if first.shape[1] == 3:
        surface.set_zlabel("z")
    ax.legend(loc="best", fontsize="small")
    return ax


def warped_grid(transform: Callable[[NDArray[np.float64]], NDArray[np.float64]], source: ArrayLike, ax: Axes) -> Axes:
    """Draw the image of a square grid about the source's points, shape (n, 2), under a transform of points (k, 2)."""
    points = np.asarray(source, dtype=float)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = GRID_MARGIN * (high - low).max()
    low, high = low - margin, high + margin
    step = (high - low).max() / GRID_LINES
    for axis in range(2):
        along = np.linspace(low[axis], high[axis], GRID_SAMPLES)
        for at in np.arange(low[1 - axis], high[1 - axis] + step / 2, step):
            line = np.empty((GRID_SAMPLES, 2))
            line[:, axis], line[:, 1 - axis] = along, at
            ax.plot(*transform(line).T, color=GRID, linewidth=0.6, zorder=0)
    return ax


def alternative_pose(alternative: Alternative, target: ArrayLike, ax: Axes) -> Axes:
    """Draw the source in one of the poses that the data allow over the target, with its rotation and probability."""
    point_sets(alternative.moved, target, ax)
    if (legend := ax.get_legend()) is not None:
        legend.remove()  # it would hide points of a small panel
    ax.set_title(f"rotation {alternative.rotation_deg:.0f}°, probability {alternative.probability:.3g}")
    return ax


MARGIN = 0.08  # of the stack's thickness, shown on both sides
POINTS, A_ZERO = 2001, 8  # in total, and least number between two zeros of a field


def mode_profiles(modes: GuidedModes, ax: Axes, *, shown: Sequence[int]) -> Axes:
    """Draw the numbered electric fields over the refractive index, each at the height of its effective index.

    The abscissa is the height above the lowest face of the stack. Fields are scaled to be visible.
    """
    layers = modes.layers
    faces = layers.faces_um
    margin = MARGIN * faces[-1]
    x = np.linspace(-margin, faces[-1] + margin, max(POINTS, A_ZERO * max(shown)))
    ends = np.concatenate([[-margin], faces, [faces[-1] + margin]])
    ax.stairs(layers.index, ends, baseline=None, color="black", linewidth=1.2)
    for (lower, upper), index in zip(pairwise(faces), layers.index[1:-1], strict=True):
        ax.fill_between([lower, upper], float(layers.index.min()), index, color="tab:blue", alpha=0.08, linewidth=0)
    span = float(layers.index.max() - layers.surroundings)
    height = 0.45 * span / max(len(shown), 4)  # most curves do not overlap
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


FAINTEST_DB = -30.0


def guide_index(result: Propagation, ax: Axes) -> Axes:
    """Draw the refractive index, the pressed face on top, with a colour bar."""
    return _map(result, result.index.T, ax, "refractive index", cmap="YlGnBu")


def guide_light(result: Propagation, ax: Axes) -> Axes:
    """Draw the mean intensity of the launched modes in decibels below its largest, and the borders of the layers."""
    brightest = result.intensity.max()
    decibels = 10 * np.log10(np.maximum(result.intensity / brightest, 10 ** (FAINTEST_DB / 10)))
    _map(result, decibels.T, ax, "intensity / dB", cmap="inferno", vmin=FAINTEST_DB, vmax=0.0)
    for interface in result.interfaces_um.T:
        ax.plot(result.z_um, interface, color="white", linewidth=0.5, alpha=0.6)
    return ax


def light_out_of_the_top(results: Iterable[Propagation], ax: Axes) -> Axes:
    """Draw the mean fraction of the light that leaves through the pressed side per µm along the guide, by dent."""
    for result in results:
        total = abs(round(100 * result.powers.top.mean(), 1))  # avoids -0.0
        whole = slice(1, -1)
        ax.plot(
            result.z_um[whole],
            100 * result.top_per_um[whole].mean(axis=1),
            label=f"{result.dent.depth_um:g} µm deep: {total} % in all",
        )
    ax.set(xlabel="distance from the dent's middle / µm", ylabel="light out of the top / (% / µm)")
    ax.set_ylim(top=1.6 * ax.get_ylim()[1])  # room for the legend
    ax.legend(title="dent", loc="upper left")
    ax.grid(visible=True, alpha=0.3)
    return ax


def _map(result: Propagation, values: np.ndarray, ax: Axes, label: str, **style: object) -> Axes:
    left, right, top, bottom = result.z_um[0], result.z_um[-1], result.x_um[0], result.x_um[-1]
    shown = ax.imshow(values, extent=(left, right, bottom, top), aspect="auto", interpolation="nearest", **style)  # type: ignore[arg-type]
    ax.set(xlabel="distance from the dent's middle / µm", ylabel="depth / µm", xlim=(left, right), ylim=(bottom, top))
    ax.figure.colorbar(shown, ax=ax, label=label, pad=0.01)
    return ax


LAYER_COLOURS = ("#d8ecf7", "#bcdcf0", "#9dcae6", "#84b8da", "#6ea7cd")
GLASS_COLOUR, LAMP_COLOUR, RAY_COLOUR, FACE_COLOUR = "#e2e2e2", "#f0b400", "#c0392b", "#1f3b57"
LAMP_DEPTH_MM = 1.2
LABEL: dict[str, Any] = {
    "va": "center",
    "fontsize": 8,
    "zorder": 6,
    "bbox": {"boxstyle": "round,pad=0.15", "facecolor": GROUND, "edgecolor": "none", "alpha": 0.8},
}
FAINTEST = 0.04  # fraction of a ray's initial power below which it is not drawn
WHAT = {
    "arriving": "light arriving from inside, per mm²",
    "lost": "light lost into air, per mm²",
    "coupled": "light leaving through contact, per mm²",
}


def ray_picture(
    probe: Probe, paths: Sequence[NDArray[np.float64]], ax: Axes, *, pressed: PressField | None = None
) -> Axes:
    """Draw layers, glass and lamps from the side, and rays of the first lit lamp, at the right.

    Lamps beside the plane of the picture are omitted. The paths, of `tsis.optics.rays.tracing.trace_paths`, are drawn
    into the plane, fainter where less light remains. ``pressed`` is a press around the axis, whose dent is drawn.
    """
    from matplotlib.collections import LineCollection  # loaded with the first figure
    from matplotlib.colors import to_rgba
    from matplotlib.patches import Rectangle

    first = np.radians(next(led.azimuth_deg for led in probe.leds if led.power > 0))
    span = np.linspace(-probe.radius_mm, probe.radius_mm, 241)
    face = probe.sag_mm(np.abs(span))
    if pressed is not None:
        face = face + np.interp(np.abs(span), pressed.radius_mm, pressed.face_displacement_mm)
    _draw_layers(probe, span, face, ax)
    for led in probe.leds:
        side = np.cos(np.radians(led.azimuth_deg) - first)
        if led.power > 0 and abs(side) > 0.99:
            edge = side * probe.radius_mm
            lower = probe.led_height_mm(led) - led.diameter_mm / 2
            left = edge if side > 0 else edge - LAMP_DEPTH_MM
            ax.add_patch(Rectangle((left, lower), LAMP_DEPTH_MM, led.diameter_mm, color=LAMP_COLOUR, zorder=4))
    for path in paths:
        along = np.column_stack([path[:, 0] * np.cos(first) + path[:, 1] * np.sin(first), path[:, 2]])
        legs = np.stack([along[:-1], along[1:]], axis=1)
        power = path[:-1, 3] / path[0, 3]
        observed = power > FAINTEST
        colours = [to_rgba(RAY_COLOUR, 0.15 + 0.75 * float(fraction)) for fraction in power[observed]]
        ax.add_collection(LineCollection(list(legs[observed]), colors=colours, linewidths=0.8, zorder=3))
    extent = probe.radius_mm + 2 * LAMP_DEPTH_MM
    ax.set(xlim=(-extent, extent), ylim=(-1.0, probe.thickness_mm + probe.glass.thickness_mm + 1.0))
    ax.set(xlabel="distance from the axis / mm", ylabel="height above the face / mm", aspect="equal")
    return ax


def _draw_layers(probe: Probe, span: NDArray[np.float64], face: NDArray[np.float64], ax: Axes) -> None:
    from matplotlib.patches import Polygon, Rectangle

    thickness, level = probe.thickness_mm, 0.0
    for number, layer in enumerate(probe.layers):
        lower = face + level / thickness * (thickness - face)
        level += layer.thickness_mm
        upper = face + level / thickness * (thickness - face)
        outline = np.concatenate([np.column_stack([span, lower]), np.column_stack([span, upper])[::-1]])
        colour = LAYER_COLOURS[number % len(LAYER_COLOURS)]
        ax.add_patch(Polygon(outline, facecolor=colour, edgecolor="white", linewidth=0.5))
        middle = float((lower + upper)[len(span) // 2] / 2)
        ax.text(-0.97 * probe.radius_mm, middle, f"n = {layer.refractive_index:g}", **LABEL)
    glass = probe.glass
    ax.add_patch(Rectangle((-probe.radius_mm, thickness), 2 * probe.radius_mm, glass.thickness_mm, color=GLASS_COLOUR))
    label = f"glass, n = {glass.refractive_index:g}"
    ax.text(-0.97 * probe.radius_mm, thickness + glass.thickness_mm / 2, label, **LABEL)
    ax.plot(span, face, color=FACE_COLOUR, linewidth=1.5, zorder=5)


def light_on_face(traced_light: TracedLight, ax: Axes, *, what: str = "arriving") -> Axes:
    """Draw a map of light on the face in millionths of the emitted power, per mm².

    ``what`` is ``"arriving"``, ``"lost"`` or ``"coupled"``.
    """
    from matplotlib.patches import Circle

    size = float(traced_light.x_mm[1] - traced_light.x_mm[0])
    radius = float(traced_light.x_mm[-1]) + size / 2
    values = getattr(traced_light, what) / size**2 * 1e6
    inside = np.hypot(traced_light.x_mm, traced_light.y_mm[:, None]) <= radius
    shown = ax.imshow(
        np.where(inside, values, np.nan),
        extent=(-radius, radius, radius, -radius),
        cmap="viridis",
        vmin=0.0,
        interpolation="nearest",
    )
    ax.add_patch(Circle((0.0, 0.0), radius, fill=False, color=FACE_COLOUR, linewidth=1.0))
    figure = ax.get_figure()
    if figure is not None:
        label = f"{WHAT[what]}\n(millionths of the lamps' light)"
        figure.colorbar(shown, ax=ax, label=label, shrink=0.9)
    ax.set(xlabel="x / mm", ylabel="y / mm")
    return ax


BEAM = 0.3  # opacity of the light of a lamp within its half angle
STEEPEST = 89.0  # largest drawn angle, degrees


def probe_section(probe: Probe, ax: Axes) -> Axes:
    """Draw layers with moduli and refractive indices, glass, face, and the lamps with their beams.

    A lamp is shown when it is in the plane of the first lit one, which is at the right.
    """
    ray_picture(probe, (), ax)
    limits = (ax.get_xlim(), ax.get_ylim())
    level = 0.0
    for layer in probe.layers:
        ax.text(0.97 * probe.radius_mm, level + layer.thickness_mm / 2, f"{layer.young_kpa:g} kPa", ha="right", **LABEL)
        level += layer.thickness_mm
    first = next(led.azimuth_deg for led in probe.leds if led.power > 0)
    for led in probe.leds:
        side = float(np.cos(np.radians(led.azimuth_deg - first)))
        if led.power > 0 and abs(side) > 0.99:
            _beam(probe, led, np.sign(side), ax)
    ax.set(xlim=limits[0], ylim=limits[1])  # cuts the beams
    return ax


def _beam(probe: Probe, led: Led, side: float, ax: Axes) -> None:
    """The cone of more than half of a lamp's intensity, up to the axis."""
    from matplotlib.path import Path

    height, edge = probe.led_height_mm(led), side * probe.radius_mm
    angles = np.radians(np.clip(led.aim_deg + led.half_angle_deg * np.array([-1.0, 1.0]), -STEEPEST, STEEPEST))
    ends = height + probe.radius_mm * np.tan(angles)  # on the axis
    (beam,) = ax.fill([edge, 0.0, 0.0], [height, *ends], color=LAMP_COLOUR, alpha=BEAM, linewidth=0, zorder=2)
    radius = np.linspace(-probe.radius_mm, probe.radius_mm, 241)
    top = np.full_like(radius, probe.thickness_mm + probe.glass.thickness_mm)
    inside = np.concatenate([np.column_stack([radius, probe.sag_mm(radius)]), np.column_stack([radius, top])[::-1]])
    beam.set_clip_path(Path(inside), transform=ax.transData)
    middle = height + probe.radius_mm * np.tan(np.radians(led.aim_deg))
    ax.plot([edge, 0.0], [height, middle], color=LAMP_COLOUR, linewidth=0.8, linestyle="--", zorder=3)


BLUE, WARM, GREY = "#0072b2", "#d55e00", "0.45"
FAR = 4.0  # tolerances beyond that many half widths of the limits are not drawn


def roc_curve(curve: Roc, ax: Axes, *, label: str = "", counts: Counts | None = None, colour: str = BLUE) -> Axes:
    """Draw a ROC curve, the diagonal of chance, and the fixed threshold with both Wilson intervals.

    ``label`` names the detector; ``counts`` are its decisions at the fixed threshold.
    """
    ax.plot([0, 1], [0, 1], color="0.75", linewidth=1, zorder=1)
    style: dict[str, Any] = {"color": colour, "clip_on": False}
    rates = curve.false_positive_rate, curve.true_positive_rate
    ax.plot(*rates, drawstyle="steps-post", label=label or None, linewidth=1.8, **style)
    if counts is not None:
        result, false = counts.sensitivity, 1 - counts.specificity.value
        low, high = result.interval()
        least, most = counts.specificity.interval()
        across = [[max(false - (1 - most), 0.0)], [max(1 - least - false, 0.0)]]
        upwards = [[max(result.value - low, 0.0)], [max(high - result.value, 0.0)]]
        ax.errorbar(
            false, result.value, xerr=across, yerr=upwards, fmt="o", markersize=6, capsize=3, linewidth=1, **style
        )
    ax.set(xlim=(0, 1), ylim=(0, 1), xlabel="1 - specificity", ylabel="sensitivity", aspect="equal")
    return ax


def scores_by_truth(scores: ArrayLike, present: ArrayLike, ax: Axes, *, threshold: float) -> Axes:
    """Draw scores of targets with and without inclusion, both of shape (targets,), and the threshold."""
    values, truth = np.asarray(scores, dtype=float), np.asarray(present, dtype=bool)
    for index, (kind, colour) in enumerate(((False, GREY), (True, BLUE))):
        own = np.sort(values[truth == kind])
        beside = 0.5 * (np.arange(len(own)) / max(len(own) - 1, 1) - 0.5)
        ax.plot(index + beside, own, "o", color=colour, markersize=5, alpha=0.8, clip_on=False)
    ax.axhline(threshold, color=WARM, linestyle="--", linewidth=1.2, label=f"threshold {threshold:g}")
    ax.set(xlim=(-0.5, 1.5), ylabel="score")
    ax.set_xticks([0, 1], ["blank", "inclusion"])
    if len(values) and values.min() >= 0 and values.max() <= 1:
        ax.set_ylim(-0.02, 1.02)
    ax.legend(frameon=False, fontsize=8)
    return ax


def reliability_diagram(curve: ReliabilityCurve, ax: Axes) -> Axes:
    """Draw observed fractions over predicted probabilities by bin, with Wilson intervals; the diagonal is ideal."""
    ax.plot([0, 1], [0, 1], color="0.75", linewidth=1)
    predicted = np.array([item.probability for item in curve.bins])
    observed = np.array([item.observed.value for item in curve.bins])
    ends = np.array([tuple(item.observed.interval()) for item in curve.bins])
    errors = np.maximum([observed - ends[:, 0], ends[:, 1] - observed], 0.0)
    ax.errorbar(predicted, observed, yerr=errors, fmt="o-", color=BLUE, capsize=3, linewidth=1.2, clip_on=False)
    for item, x, y in zip(curve.bins, predicted, observed, strict=True):
        above = y < 0.5  # inside the frame
        ax.annotate(
            str(item.observed.trials), (x, y), xytext=(5, 5 if above else -11), textcoords="offset points", fontsize=7.5
        )
    ax.set(xlim=(-0.02, 1.02), ylim=(-0.02, 1.02), xlabel="predicted probability", ylabel="fraction with an inclusion")
    ax.set_aspect("equal")
    return ax


def detected_by_size_and_depth(
    diameter_mm: ArrayLike, depth_mm: ArrayLike, result: Sequence[bool | None], ax: Axes
) -> Axes:
    """Draw inclusions over size and depth, deep ones below: found, missed and undecided.

    All have shape (inclusions,); ``result`` is None without a decision.
    """
    size, depth = np.asarray(diameter_mm, dtype=float), np.asarray(depth_mm, dtype=float)
    for response, marker, colour, label in (
        (True, "o", BLUE, "found"),
        (False, "X", WARM, "missed"),
        (None, "s", GREY, "undecided"),
    ):
        own = np.array([item is response for item in result], dtype=bool)
        if own.any():
            ax.plot(size[own], depth[own], marker, color=colour, label=label, markersize=7, alpha=0.85)
    ax.set(xlabel="diameter / mm", ylabel="depth / mm")
    ax.margins(0.12)
    ax.invert_yaxis()
    if ax.lines:
        ax.legend(frameon=False, fontsize=8)
    return ax


def read_over_true(true: ArrayLike, read: ArrayLike, ax: Axes, *, label: str, errors: ArrayLike | None = None) -> Axes:
    """Draw readings over true values, shape (targets,); on the diagonal they agree.

    ``label`` gives name and unit; ``errors`` the distances of both ends of an interval from the reading, shape (2,
    targets).
    """
    true_values, readings = np.asarray(true, dtype=float), np.asarray(read, dtype=float)
    both = np.concatenate([true_values, readings])
    room = 0.05 * float(np.ptp(both) or 1.0)
    ends = float(both.min()) - room, float(both.max()) + room
    ax.plot(ends, ends, color="0.75", linewidth=1)
    if errors is not None:
        ax.errorbar(true_values, readings, yerr=errors, fmt="none", color="0.65", linewidth=0.8)
    ax.plot(true_values, readings, "o", color=BLUE, markersize=5, alpha=0.85)
    ax.set(xlabel=f"true {label}", ylabel=f"read {label}")
    return ax


def agreement_limits(bland_altman: BlandAltman, ax: Axes, *, label: str) -> Axes:
    """Draw differences over means of two methods, with the bias and both limits of agreement.

    ``label`` gives name and unit of the quantity.
    """
    ax.plot(bland_altman.means, bland_altman.differences, "o", color=BLUE, markersize=5, alpha=0.85)
    ax.axhline(0.0, color="0.75", linewidth=1)
    ax.axhline(bland_altman.bias, color=WARM, linewidth=1.2, label="bias")
    for limit in bland_altman.limits():
        ax.axhline(limit, color=WARM, linewidth=1.2, linestyle="--")
    ax.set(xlabel=f"mean {label}", ylabel=f"difference of {label}")
    return ax


def drift_chart(chart: ControlChart, ax: Axes, *, label: str, tolerance: float) -> Axes:
    """Draw a control chart: values, their EWMA, both kinds of limits, and the tolerance on each side of the centre."""
    count, end = np.arange(1, len(chart.values) + 1), max(len(chart.values), chart.baseline + 1) + 0.5
    ax.axvspan(0.5, chart.baseline + 0.5, color="0.94", zorder=0, label="baseline")
    ax.plot(count, chart.values, "o", color=GREY, markersize=3.5, label="check")
    ax.plot(count, chart.ewma, "-", color=BLUE, linewidth=1.6, label="EWMA")
    for sign, shown in ((1, ("EWMA limits", "Shewhart limits", "out of tolerance")), (-1, (None, None, None))):
        ax.plot(count, chart.centre + sign * chart.ewma_half, ":", color=BLUE, linewidth=1.3, label=shown[0])
        edge = [chart.centre + sign * chart.shewhart] * 2
        ax.plot([chart.baseline + 0.5, end], edge, "--", color="0.25", linewidth=1.1, label=shown[1])
        if tolerance < FAR * chart.shewhart:
            ax.axhline(chart.centre + sign * tolerance, color=WARM, linewidth=1.2, label=shown[2])
    marked = chart.beyond_shewhart | chart.beyond_ewma
    ax.plot(count[marked], chart.values[marked], "o", color=WARM, markersize=4.5, label="beyond a limit")
    ax.set(xlabel="check", ylabel=label, xlim=(0.5, end))
    ax.ticklabel_format(axis="y", useOffset=False)
    ax.legend(frameon=False, fontsize=7, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.18))
    return ax


FACE, RANGE, PATH, WORST = "#999999", "#0072b2", "#333333", "#d55e00"  # distinct without red-green vision


def draw_scan_plan(plan: ScanPlan, ax: Axes, *, extent_mm: float | None = None) -> Axes:
    """Draw the area, the face at each press, the path of the presses, and a point farthest from any press.

    Both axes get one scale. ``extent_mm`` is the detection range beside a press, drawn as filled discs.
    """
    from matplotlib.patches import Rectangle  # loaded with the first figure

    positions = plan.positions_mm
    if extent_mm is not None and extent_mm > 0:
        _discs(plan, ax, extent_mm, facecolor=RANGE, alpha=0.25)
        ax.plot([], [], "o", color=RANGE, alpha=0.25, label=f"within {extent_mm:.3g} mm of a press")
    _discs(plan, ax, plan.radius_mm, facecolor="none", edgecolor=FACE, linewidth=0.6)
    ax.plot([], [], "o", color=FACE, markerfacecolor="none", label="face of the probe")
    ax.add_patch(Rectangle((0.0, 0.0), plan.width_mm, plan.height_mm, fill=False, linewidth=1.5, label="area"))
    ax.plot(*positions.T, "-", color=PATH, linewidth=0.8, marker=".", markersize=4, label="path of the presses")
    ax.plot(*positions[0], "o", color=PATH, markersize=6, label="first press")
    at = positions[0] + (plan.strip_spacing_mm / 2, plan.press_spacing_mm / 2)
    farthest = f"farthest from any press, {plan.worst_distance_mm:.3g} mm"
    ax.plot(*at, "x", color=WORST, markersize=8, markeredgewidth=2, label=farthest)
    margin = max(plan.radius_mm, *plan.overhang_mm, 1.0)
    ax.set(
        xlim=(-margin, plan.width_mm + margin),
        ylim=(-margin, plan.height_mm + margin),
        aspect="equal",
        xlabel="across strips / mm",
        ylabel="along strips / mm",
    )
    return ax


def _discs(plan: ScanPlan, ax: Axes, radius_mm: float, **view: object) -> None:
    """Draw a disc around each press as one artist without legend: a plan may have thousands."""
    from matplotlib.collections import EllipseCollection

    size = [2 * radius_mm]
    discs = EllipseCollection(
        size, size, [0.0], units="xy", offsets=plan.positions_mm, transOffset=ax.transData, **view
    )  # fmt: skip
    ax.add_collection(discs)
