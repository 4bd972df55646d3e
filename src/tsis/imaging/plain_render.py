"""The image formula as it is written, pixel by pixel: slow, and what the fast rendering is compared with."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import gaussian_filter

from tsis.imaging.contact_edge import coverage
from tsis.imaging.contact_light import SmoothContact, as_contact_model
from tsis.model import LightMap

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging.contact_light import ContactModel
    from tsis.imaging.sensor import Sensor
    from tsis.model import Calibration, PressField


def render_reference(
    field: PressField,
    sensor: Sensor,
    calibration: Calibration,
    *,
    blur_mm: float = 0.05,
    contact_model: ContactModel | str = "rough",
    light: LightMap | None = None,
) -> NDArray[np.float64]:
    """What `tsis.imaging.render.render` computes for a round press, with pressure and slope looked up at each pixel.

    Arguments and result are the same; they are not checked here.
    """
    x, y = sensor.axes_mm()
    radius = sensor.radius_mm()
    outwards = np.gradient(field.face_displacement_mm, field.radius_mm)
    outwards[0] = 0.0

    def at_pixels(profile: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.interp(radius, field.radius_mm, profile, right=0.0))

    slope = at_pixels(outwards)
    arriving = (light or LightMap.uniform()).at(
        x,
        y,
        displacement_mm=at_pixels(field.face_displacement_mm),
        slope_x=slope * x[None, :] / np.maximum(radius, 1e-12),
        slope_y=slope * y[:, None] / np.maximum(radius, 1e-12),
    )
    model = as_contact_model(contact_model)
    share = model.share(at_pixels(field.pressure_kpa), slope=slope, saturation_kpa=calibration.saturation_kpa)
    if isinstance(model, SmoothContact):
        share = coverage(field, sensor) * (radius <= field.radius_mm[-1])
    seen = calibration.gain_grey_per_kpa * calibration.saturation_kpa * arriving * share
    size_x, size_y = sensor.mm_per_pixel
    blurred = gaussian_filter(seen, (blur_mm / size_y, blur_mm / size_x), mode="reflect") if blur_mm else seen
    return np.asarray(blurred * sensor.vignetting())
