"""Shape of an object that touches a gel sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from tsis.hardness._exploration import RadiusPrior
from tsis.model.require import require_number, require_one_of, require_type

SHAPES = ("sphere", "cylinder", "flat")
LARGEST_RADIUS_MM = 60.0  # of objects
RADIUS_SD = 0.01  # relative, of an object's radius that is given without one


@dataclass(frozen=True, slots=True, kw_only=True)
class ObjectGeometry:
    """Shape of the touched part of an object.

    Parameters
    ----------
    shape
        ``"sphere"``; ``"cylinder"``, lying on the face; or ``"flat"``, wider than the contact.
    radius_mm, radius_sd_mm
        Radius in [0.5, 60] mm and its standard deviation, 1 % by default; None for an unknown radius.
    length_mm
        Length of the cylinder's contact, over which its force acts.

    Raises
    ------
    InputError
        When a value is out of range, or the length of a cylinder is missing.
    """

    shape: Literal["sphere", "cylinder", "flat"] = "sphere"
    radius_mm: float | None = None
    radius_sd_mm: float | None = None
    length_mm: float | None = None

    def __post_init__(self) -> None:
        require_one_of("shape of the object", self.shape, SHAPES)
        if self.radius_mm is not None:
            require_number("radius_mm of the object", self.radius_mm, 0.5, LARGEST_RADIUS_MM, hint="millimetres")
            if self.radius_sd_mm is not None:
                require_number("radius_sd_mm of the object", self.radius_sd_mm, 0.0, self.radius_mm / 3)
        if self.shape == "cylinder":
            require_number("length_mm of a cylinder", self.length_mm, 0.5, 500.0, hint="millimetres of contact")

    def radius_prior(self) -> RadiusPrior:
        """The radius, or all radii from 1 to 60 mm."""
        if self.radius_mm is None:
            return RadiusPrior(radius_mm=None, sd_mm=0.0, largest_mm=LARGEST_RADIUS_MM)
        sd = RADIUS_SD * self.radius_mm if self.radius_sd_mm is None else self.radius_sd_mm
        return RadiusPrior(radius_mm=self.radius_mm, sd_mm=sd, largest_mm=LARGEST_RADIUS_MM)


def as_geometry(geometry: Any, stated_mm: float | None) -> ObjectGeometry:
    """The geometry of a shape, a radius in mm or fields; with the radius that the contacts state where it has none."""
    if isinstance(geometry, Mapping):
        for name in geometry:
            require_one_of("field of geometry", name, ObjectGeometry.__slots__)
        shape = ObjectGeometry(**geometry)
    elif isinstance(geometry, str):
        shape = ObjectGeometry(shape=geometry)  # type: ignore[arg-type]  # checked there
    elif isinstance(geometry, (int, float)):
        shape = ObjectGeometry(radius_mm=float(geometry))
    else:
        require_type("geometry", geometry, ObjectGeometry)
        shape = geometry
    return replace(shape, radius_mm=stated_mm) if shape.radius_mm is None else shape
