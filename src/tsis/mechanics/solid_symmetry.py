"""The vertical planes through the probe's axis that mirror a phantom: they halve or quarter what must be solved."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model import Inclusion

ROUNDING_MM = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Symmetry:
    """A frame turned about the probe's axis in which the phantom mirrors itself.

    Attributes
    ----------
    angle
        Angle of the frame's x axis from the phantom's, radians.
    mirrors
        Which of the frame's coordinates a mirror changes: ``""``, ``"y"`` (half model) or ``"xy"`` (quarter).
    """

    angle: float
    mirrors: str

    @property
    def copies(self) -> int:
        """How many of the modelled parts make the whole: 1, 2 or 4."""
        return int(2 ** len(self.mirrors))

    def turned(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """Points of the phantom in the turned frame."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return cosine * x_mm + sine * y_mm, cosine * y_mm - sine * x_mm

    def folded(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
        """The points of the modelled part at which the same happens."""
        x, y = self.turned(x_mm, y_mm)
        return np.abs(x) if "x" in self.mirrors else x, np.abs(y) if "y" in self.mirrors else y


def symmetry_of(inclusions: tuple[Inclusion, ...]) -> Symmetry:
    """The smallest part that stands for the whole.

    Ellipsoids lie along the phantom's axes, so only those with equal horizontal semi-axes let the frame turn freely.
    """
    free = all(_is_round(one) for one in inclusions)
    away = [one for one in inclusions if np.hypot(*one.offset_mm) > ROUNDING_MM]
    angles = [0.0, np.pi / 2]
    if free and away:
        x, y = away[0].offset_mm
        angles = [float(np.arctan2(y, x))]
    for angle in angles:
        turned = Symmetry(angle=angle, mirrors="")
        places = np.array([turned.turned(*np.array(one.offset_mm)) for one in inclusions]).reshape(-1, 2)
        if np.abs(places[:, 1:]).max(initial=0.0) <= ROUNDING_MM:
            on_axis = np.abs(places).max(initial=0.0) <= ROUNDING_MM
            return Symmetry(angle=angle, mirrors="xy" if on_axis else "y")
    return Symmetry(angle=0.0, mirrors="")


def _is_round(inclusion: Inclusion) -> bool:
    x, y, _ = inclusion.half_axes_mm
    return x == y
