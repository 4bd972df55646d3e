"""The pressed face on the tracer's grid, and dents in closed form."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.model.press import MN_PER_N, PressField, PressMap

if TYPE_CHECKING:
    from tsis.optics._inputs import Floats


CELLS = 120  # of the grid along the face's radius
MARGIN = 3  # of its points beyond the wall


def face_grid(radius_mm: float) -> tuple[Floats, Floats]:
    """Coordinates along one side of the tracer's grid, mm, and distances from the axis, limited to the wall's."""
    side: Floats = radius_mm / CELLS * np.arange(-CELLS - MARGIN, CELLS + MARGIN + 1.0)
    return side, np.minimum(np.hypot(side, side[:, None]), radius_mm)


def on_face(pressed: PressField | PressMap, side: Floats, from_axis: Floats) -> tuple[Floats, Floats]:
    """Displacement and pressure at the tracer's grid, constant beyond the face's edge."""
    if isinstance(pressed, PressField):
        # Mirrored through the axis, so that the face is smooth there.
        radius, values = pressed.radius_mm, pressed.face_displacement_mm
        spline = scipy.interpolate.CubicSpline(
            np.concatenate([-radius[:0:-1], radius]), np.concatenate([values[:0:-1], values])
        )
        at = np.minimum(from_axis, radius[-1])
        return np.asarray(spline(at)), np.interp(at, radius, pressed.pressure_kpa)
    outside = np.hypot(pressed.x_mm, pressed.y_mm[:, None]) > from_axis.max()
    nearest = scipy.ndimage.distance_transform_edt(outside, return_distances=False, return_indices=True)

    def at_grid(values: Floats, order: int) -> Floats:
        along_y, along_x = (min(order, count - 1) for count in values.shape)
        spline = scipy.interpolate.RectBivariateSpline(
            pressed.y_mm, pressed.x_mm, values[tuple(nearest)], kx=along_y, ky=along_x, s=0
        )
        y, x = (np.clip(side, ends[0], ends[-1]) for ends in (pressed.y_mm, pressed.x_mm))
        return np.asarray(spline(y, x))

    return at_grid(pressed.face_displacement_mm, 3), at_grid(pressed.pressure_kpa, 1)


def slopes(displacement_mm: Floats, side: Floats) -> tuple[Floats, Floats]:
    """Derivatives of a displacement by x and y on an even square grid."""
    step = float(side[1] - side[0])
    return np.gradient(displacement_mm, step, axis=1), np.gradient(displacement_mm, step, axis=0)


def evenly_raised_face(radius_mm: float, displacement_mm: float) -> PressField:
    """An evenly displaced face without contact."""
    radius = np.linspace(0.0, radius_mm, 9)
    return PressField(
        radius_mm=radius,
        face_displacement_mm=np.full(9, displacement_mm),
        pressure_kpa=np.zeros(9),
        approach_mm=displacement_mm,
        force_n=0.0,
    )


def evenly_pressed_face(radius_mm: float, pressure_kpa: float) -> PressField:
    """A level face under an even pressure."""
    force_n = pressure_kpa * np.pi * radius_mm**2 / MN_PER_N
    return replace(evenly_raised_face(radius_mm, 0.0), pressure_kpa=np.full(9, pressure_kpa), force_n=force_n)


def hertz_dent(
    radius_mm: float,
    *,
    tip_radius_mm: float,
    depth_mm: float,
    peak_pressure_kpa: float,
    offset_mm: tuple[float, float] = (0.0, 0.0),
) -> PressMap:
    """The dent of a sphere in a half-space (Hertz), over a face of ``radius_mm``, with a peak pressure."""
    side, _ = face_grid(radius_mm)
    radius = np.hypot(side - offset_mm[0], side[:, None] - offset_mm[1])
    contact = np.sqrt(tip_radius_mm * depth_mm)
    out = np.maximum(radius, contact)
    level = np.sqrt(np.maximum(out**2 - contact**2, 0.0))  # rounding may make it negative at the edge
    beyond = (2 * contact**2 - out**2) * np.arcsin(contact / out) + contact * level
    inside = depth_mm - radius**2 / (2 * tip_radius_mm)
    return PressMap(
        x_mm=side,
        y_mm=side,
        face_displacement_mm=np.where(radius < contact, inside, beyond / (np.pi * tip_radius_mm)),
        pressure_kpa=peak_pressure_kpa * np.sqrt(np.maximum(1 - (radius / contact) ** 2, 0.0)),
        approach_mm=depth_mm,
        force_n=2 / 3 * peak_pressure_kpa * np.pi * contact**2 / MN_PER_N,
    )


def tip_press(radius_mm: Floats, displacement_mm: Floats, *, contact_radius_mm: float, force_n: float) -> PressField:
    """A sphere pressed on the middle of a face: a given displacement with the pressure of Hertz."""
    peak_kpa = 1.5 * force_n * MN_PER_N / (np.pi * contact_radius_mm**2)
    inside = np.maximum(1 - (radius_mm / contact_radius_mm) ** 2, 0.0)
    return PressField(
        radius_mm=radius_mm,
        face_displacement_mm=displacement_mm,
        pressure_kpa=peak_kpa * np.sqrt(inside),
        approach_mm=float(displacement_mm[0]),
        force_n=force_n,
    )
