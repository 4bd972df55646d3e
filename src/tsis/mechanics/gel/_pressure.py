"""Pressure on a gel from the depth of its face: an active set with the layer's Green's function by FFT."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.errors import InputError, MechanicsError
from tsis.model import require_array

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.gel._contact import Floats, GelGrid

TOLERANCE = 1e-3  # of the depth inside the contact, relative to the deepest point
MOST_STEPS = 600
MN_PER_N = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GelPressure:
    """Pressure over the pixels.

    Attributes
    ----------
    pressure_kpa
        Never negative, zero outside the contact.
    force_n
        Its sum over the pixels.
    residual_mm
        Largest difference of the depth inside the contact from the prescribed one.
    steps
        Steps of conjugate gradients.
    """

    pressure_kpa: Floats
    force_n: float
    residual_mm: float
    steps: int


def pressure_from_depth(
    depth_mm: Floats, grid: GelGrid, *, contact: NDArray[np.bool_], tolerance: float = TOLERANCE
) -> GelPressure:
    """Pressure that pushes the gel's face to a depth inside a contact and touches nothing outside it.

    Inside the contact the pressure is positive where the face lies at the prescribed depth, and zero where the gel lies
    deeper than prescribed by the pressure around it. The result is that of a rigid frictionless body of this shape.

    Parameters
    ----------
    depth_mm
        Depth of the face below the untouched face, mm, over the pixels of the grid.
    grid
        The gel.
    contact
        Pixels that may touch the object; a few pixels too many do no harm.
    tolerance
        Largest difference of the depth in the contact, relative to the deepest point.

    Raises
    ------
    InputError
        When the shapes differ, or no pixel of the contact is deeper than the untouched face.
    MechanicsError
        When the iteration does not converge.

    Notes
    -----
    Conjugate gradients with an active set after Polonsky and Keer, Wear 231 (1999) 206, for a given displacement;
    directions are smoothed by the inverse of the Green's function.
    """
    depth_mm = require_array("depth_mm", depth_mm, ndim=2)  # finite numbers
    if depth_mm.shape != grid.shape or contact.shape != grid.shape:
        raise InputError(f"depth and contact must have the grid's shape {grid.shape}; got {depth_mm.shape}")
    target = np.where(contact, depth_mm, 0.0)
    deepest = float(target.max(initial=0.0))
    if deepest <= 0:
        raise InputError("no pixel of the contact is pressed in: give the depth as positive millimetres into the gel")
    stiffness = 1.0 / grid.compliance.normal
    pressure = np.maximum(np.where(contact, grid.back(stiffness * grid.spectrum(target)), 0.0), 0.0)
    direction, former, restart = np.zeros_like(pressure), 1.0, True
    for step in range(MOST_STEPS):
        gap = np.where(contact, grid.depth_mm(pressure) - target, 0.0)  # negative: not yet deep enough
        touching = contact & (pressure > 0)
        active = touching | (contact & (gap < 0))
        error = float(np.abs(gap, where=active, out=np.zeros_like(gap)).max())
        if error <= tolerance * deepest:
            return _result(pressure, grid, error, step)
        gap *= active
        smooth = np.where(active, grid.back(stiffness * grid.spectrum(gap)), 0.0)
        now = float((gap * smooth).sum())
        direction = smooth + (0.0 if restart else now / former) * direction
        direction *= active
        former = now
        curvature = float((direction * grid.depth_mm(direction)).sum())
        length = float((gap * direction).sum()) / curvature
        moved = pressure - length * direction
        restart = bool((moved < 0).any())
        pressure = np.maximum(moved, 0.0)
    raise MechanicsError(
        f"the pressure did not converge in {MOST_STEPS} steps ({error:.2g} mm left): smooth the depth map, or give the "
        "contact"
    )


def _result(pressure: Floats, grid: GelGrid, error: float, steps: int) -> GelPressure:
    pixel_mm2 = grid.mm_per_pixel[0] * grid.mm_per_pixel[1]
    pressure.setflags(write=False)
    return GelPressure(
        pressure_kpa=pressure, force_n=float(pressure.sum()) * pixel_mm2 / MN_PER_N, residual_mm=error, steps=steps
    )
