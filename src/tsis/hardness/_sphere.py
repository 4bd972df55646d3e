"""A soft sphere on the probe as the camera sees it: pressure over where the deformed face lies, not where it lay."""

from __future__ import annotations

from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, MechanicsError
from tsis.mechanics.finite_strain import (
    LIGHTEST,
    TOUCH,
    WIDEST_CONTACT,
    SphereOnProbe,
    find_first_contact,
    follow_load_path,
    require_ascending_forces,
    require_enough_force,
)
from tsis.mechanics.finite_strain import SPRING as PULL
from tsis.model import MN_PER_N, PressField, Probe, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.mechanics.finite_strain import SphereResolution, State
    from tsis.model import SoftSphere


def press_fields(
    probe: Probe,
    sphere: SoftSphere,
    *,
    forces_n: Sequence[float],
    resolution: SphereResolution,
    stop_at_limit: bool = False,
) -> tuple[PressField, ...]:
    """Press a sphere between a frictionless plate and the probe, and see the face where it has moved to.

    Large forces carry the skin inwards, by up to two per cent of the contact's radius on a soft probe; the camera sees
    the carried face, so radius and pressure are those of the deformed face here.

    Parameters
    ----------
    probe
        What presses.
    sphere
        What is pressed; its radius is at most 0.6 of the face's.
    forces_n
        Ascending forces in newtons.
    resolution
        Mesh density; a press that does not converge is tried again on meshes a little finer.
    stop_at_limit
        End the path where the mechanics cannot follow, instead of an error; at least one force must be reached.

    Raises
    ------
    InputError
        When the sphere is too large for the face, or the forces do not ascend.
    MechanicsError
        When a force cannot be reached on any of four meshes.
    """
    require_type("probe", probe, Probe)
    require_small_sphere(probe, sphere.radius_mm)
    require_ascending_forces(forces_n)
    softer = min(sphere.young_kpa, probe.layers[0].young_kpa)
    require_enough_force(forces_n[0], softer, sphere.radius_mm, lightest=LIGHTEST)
    failure: MechanicsError | None = None
    with one_blas_thread():
        for mesh in (resolution, *_neighbours(resolution)):
            press = SphereOnDeformedFace(probe, sphere.radius_mm, sphere.young_kpa, sphere.poisson, mesh)
            try:
                return press.fields(forces_n, stop_at_limit=stop_at_limit)
            except MechanicsError as error:
                failure = failure or error
    assert failure is not None
    raise failure


def _neighbours(resolution: SphereResolution) -> list[SphereResolution]:
    """Meshes to try next: where the contact's edge meets a node of one mesh, Newton's method may stall on it alone."""
    cells, face_cells = resolution.cells, resolution.face_cells
    return [
        replace(resolution, cells=cells + 1),
        replace(resolution, face_cells=face_cells + 1),
        replace(resolution, cells=cells + 2, face_cells=face_cells + 1),
    ]


def require_small_sphere(probe: Probe, radius_mm: float) -> None:
    """Refuse an object larger than the probe can measure: its contact would reach the rim."""
    if radius_mm > WIDEST_CONTACT * probe.radius_mm:
        raise InputError(
            f"the object must be smaller than the probe: radius_mm must be at most "
            f"{WIDEST_CONTACT * probe.radius_mm:.3g}, "
            f"{WIDEST_CONTACT:g} of the face's radius; got {radius_mm:g} (use a wider probe)"
        )


class SphereOnDeformedFace(SphereOnProbe):
    """The sphere's mechanics, read at the places that the face has moved to."""

    def fields(self, forces_n: Sequence[float], *, stop_at_limit: bool) -> tuple[PressField, ...]:
        """Fields at ascending forces in newtons, as far as they can be reached."""
        forces, result = [force * MN_PER_N for force in forces_n], list[PressField]()
        with suppress(MechanicsError) if stop_at_limit else nullcontext():
            first = find_first_contact(
                self.potential, self._deformed, TOUCH * self._radius, PULL, below_mn=forces[0] / 2
            )
            states = follow_load_path(self.potential, first, forces, refuse=self._refuse)
            for state, force in zip(states, forces_n, strict=True):
                result.append(self._contact_view(state, force))
        if not result:
            raise MechanicsError(f"the press does not converge at {forces_n[0]:.3g} N; ask for another resolution")
        return tuple(result)

    def _contact_view(self, state: State, force_n: float) -> PressField:
        field = self.read(state, force_n).field
        weights = self.face.face.weights(self.shape.arc_at(field.radius_mm))[:, 0]
        outward = weights @ self.potential.displacements(state.unknowns)[self.face.nodes, 0]
        return to_deformed_radius(field, np.asarray(outward))


def to_deformed_radius(field: PressField, outward_mm: NDArray[np.float64]) -> PressField:
    """A field over the undeformed radius, when each point of the face has moved ``outward_mm`` along the radius."""
    radius = field.radius_mm
    transformed = np.maximum.accumulate(np.where(radius > 0, radius + outward_mm, 0.0))
    # What an undeformed ring carries, the ring that it has become carries: areas go with radius times width.
    wider = np.gradient(transformed, radius)
    around = np.divide(transformed, radius, out=np.full(len(radius), wider[0]), where=radius > 0)
    pressure = field.pressure_kpa / np.maximum(wider * around, 1e-3)
    return replace(
        field,
        pressure_kpa=np.interp(radius, transformed, pressure, right=0.0),
        face_displacement_mm=np.interp(radius, transformed, field.face_displacement_mm),
    )


def hertzian_radius_mm(field: PressField) -> float:
    """Radius in mm of the Hertzian contact whose pressure has the same second moment: ``a² = 5/2 <r²>``.

    The pressure of a Hertzian contact falls as ``sqrt(1 - r²/a²)``, whose mean square radius is ``2/5 a²``. Meshes and
    images tell this radius ten times closer than the place where the pressure ends, for all of the contact tells it.
    """
    ring = field.pressure_kpa * field.radius_mm
    return float(
        np.sqrt(2.5 * np.trapezoid(ring * field.radius_mm**2, field.radius_mm) / np.trapezoid(ring, field.radius_mm))
    )
