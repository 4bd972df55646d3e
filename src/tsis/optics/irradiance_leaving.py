"""The light that a press lets out through real contact, by the smooth light on the face instead of rays."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.optics.asperities import real_contact
from tsis.optics.rays_face import on_face, slopes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import LightMap, PressField, PressMap
    from tsis.optics.irradiance_field import Irradiance

FINE_POINTS = 480  # along each side of the square around the face


def leaving_light(
    light: Irradiance, pressed: PressField | PressMap, *, saturation_kpa: float, bins: int, by: LightMap | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Light that leaves through contact in each bin, and the mean displacement where it leaves, shape (bins, bins).

    The light is a share of what the lamps send out, as the tracer's map of it; the displacement is weighted by it.
    With ``by`` the light on the face is read off that map.
    """
    points = bins * max(1, FINE_POINTS // bins)
    spacing = 2 * light.radius_mm / points
    side: NDArray[np.float64] = (np.arange(points, dtype=float) + 0.5) * spacing - light.radius_mm
    from_axis = np.hypot(side, side[:, None])
    moved, pressure = on_face(pressed, side, np.minimum(from_axis, light.radius_mm))
    slope_x, slope_y = slopes(moved, side)
    there = (light if by is None else by).at(side, side, displacement_mm=moved, slope_x=slope_x, slope_y=slope_y)
    inside = from_axis < light.radius_mm
    there = np.asarray(there, dtype=float)
    share = np.where(inside, real_contact(pressure, saturation_kpa), 0.0)
    left = 1.0 if by is not None else light.remaining(there[inside], share[inside])
    out = light.mean_per_mm2 * spacing**2 * there * share * left
    fine = (bins, points // bins, bins, points // bins)
    total, weighted = (part.reshape(fine).sum(axis=(1, 3)) for part in (out, out * moved))
    return total, weighted / np.maximum(total, np.finfo(float).tiny)
