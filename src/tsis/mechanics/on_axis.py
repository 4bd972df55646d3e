"""Inclusions on the probe's axis as bodies of revolution, and how finely what lies around them is meshed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.mesh import Spheroid
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from tsis.model import Inclusion, Phantom, Probe


def sphere_on_axis(diameter_mm: float, depth_mm: float) -> Spheroid:
    """The sphere whose top lies ``depth_mm`` under the skin."""
    radius = diameter_mm / 2
    return Spheroid(centre_depth=depth_mm + radius, half_width=radius, half_height=radius)


def block_radius_mm(probe: Probe, thickness_mm: float, width_mm: float = 0.0) -> float:
    """Radius of the block around the axis that is meshed anew for inclusions of up to ``width_mm``."""
    return max(min(0.8 * probe.radius_mm, thickness_mm), 0.65 * width_mm)


def central_cell_mm(width_mm: float, depth_mm: float, centre_mm: float) -> float:
    """Largest cell of the face that still follows what an inclusion under it does.

    That is about as wide as the inclusion's centre lies deep, or as the gap over a large one that nearly touches it.
    """
    return 0.6 * min(centre_mm, depth_mm + float(np.sqrt(width_mm * depth_mm)))


def shape_on_axis(phantom: Phantom) -> Spheroid:
    """The phantom's only inclusion as a body of revolution.

    Raises
    ------
    InputError
        When it is none around the probe's axis, or there are several.
    """
    inclusion: Inclusion | None = phantom.inclusion
    if inclusion is None or not phantom.is_axisymmetric:
        raise InputError(
            "inclusion must be one sphere or spheroid on the probe's axis (offset_mm (0, 0), semi_axes_mm x = y, "
            f"no more_inclusions) for this model; got {phantom.inclusions!r:.200}; press_solid takes any"
        )
    half_width, _, half_height = inclusion.half_axes_mm
    return Spheroid(centre_depth=inclusion.centre_depth_mm, half_width=half_width, half_height=half_height)
