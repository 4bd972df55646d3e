"""The sensing probe: a stack of soft transparent layers bonded to glass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from tsis.model.check import require_number, require_type
from tsis.model.errors import InputError
from tsis.model.light import CROWN_GLASS, FOUR_LEDS, Glass, Led

if TYPE_CHECKING:
    from numpy.typing import NDArray

THINNEST_RIM = 0.1  # of the thickness on the axis


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """One homogeneous, isotropic, transparent layer of the probe.

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
        Radius of curvature of a domed face in mm, at least ``radius_mm``; None for a flat one. The glass is flat; the
        layers bulge together, each keeping its share of the thickness at every radius.
    sides
        ``"free"``, or ``"bonded"`` to a rigid housing.
    glass
        The plate above the layers.
    leds
        The lamps around the side wall, at least one of them lit; four at equal angles when not given.
    name
        What reports call it.
    assumed
        Names of the values that were assumed and not measured, e.g. ``("layers.young_kpa",)``.

    Raises
    ------
    InputError
        When a value lies outside its range, there is no layer or no lit lamp, a lamp stands beside
        neither layers nor glass, or a dome leaves almost nothing of the layers at the rim.

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
        """The probe as mechanics knows it: with lamps and glass of any probe, for no press depends on them."""
        return replace(self, glass=CROWN_GLASS, leds=FOUR_LEDS)

    @property
    def thickness_mm(self) -> float:
        """Thickness of the whole stack on the axis, mm."""
        return sum(layer.thickness_mm for layer in self.layers)

    def sag_mm(self, radius_mm: Any) -> NDArray[np.float64]:
        """How far the undeformed face lies behind its apex at ``radius_mm``, mm; zeros for a flat face."""
        radius = np.asarray(radius_mm, dtype=float)
        if self.face_curvature_mm is None:
            return np.zeros_like(radius)
        curvature = self.face_curvature_mm
        # Written without the difference of two large numbers, which would cost digits on nearly flat faces.
        return np.asarray(radius**2 / (curvature + np.sqrt(curvature**2 - radius**2)))
