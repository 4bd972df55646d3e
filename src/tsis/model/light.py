"""What lights a probe: the glass plate above its layers and the lamps around its side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tsis.model.check import require_number


@dataclass(frozen=True, slots=True, kw_only=True)
class Glass:
    """The plate that the layers are bonded to and through which the camera looks.

    Parameters
    ----------
    thickness_mm
        Thickness in mm, in [0.01, 50].
    refractive_index
        Real refractive index, in [1, 4]; 1.515 is that of common crown glass.

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    thickness_mm: float = 3.0
    refractive_index: float = 1.515

    def __post_init__(self) -> None:
        require_number("glass.thickness_mm", self.thickness_mm, 0.01, 50.0, hint="millimetres")
        require_number("glass.refractive_index", self.refractive_index, 1.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Led:
    """A lamp outside the probe's side wall, against which its round emitting face lies.

    Its intensity falls with the angle from its axis as ``cos(angle)^m``, where ``m`` makes it one half at
    ``half_angle_deg``; nothing leaves backwards.

    Parameters
    ----------
    azimuth_deg
        Where around the probe it stands, degrees from x towards y.
    height_mm
        Distance of its centre above the plane of the face's apex, towards the glass, in mm; None is the middle of the
        layers.
    aim_deg
        Angle of its axis above the plane of the face, positive towards the glass, in (-80, 80); it points at the
        probe's axis.
    half_angle_deg
        Angle from its axis at which the intensity is half of that on the axis, in [1, 85]. A data sheet's viewing angle
        is twice this: 15 for a lamp of 30 degrees.
    diameter_mm
        Diameter of the emitting face in mm, in [0.01, 20].
    power
        Its light relative to the other lamps, in [0, 1000].

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    azimuth_deg: float = 0.0
    height_mm: float | None = None
    aim_deg: float = 0.0
    half_angle_deg: float = 15.0
    diameter_mm: float = 3.0
    power: float = 1.0

    def __post_init__(self) -> None:
        require_number("azimuth_deg", self.azimuth_deg, -360.0, 360.0, hint="degrees")
        if self.height_mm is not None:
            require_number("height_mm", self.height_mm, 0.0, 250.0, hint="millimetres above the face")
        require_number("aim_deg", self.aim_deg, -80.0, 80.0, hint="degrees")
        require_number("half_angle_deg", self.half_angle_deg, 1.0, 85.0, hint="degrees")
        require_number("diameter_mm", self.diameter_mm, 0.01, 20.0, hint="millimetres")
        require_number("power", self.power, 0.0, 1000.0)

    @property
    def exponent(self) -> float:
        """The power of the cosine with which the intensity falls."""
        return float(np.log(0.5) / np.log(np.cos(np.radians(self.half_angle_deg))))


CROWN_GLASS = Glass()
FOUR_LEDS = tuple(Led(azimuth_deg=azimuth) for azimuth in (0.0, 90.0, 180.0, 270.0))
