"""Figure of a probe from the side: layers with moduli, face, lamps with beams."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.path import Path

from tsis.plots._optics import LABEL, LAMP_COLOUR, ray_picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tsis.model import Led, Probe


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
