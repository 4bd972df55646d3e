"""The bench of section 5.1: tips pressed on the probe, and the camera settings that the source does not print."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import tsis
from tsis.imaging import Sensor
from tsis.mechanics import effective_modulus_kpa, hertz_under_force
from tsis.model import Calibration, PressField

if TYPE_CHECKING:
    from numpy.typing import NDArray

PRINTED_SLOPE = 1.4778e6  # grey levels a newton, (5.4)
RMS_SLOPE = 1.25
MN = 1000.0
PROBE = tsis.load_probe("tsis-2011")
SENSOR = Sensor()


def plane_strain(young_kpa: float, poisson: float) -> float:
    """``E* = E / (1 - nu**2)``."""
    return young_kpa / (1 - poisson**2)


def half_space_kpa() -> float:
    """``E*`` of the half-space that stands for the probe."""
    return plane_strain(effective_modulus_kpa(PROBE.layers), PROBE.layers[0].poisson)


def saturation_kpa(rms_slope: float) -> float:
    """Pressure at which asperities of that slope touch all over: they touch a share ``2 p / (E* slope)`` at first."""
    skin = PROBE.layers[0]
    return plane_strain(skin.young_kpa, skin.poisson) * rms_slope / 2


def bench(rms_slope: float = RMS_SLOPE) -> Calibration:
    """A gain that gives the printed slope while no asperity saturates."""
    pixel = SENSOR.mm_per_pixel[0] * SENSOR.mm_per_pixel[1]
    return Calibration(gain_grey_per_kpa=PRINTED_SLOPE * pixel / MN, saturation_kpa=saturation_kpa(rms_slope))


def full_contact() -> float:
    """Grey levels where all asperities touch."""
    return bench().gain_grey_per_kpa * bench().saturation_kpa


def pressed(tip_mm: float, force_n: float) -> PressField:
    """Hertz's pressure and displacement on a half-space with the probe's effective modulus."""
    contact = hertz_under_force(
        radius_mm=tip_mm,
        force_mn=force_n * MN,
        young_kpa=effective_modulus_kpa(PROBE.layers),
        poisson=PROBE.layers[0].poisson,
    )
    edge = contact.contact_radius_mm
    inner = edge * np.sin(np.linspace(0.0, np.pi / 2, 400))  # dense where the pressure ends
    radius = np.concatenate([inner, np.geomspace(edge, max(PROBE.radius_mm, 1.01 * edge), 400)[1:]])
    return PressField(
        radius_mm=radius,
        pressure_kpa=np.where(radius < edge, contact.pressure_kpa(radius), 0.0),
        face_displacement_mm=displaced(radius, edge, tip_mm),
        approach_mm=edge**2 / tip_mm,
        force_n=force_n,
    )


def displaced(radius: NDArray[np.float64], edge: float, tip_mm: float) -> NDArray[np.float64]:
    """Displacement of a half-space under Hertz's pressure: the sphere's paraboloid inside, what it drags along outside.

    ``u = ((2 a**2 - r**2) asin(a / r) + a sqrt(r**2 - a**2)) / (pi R)`` for r > a.
    """
    beyond = np.maximum(radius, edge)
    dragged = (2 * edge**2 - radius**2) * np.arcsin(edge / beyond) + edge * np.sqrt(beyond**2 - edge**2)
    return np.where(radius <= edge, (2 * edge**2 - radius**2) / (2 * tip_mm), dragged / (np.pi * tip_mm))
