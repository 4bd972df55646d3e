"""From contact pressure to light: the rough-contact model under uniform light.

Light leaves the probe where asperities touch, and the share of real contact area grows with the pressure until it
saturates: ``grey = gain * saturation * erf(0.886 p / saturation)``. Lens and gel blur it a little.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import cv2
import numpy as np
from scipy.special import erf

from tsis.model import PressMap, check

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.imaging.sensor import Sensor
    from tsis.model import Calibration, PressField

ERF_SLOPE = np.sqrt(np.pi) / 2  # erf(0.886 x) has the slope 1 at zero


def rough_contact(pressure_kpa: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Grey level above background of a contact pressure in kPa (any shape); no light without pressure.

    Examples
    --------
    >>> from tsis.model import Calibration
    >>> answer = Calibration(gain_grey_per_kpa=50.0, saturation_kpa=20.0)
    >>> [round(float(grey), 1) for grey in rough_contact(np.array([-1.0, 0.1, 1000.0]), answer)]
    [0.0, 5.0, 1000.0]
    """
    level = calibration.gain_grey_per_kpa * calibration.saturation_kpa
    share = erf(ERF_SLOPE * np.maximum(pressure_kpa, 0.0) / calibration.saturation_kpa)
    return np.asarray(level * share, dtype=float)


def rough_contact_slope(pressure_kpa: NDArray[np.float64], calibration: Calibration) -> NDArray[np.float64]:
    """Derivative of `rough_contact` by the pressure, grey levels per kPa."""
    exponent = -((ERF_SLOPE * pressure_kpa / calibration.saturation_kpa) ** 2)
    return np.asarray(calibration.gain_grey_per_kpa * np.exp(exponent) * (pressure_kpa >= 0), dtype=float)


def render(
    field: PressField | PressMap, sensor: Sensor, calibration: Calibration, *, blur_mm: float = 0.05
) -> NDArray[np.float64]:
    """Expected light of a press on the sensor, before noise.

    Parameters
    ----------
    field
        The press, around the axis or over a grid; dark outside its face.
    sensor
        The camera that sees it, its axis on the probe's axis.
    calibration
        Answer of grey level to pressure.
    blur_mm
        Standard deviation of the point spread on the face, mm, in [0, 10].

    Returns
    -------
    Grey levels above the background, shape (rows, columns), not clipped.
    """
    check.number("blur_mm", blur_mm, 0.0, 10.0)
    grey = rough_contact(field.pressure_kpa, calibration)
    if isinstance(field, PressMap):
        x, y = sensor.axes_mm()
        light = _between(field.y_mm, y) @ grey @ _between(field.x_mm, x).T
    else:
        light = np.interp(sensor.radius_mm(), field.radius_mm, grey, right=0.0)
    if blur_mm == 0:
        return light
    sigma_x, sigma_y = (blur_mm / size for size in sensor.mm_per_pixel)
    blurred = cv2.GaussianBlur(light, (0, 0), sigmaX=sigma_x, sigmaY=sigma_y, borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred, dtype=float)


def _between(knots: NDArray[np.float64], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix from values at ``knots`` to values at ``at``, shape (len(at), len(knots)): linear, and zero outside."""
    columns = [np.interp(at, knots, unit, left=0.0, right=0.0) for unit in np.eye(len(knots))]
    return np.column_stack(columns)
