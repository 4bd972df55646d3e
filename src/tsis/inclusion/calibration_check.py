"""Does a calibration belong to the probe?"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tsis.model.errors import NotCalibratedError
from tsis.model.image_series import require_same_probe

if TYPE_CHECKING:
    from tsis.model import Calibration, LightMap, Probe

ROUNDING = 1e-6  # of the radius


def check_calibration(calibration: Calibration, probe: Probe) -> None:
    """Refuse a missing calibration, or one of another probe.

    Raises
    ------
    InputError
        When ``probe`` is no `Probe`.
    NotCalibratedError
        When there is no calibration, both names are known and differ, or the map of the light ends inside the
        probe's face.
    """
    require_same_probe(probe, calibration)
    light = calibration.light
    if light is None or _is_even(light):
        return
    reach = min(-light.x_mm[0], light.x_mm[-1], -light.y_mm[0], light.y_mm[-1])
    if reach < (1 - ROUNDING) * probe.radius_mm:
        raise NotCalibratedError(
            f"light of the calibration must reach the rim of the face at {probe.radius_mm:g} mm; got a map that ends "
            f"at {reach:g} mm: it is that of a smaller probe, so calibrate the light of this one"
        )


def _is_even(light: LightMap) -> bool:
    """The same all over, so that its last values hold beyond its ends too."""
    fields = (light.relative, light.flux_x, light.flux_y, light.growth_per_mm, light.bend_per_mm2)
    return all(np.ptp(field) == 0 for field in fields)
