"""The probe: its layers, the glass plate above them, and the lamps around its side."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tsis.errors import InputError
from tsis.model.exchange import summary_html
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Glass:
    """The plate between the layers and the camera, bonded to the layers.

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
    """A lamp whose round emitting face touches the probe's side wall from outside.

    Its intensity falls with the angle from its axis as ``cos(angle)^m``, one half at ``half_angle_deg``, with no light
    backwards.

    Parameters
    ----------
    azimuth_deg
        Position around the probe in degrees from x towards y.
    height_mm
        Height of its centre above the plane of the face's apex, towards the glass, in mm; None is the middle of the
        layers.
    aim_deg
        Angle of its axis above the plane of the face, positive towards the glass, in (-80, 80); it points at the
        probe's axis.
    half_angle_deg
        Angle from its axis at which the intensity is half of the maximum, in [1, 85]. The viewing angle of a data sheet
        is twice this: 15 for a lamp of 30 degrees.
    diameter_mm
        Diameter of the emitting face in mm, in [0.01, 20].
    power
        Power relative to the other lamps, in [0, 1000].

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
        """The exponent ``m`` of the cosine."""
        return float(np.log(0.5) / np.log(np.cos(np.radians(self.half_angle_deg))))


CROWN_GLASS = Glass()
FOUR_LEDS = tuple(Led(azimuth_deg=azimuth) for azimuth in (0.0, 90.0, 180.0, 270.0))


THINNEST_RIM = 0.1  # thickness at the rim over that on the axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """A homogeneous, isotropic, transparent layer of the probe.

    Parameters
    ----------
    thickness_mm
        Thickness in mm, in [0.01, 200].
    young_kpa
        Young's modulus in kPa, in [0.1, 1e6].
    poisson
        Poisson's ratio, in [0, 0.495]; above it the displacement elements would lock.
    refractive_index
        Real refractive index, in [1, 4]; 1.41 is that of common PDMS.

    Raises
    ------
    InputError
        When a value lies outside its range.
    """

    thickness_mm: float
    young_kpa: float
    poisson: float = 0.49
    refractive_index: float = 1.41

    def __post_init__(self) -> None:
        require_number("thickness_mm", self.thickness_mm, 0.01, 200.0, hint="millimetres")
        require_number("young_kpa", self.young_kpa, 0.1, 1e6, hint="kilopascals")
        require_number("poisson", self.poisson, 0.0, 0.495)
        require_number("refractive_index", self.refractive_index, 1.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe:
    """A round probe: layers from the tissue up, the last one bonded to rigid glass.

    Parameters
    ----------
    radius_mm
        Radius of the face in mm, in [1, 100].
    layers
        The layers, listed from the tissue up, each with its thickness on the axis.
    face_curvature_mm
        Radius of curvature of a domed face in mm, at least ``radius_mm``; None for a flat face. The glass is flat; each
        layer has the same fraction of the thickness at every radius.
    sides
        ``"free"``, or ``"bonded"`` to a rigid housing.
    glass
        The plate above the layers.
    leds
        The lamps around the side wall, at least one of them lit; by default four at equal angles.
    name
        Name in reports.
    assumed
        Names of the values that were assumed, not measured, e.g. ``("layers.young_kpa",)``.

    Raises
    ------
    InputError
        When a value lies outside its range, there is no layer or no lit lamp, a lamp lies outside layers and glass, or
        a dome makes the layers too thin at the rim.

    Examples
    --------
    >>> probe = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=10.0, young_kpa=50.0),))
    >>> probe.thickness_mm
    10.0
    """

    radius_mm: float
    layers: tuple[Layer, ...]
    face_curvature_mm: float | None = None
    sides: Literal["free", "bonded"] = "free"
    glass: Glass = CROWN_GLASS
    leds: tuple[Led, ...] = FOUR_LEDS
    name: str = ""
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        require_number("radius_mm", self.radius_mm, 1.0, 100.0, hint="millimetres")
        layers = tuple(self.layers) if isinstance(self.layers, (tuple, list)) else ()
        if not layers or not all(isinstance(layer, Layer) for layer in layers):
            raise InputError(f"layers must be a tuple of at least one Layer; got {self.layers!r}")
        object.__setattr__(self, "layers", layers)
        object.__setattr__(self, "assumed", tuple(self.assumed))
        if self.sides not in ("free", "bonded"):
            raise InputError(f"sides must be 'free' or 'bonded'; got {self.sides!r}")
        self._check_light()
        if self.face_curvature_mm is None:
            return
        require_number(
            "face_curvature_mm", self.face_curvature_mm, self.radius_mm, 1e6, hint="millimetres, None is flat"
        )
        sag = float(self.sag_mm(self.radius_mm))
        if sag > (1 - THINNEST_RIM) * self.thickness_mm:
            raise InputError(
                f"face_curvature_mm must leave {THINNEST_RIM:.0%} of the layers' {self.thickness_mm:g} mm at the rim; "
                f"got {self.face_curvature_mm:g}, which takes {sag:.2f} mm away"
            )

    def _check_light(self) -> None:
        require_type("glass", self.glass, Glass)
        leds = tuple(self.leds) if isinstance(self.leds, (tuple, list)) else ()
        if not all(isinstance(led, Led) for led in leds) or not any(led.power > 0 for led in leds):
            raise InputError(f"leds must be a tuple of Led, at least one with power above 0; got {self.leds!r:.80}")
        object.__setattr__(self, "leds", leds)
        top = self.thickness_mm + self.glass.thickness_mm
        for led in leds:
            require_number("height_mm of a lamp", self.led_height_mm(led), 0.0, top, hint="layers and glass end there")

    def led_height_mm(self, led: Led) -> float:
        """Height of a lamp's centre above the face, mm."""
        return self.thickness_mm / 2 if led.height_mm is None else led.height_mm

    def unlit(self) -> Probe:
        """The probe with default lamps and glass, which do not affect mechanics."""
        return replace(self, glass=CROWN_GLASS, leds=FOUR_LEDS)

    @property
    def thickness_mm(self) -> float:
        """Thickness of the whole stack on the axis, mm."""
        return sum(layer.thickness_mm for layer in self.layers)

    def sag_mm(self, radius_mm: Any) -> NDArray[np.float64]:
        """Distance of the undeformed face behind its apex at ``radius_mm``, mm; zeros for a flat face."""
        radius = np.asarray(radius_mm, dtype=float)
        if self.face_curvature_mm is None:
            return np.zeros_like(radius)
        curvature = self.face_curvature_mm
        # This form avoids the cancellation of two large numbers on nearly flat faces.
        return np.asarray(radius**2 / (curvature + np.sqrt(curvature**2 - radius**2)))

    def _repr_html_(self) -> str:
        """The layers from the tissue up, with face, glass and lamps."""
        face = "flat" if self.face_curvature_mm is None else f"domed, radius of curvature {self.face_curvature_mm:g} mm"
        layers = [
            (f"layer {number}", f"{layer.thickness_mm:g} mm, {layer.young_kpa:g} kPa, index {layer.refractive_index:g}")
            for number, layer in enumerate(self.layers, start=1)
        ]
        rows = [
            ("radius", f"{self.radius_mm:g} mm"),
            ("face", face),
            *layers,
            ("glass", f"{self.glass.thickness_mm:g} mm, index {self.glass.refractive_index:g}"),
            ("lamps", str(len(self.leds))),
            ("assumed", ", ".join(self.assumed) or "nothing"),
        ]
        return summary_html(self.name or "Probe", rows)
