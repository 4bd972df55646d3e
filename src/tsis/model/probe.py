"""The sensing probe: a stack of soft transparent layers bonded to glass."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.model import check
from tsis.model.errors import InputError


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
        check.number("thickness_mm", self.thickness_mm, 0.01, 200.0, hint="millimetres")
        check.number("young_kpa", self.young_kpa, 0.1, 1e6, hint="kilopascals")
        check.number("poisson", self.poisson, 0.0, 0.495)
        check.number("refractive_index", self.refractive_index, 1.0, 4.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Probe:
    """A flat, round probe: layers from the tissue up, the last one bonded to rigid glass, sides free.

    Parameters
    ----------
    radius_mm
        Radius of the face in mm, in [1, 100].
    layers
        The layers, listed from the tissue up.
    name
        What reports call it.
    assumed
        Names of the values that were assumed and not measured, e.g. ``("layers.young_kpa",)``.

    Raises
    ------
    InputError
        When the radius lies outside its range or there is no layer.

    Examples
    --------
    >>> probe = Probe(radius_mm=12.0, layers=(Layer(thickness_mm=10.0, young_kpa=50.0),))
    >>> probe.thickness_mm
    10.0
    """

    radius_mm: float
    layers: tuple[Layer, ...]
    name: str = ""
    assumed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check.number("radius_mm", self.radius_mm, 1.0, 100.0, hint="millimetres")
        layers = tuple(self.layers) if isinstance(self.layers, (tuple, list)) else ()
        if not layers or not all(isinstance(layer, Layer) for layer in layers):
            raise InputError(f"layers must be a tuple of at least one Layer; got {self.layers!r}")
        object.__setattr__(self, "layers", layers)
        object.__setattr__(self, "assumed", tuple(self.assumed))

    @property
    def thickness_mm(self) -> float:
        """Thickness of the whole stack in mm."""
        return sum(layer.thickness_mm for layer in self.layers)
