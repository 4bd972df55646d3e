"""Results of a press over the face radius or a grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy

from tsis.errors import InputError
from tsis.model.content import ContentValue
from tsis.model.require import require_array

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


def require_ascending(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Check the coordinates of a grid: at least two ascending numbers."""
    result: NDArray[np.float64] = require_array(name, values, ndim=1)
    if len(result) < 2 or (np.diff(result) <= 0).any():
        raise InputError(f"{name} must hold at least two ascending numbers; got {values!r:.80}")
    return result


def require_on_grid(value: Any, *names: str) -> tuple[int, int]:
    """Check and freeze the ascending ``x_mm``, ``y_mm`` of a frozen value and its named arrays over them; the shape."""
    for axis in ("x_mm", "y_mm"):
        object.__setattr__(value, axis, require_ascending(axis, getattr(value, axis)))
    shape = (len(value.y_mm), len(value.x_mm))
    for name in names:
        array = require_array(name, getattr(value, name), ndim=2)
        if array.shape != shape:
            raise InputError(f"{name} must have the shape {shape} of y_mm and x_mm; got {array.shape}")
        object.__setattr__(value, name, array)
    return shape


def interpolation_matrix(
    knots: NDArray[np.float64], at: ArrayLike, *, outside: Literal["edge", "zero"] = "edge"
) -> scipy.sparse.csr_array[Any, tuple[int, int]]:
    """Sparse matrix of linear interpolation from ascending ``knots`` to ``at``, shape (len(at), len(knots)).

    Beyond the knots the value is that of the edge, or zero. Each row has two entries, so the time to resample a map is
    proportional to the points of the new grid.

    Examples
    --------
    >>> interpolation_matrix(np.array([0.0, 2.0]), [-1.0, 0.5, 2.0]).toarray().tolist()
    [[1.0, 0.0], [0.75, 0.25], [0.0, 1.0]]
    >>> interpolation_matrix(np.array([0.0, 2.0]), [-1.0], outside="zero").toarray().tolist()
    [[0.0, 0.0]]
    """
    positions = np.asarray(at, dtype=float)
    left = np.clip(np.searchsorted(knots, positions, side="right") - 1, 0, len(knots) - 2)
    part = np.clip((positions - knots[left]) / (knots[left + 1] - knots[left]), 0.0, 1.0)
    weights = np.column_stack([1 - part, part])
    if outside == "zero":
        weights[(positions < knots[0]) | (positions > knots[-1])] = 0.0
    columns = np.column_stack([left, left + 1])
    rows = np.arange(0, 2 * len(positions) + 1, 2)
    return scipy.sparse.csr_array((weights.ravel(), columns.ravel(), rows), shape=(len(positions), len(knots)))


MN_PER_N = 1000.0  # mechanics uses mm and kPa, therefore mN
CELL_SAMPLES = 6  # points along each side of a grid cell over which a pressure is averaged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PressField(ContentValue):
    """Displacement of the face and contact pressure, both over the face radius, of an axisymmetric press.

    Attributes
    ----------
    radius_mm
        Radii on the face, shape (n,), ascending from 0 to the probe's radius.
    face_displacement_mm
        Displacement of the face relative to the glass, shape (n,); positive where the probe is compressed.
    pressure_kpa
        Contact pressure, shape (n,); compression is positive. Means around each radius, so the integral over the face
        is the force; the last value represents the singular edge.
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
            inside = radius <= edge * (1 + 1e-12)  # rounding may put the last point beyond the edge
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
class PressMap(ContentValue):
    """Displacement of the face and contact pressure over a rectangular grid, for any press.

    Attributes
    ----------
    x_mm, y_mm
        Coordinates from the probe's axis, shapes (n,) and (m,), ascending; y grows with the rows of an image.
    face_displacement_mm
        Displacement of the face relative to the glass, shape (m, n); positive where the probe is compressed, zero
        outside the face.
    pressure_kpa
        Contact pressure, shape (m, n); compression is positive. Means over the cells of the grid, zero outside the
        face, so the sum over a uniform grid that covers the face is the force.
    approach_mm
        Travel of the glass towards the chest wall since first contact.
    force_n
        Total force in newtons.

    Raises
    ------
    InputError
        When a coordinate does not ascend, a value is not finite, or a shape does not fit the grid.

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
        require_on_grid(self, "face_displacement_mm", "pressure_kpa")


def _inside_cells(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """`CELL_SAMPLES` points in each cell around ``centres``, flat."""
    middles = (centres[1:] + centres[:-1]) / 2
    ends = np.concatenate([[2 * centres[0] - middles[0]], middles, [2 * centres[-1] - middles[-1]]])
    fraction = (np.arange(CELL_SAMPLES) + 0.5) / CELL_SAMPLES
    return np.asarray((ends[:-1, None] + np.diff(ends)[:, None] * fraction).ravel())
