"""Inclusions beside the probe's axis and tilted probes: what they change in a press that is round.

No solver here presses a dome in three dimensions at finite strain, so a misplaced press is the round one and a kernel
that the estimate does not contain. A sphere changes the press as a field of modulus in its place would, by Fourier
elements in tissue without it, up to a factor that the round press tells. What this leaves of the round change moves
with the sphere and stays at the rim. The factor stands for the strain inside a stiff sphere, which for nearly
incompressible tissue is a multiple of that outside. A tilt adds the rotation of the face, to first order; pressures
that become negative are 0, as where the face lifts off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.tissue_field import FieldResponse, TissueFieldResponse
    from tsis.model.phantom import Inclusion
    from tsis.model.press import PressField

LEAST_RADIUS_MM = 2.0  # of a sphere that the integration points resolve; a smaller one acts as one of this size


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereField:
    """A field that is 1 inside a sphere beside the axis, and 0 elsewhere.

    Attributes
    ----------
    radius_mm, depth_mm
        Of the sphere, and of its centre.
    offset_mm, angle
        Distance of its centre from the axis, and its direction.
    """

    radius_mm: float
    depth_mm: float
    offset_mm: float
    angle: float

    @classmethod
    def of(cls, inclusion: Inclusion, offset_mm: float, angle: float) -> SphereField:
        """An inclusion, moved from the axis."""
        radius = inclusion.diameter_mm / 2
        return cls(
            radius_mm=max(radius, LEAST_RADIUS_MM),
            depth_mm=inclusion.depth_mm + radius,
            offset_mm=offset_mm,
            angle=angle,
        )

    def harmonic(
        self, order: int, radius_mm: NDArray[np.float64], depth_mm: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Parts of cos and sin of ``order`` times the angle around the axis, shape (2, points)."""
        chord = self.radius_mm**2 - (depth_mm - self.depth_mm) ** 2
        away = radius_mm**2 + self.offset_mm**2 - chord
        half = np.arccos(np.clip(away / np.maximum(2 * radius_mm * self.offset_mm, 1e-9), -1.0, 1.0))
        size = half / np.pi if order == 0 else 2 * np.sin(order * half) / (order * np.pi)
        return np.asarray(np.array([[np.cos(order * self.angle)], [np.sin(order * self.angle)]]) * size)


def field_change(
    slab: TissueFieldResponse,
    order: int,
    response: FieldResponse,
    parts: NDArray[np.float64],
    grid: tuple[NDArray[np.float64], ...],
) -> NDArray[np.float64]:
    """Change over a grid (radius, angle) by harmonic ``order`` of a field with the given parts (2, points).

    The shape is (2, 2, *grid): pressure and displacement, by the unit press per newton and by the dome's shape.
    """
    radius, angle = grid
    change = np.zeros((2, 2, *radius.shape))
    for total, profiles in zip(change, (response.pressure_kpa, response.face_displacement_mm), strict=True):
        for press, profile in enumerate(profiles):
            for part, wave in zip(parts, (np.cos, np.sin), strict=True):
                total[press] += np.interp(radius, slab.radius_mm, profile @ part) * wave(order * angle)
    return np.asarray(change * (radius <= slab.radius_mm[-1]))


def moved_change(
    exact: tuple[PressField, PressField],
    kernels: tuple[NDArray[np.float64], NDArray[np.float64]],
    place: tuple[float, float],
    grid: tuple[NDArray[np.float64], ...],
) -> NDArray[np.float64]:
    """What moving an inclusion to ``place`` (offset, angle) changes: pressure and displacement, (2, *grid).

    ``exact`` are the round presses with the inclusion and without it, ``kernels`` the changes (2, *grid) by a field in
    the inclusion's place on the axis and beside it.
    """
    radius, angle = grid
    beside, on_axis = exact
    edge = float(beside.radius_mm[-1])
    inside = radius <= edge
    names = ("pressure_kpa", "face_displacement_mm")
    profiles = [getattr(beside, name) - getattr(on_axis, name) for name in names]
    round_change = np.array([np.interp(radius, beside.radius_mm, profile) for profile in profiles]) * inside
    middle, aside = kernels
    factor = float((round_change[1] * middle[1]).sum() / (middle[1] ** 2).sum())
    # The rest is smooth except at the rim, from where it does not move.
    ring = np.arange(0.0, edge, 0.25)
    line = [np.interp(ring, beside.radius_mm, profile) for profile in profiles]
    row = len(radius) // 2  # of the grid, through the axis
    order = np.argsort(radius[row], kind="stable")
    rest = [
        values - factor * np.interp(ring, radius[row][order], kernel[row][order])
        for values, kernel in zip(line, middle, strict=True)
    ]
    offset, direction = place
    stay = np.clip(1 - (radius / edge) ** 2, 0.0, 1.0) * offset
    away = np.hypot(radius * np.cos(angle - direction) - stay, radius * np.sin(angle - direction))
    moved = np.array([np.interp(away, ring, values) for values in rest]) * inside
    return np.asarray(factor * aside + moved - round_change)


def tilt_change(
    slab: TissueFieldResponse, tilt_deg: float, direction: float, grid: tuple[NDArray[np.float64], ...]
) -> NDArray[np.float64]:
    """Change of pressure and displacement (2, *grid) by a rotation of the probe, whatever the force."""
    radius, angle = grid
    profiles = np.array([np.interp(radius, slab.radius_mm, profile) for profile in slab.tilt()])
    face = (radius > 0) & (radius <= slab.radius_mm[-1])  # the mean around the axis is not exactly the 0 there
    return np.asarray(np.deg2rad(tilt_deg) * profiles * np.cos(angle - direction) * face)
