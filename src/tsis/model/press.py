"""What a press does to the probe's face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model import check

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressField:
    """Displacement of the face and contact pressure, both over the face radius, of an axisymmetric press.

    Attributes
    ----------
    radius_mm
        Radii on the face, shape (n,), ascending from 0 to the probe's radius.
    face_displacement_mm
        Displacement of the face relative to the glass, shape (n,); positive where the probe is compressed.
    pressure_kpa
        Contact pressure, shape (n,); compression is positive. Means around each radius, so that the integral over the
        face is the force; the last value stands for the singular edge.
    approach_mm
        Travel of the glass towards the chest wall since first contact.
    force_n
        Total force in newtons.
    """

    radius_mm: NDArray[np.float64]
    face_displacement_mm: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]
    approach_mm: float
    force_n: float

    def __post_init__(self) -> None:
        for name in ("radius_mm", "face_displacement_mm", "pressure_kpa"):
            object.__setattr__(self, name, check.array(name, getattr(self, name), ndim=1))
