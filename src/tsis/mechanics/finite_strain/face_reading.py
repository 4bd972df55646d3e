"""What a deformed mesh says about the face of the probe: displacement and pressure over the material radius."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.polynomial import legendre

from tsis.mechanics.element import gauss_points, lagrange
from tsis.mechanics.face import hat_areas

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.finite_strain.obstacle import SoftFace
    from tsis.mechanics.finite_strain.rounded_probe import RoundedProbe
    from tsis.mechanics.finite_strain.sliding_contact import SlidingContact

PARTS = 24  # of every closed part of an element edge, between which the force is summed up
PRESSURE_DEGREES_LESS = 2  # than the displacement has: what of the pressure on an edge is not ripple


def face_displacement_mm(
    shape: RoundedProbe,
    face: SoftFace,
    displacements: NDArray[np.float64],
    radius_mm: NDArray[np.float64],
    *,
    glass_mm: float,
) -> NDArray[np.float64]:
    """Displacement of the face towards the glass at ``radius_mm``, mm; ``glass_mm`` is how far the glass moved.

    Radii on the rounded rim are material points of it: nothing is extrapolated.
    """
    weights = face.face.weights(shape.arc_at(radius_mm))[:, 1]
    return np.asarray(glass_mm - weights @ displacements[face.nodes, 1])


def face_pressure_kpa(
    shape: RoundedProbe,
    contact: SlidingContact,
    face: SoftFace,
    positions: NDArray[np.float64],
    radius_mm: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Axial force per area of the undeformed face in kPa, as means around each of ``radius_mm``.

    The means weigh by area and by distance to the neighbours, so that their integral is the force. On each element edge
    the pressure is reduced to the polynomial that the displacements can resolve, which keeps its integral.
    """
    radius, force = _force_within(shape, contact, face, positions)

    # The mean of a hat function over the force is a difference of the integrals of "force within a radius".
    # Between two radii the pressure is taken as even, so the force goes with the square of the radius.
    def primitive(cell: NDArray[np.int64], at: NDArray[np.float64]) -> NDArray[np.float64]:
        low, high = radius[cell], radius[cell + 1]
        pressure = (force[cell + 1] - force[cell]) / np.maximum(high**2 - low**2, 1e-12)
        return np.asarray((at - low) * force[cell] + pressure * ((at**3 - low**3) / 3 - low**2 * (at - low)))

    whole = primitive(np.arange(len(radius) - 1), radius[1:])
    up_to = np.concatenate([[0.0], np.cumsum(whole)])
    inside = np.minimum(radius_mm, radius[-1])
    cell = np.clip(np.searchsorted(radius, inside, side="right") - 1, 0, len(radius) - 2)
    total = force[-1]
    reached = up_to[cell] + primitive(cell, inside) + (radius_mm - inside) * total
    means = np.diff(reached) / np.diff(radius_mm)
    ring = np.concatenate([means, [total]]) - np.concatenate([[0.0], means])
    return np.asarray(ring / hat_areas(radius_mm))


def _force_within(
    shape: RoundedProbe, contact: SlidingContact, face: SoftFace, positions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Material radii, ascending from 0, and the axial force in mN that the face takes inside each."""
    gauss, weight = gauss_points(4)
    radii, forces = [np.zeros(1)], [np.zeros(1)]
    for part in contact.pressed(positions):
        ends = np.linspace(part.low, part.high, PARTS + 1)
        half = np.diff(ends) / 2
        place = ((ends[:-1] + half)[:, None] + half[:, None] * gauss).ravel()
        share = (half[:, None] * weight).ravel() * contact.area(np.full(len(place), part.edge), place)
        values, _ = lagrange(contact.gauss, place)
        pressure = (values @ part.pressure_kpa) * (values @ part.axial)
        middle = 2 * (place - part.low) / (part.high - part.low) - 1
        basis = legendre.legvander(middle, contact.order - PRESSURE_DEGREES_LESS)
        smooth = basis @ np.linalg.solve(basis.T @ (share[:, None] * basis), basis.T @ (share * pressure))
        pieces = (share * smooth).reshape(PARTS, -1).sum(axis=1)
        points = contact.points(np.full(PARTS, part.edge), ends[1:], positions)
        foot = face.face.closest(positions[face.nodes], points)
        radii.append(shape.radius_at(foot.place))
        forces.append(forces[-1][-1] + np.cumsum(pieces))
    radius, force = np.concatenate(radii), np.concatenate(forces)
    return np.maximum.accumulate(np.clip(radius, 0.0, shape.radius_mm)), force
