"""Figures of optics and of the probe: guided modes, propagation, rays, light on the face, layers and lamps."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from tsis.model import Led, PressField, Probe
    from tsis.optics import GuidedModes
    from tsis.optics.propagation import Propagation
    from tsis.optics.rays import TracedLight


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
    "bbox": {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
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

    Lamps beside the plane of the picture are omitted. The paths, of `tsis.optics.rays.trace_paths`, are drawn into the
    plane, fainter where less light remains. ``pressed`` is a press around the axis, whose dent is drawn.
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
