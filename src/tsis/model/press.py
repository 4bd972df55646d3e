"""What a press does to the probe's face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.model.check import require_array
from tsis.model.errors import InputError
from tsis.model.grid import require_ascending

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

MN_PER_N = 1000.0  # mechanics count in mm, kPa and so in mN
CELL_SAMPLES = 6  # points along each side of a grid cell over which a pressure is averaged


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
            object.__setattr__(self, name, require_array(name, getattr(self, name), ndim=1))

    def on_grid(self, x_mm: ArrayLike, y_mm: ArrayLike) -> PressMap:
        """The same press over a rectangular grid, each coordinate ascending."""
        x, y = require_ascending("x_mm", x_mm), require_ascending("y_mm", y_mm)
        edge = self.radius_mm[-1]

        def at(values: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
            radius = np.hypot(x[None, :], y[:, None])
            inside = radius <= edge * (1 + 1e-12)  # the last point of a spacing may miss the edge by rounding
            return np.where(inside, np.interp(radius, self.radius_mm, values), 0.0)

        fine_x, fine_y = _inside_cells(x), _inside_cells(y)
        pressure = at(self.pressure_kpa, fine_x, fine_y).reshape(len(y), CELL_SAMPLES, len(x), CELL_SAMPLES)
        return PressMap(
            x_mm=x,
            y_mm=y,
            face_displacement_mm=at(self.face_displacement_mm, x, y),
            pressure_kpa=pressure.mean(axis=(1, 3)),
            approach_mm=self.approach_mm,
            force_n=self.force_n,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressMap:
    """Displacement of the face and contact pressure over a rectangular grid, of a press that need not be round.

    Attributes
    ----------
    x_mm, y_mm
        Coordinates from the probe's axis, shapes (n,) and (m,), ascending; y grows with the rows of an image.
    face_displacement_mm
        Displacement of the face relative to the glass, shape (m, n); positive where the probe is compressed, zero
        outside the face.
    pressure_kpa
        Contact pressure, shape (m, n); compression is positive. Means over the grid's cells, of which those outside the
        face hold none, so that the sum over an even grid that covers the face is the force.
    approach_mm
        Travel of the glass towards the chest wall since first contact.
    force_n
        Total force in newtons.

    Raises
    ------
    InputError
        When a coordinate does not ascend, a value is not finite or a shape is not that of the grid.

    Examples
    --------
    >>> press = PressMap(
    ...     x_mm=[-1.0, 0.0, 1.0], y_mm=[0.0, 1.0], face_displacement_mm=np.zeros((2, 3)),
    ...     pressure_kpa=np.ones((2, 3)), approach_mm=0.5, force_n=0.006,
    ... )
    >>> press.pressure_kpa.shape
    (2, 3)
    """

    x_mm: NDArray[np.float64]
    y_mm: NDArray[np.float64]
    face_displacement_mm: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]
    approach_mm: float
    force_n: float

    def __post_init__(self) -> None:
        for name in ("x_mm", "y_mm"):
            object.__setattr__(self, name, require_ascending(name, getattr(self, name)))
        shape = (len(self.y_mm), len(self.x_mm))
        for name in ("face_displacement_mm", "pressure_kpa"):
            values = require_array(name, getattr(self, name), ndim=2)
            if values.shape != shape:
                raise InputError(f"{name} must have the shape {shape} of y_mm and x_mm; got {values.shape}")
            object.__setattr__(self, name, values)


def _inside_cells(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points spread over the cells around ``centres``, `CELL_SAMPLES` each, flat."""
    middles = (centres[1:] + centres[:-1]) / 2
    ends = np.concatenate([[2 * centres[0] - middles[0]], middles, [2 * centres[-1] - middles[-1]]])
    share = (np.arange(CELL_SAMPLES) + 0.5) / CELL_SAMPLES
    return np.asarray((ends[:-1, None] + np.diff(ends)[:, None] * share).ravel())
