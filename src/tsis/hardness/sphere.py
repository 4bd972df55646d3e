"""Press of a soft sphere on the probe: pressure over the deformed face, as the camera records it."""

from __future__ import annotations

from contextlib import nullcontext, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, MechanicsError
from tsis.mechanics.finite_strain.equilibrium import find_first_contact, follow_load_path
from tsis.mechanics.finite_strain.neo_hookean_press import require_ascending_forces, require_enough_force
from tsis.mechanics.finite_strain.probe_on_slab import SPRING as PULL
from tsis.mechanics.finite_strain.soft_sphere import LIGHTEST, TOUCH, WIDEST_CONTACT, SphereOnProbe
from tsis.model.press import MN_PER_N, PressField
from tsis.model.probe import Probe
from tsis.model.require import require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.mechanics.finite_strain.soft_sphere import SphereResolution
    from tsis.model.phantom import SoftSphere


def press_fields(
    probe: Probe,
    sphere: SoftSphere,
    *,
    forces_n: Sequence[float],
    resolution: SphereResolution,
    stop_at_limit: bool = False,
) -> tuple[PressField, ...]:
    """Press a sphere between a frictionless plate and the probe; the fields are those of the deformed face.

    Large forces shift the skin inwards, by up to two per cent of the contact radius on a soft probe. The camera records
    the shifted face.

    Parameters
    ----------
    probe
        The probe.
    sphere
        The sphere; its radius is at most 0.6 of the face's.
    forces_n
        Ascending forces in newtons.
    resolution
        Mesh density; a press that does not converge is repeated on slightly finer meshes.
    stop_at_limit
        Return the converged forces, at least one, instead of raising at the first that does not converge.

    Raises
    ------
    InputError
        When the sphere is too large for the face, or the forces do not ascend.
    MechanicsError
        When a force converges on none of four meshes.
    """
    require_type("probe", probe, Probe)
    require_small_sphere(probe, sphere.radius_mm)
    require_ascending_forces(forces_n)
    softer = min(sphere.young_kpa, probe.layers[0].young_kpa)
    require_enough_force(forces_n[0], softer, sphere.radius_mm, lightest=LIGHTEST)
    failure: MechanicsError | None = None
    with one_blas_thread():
        # Newton's method may stall where the contact's edge meets a node of one mesh.
        for more, more_of_face in ((0, 0), (1, 0), (0, 1), (2, 1)):
            cells, face_cells = resolution.cells + more, resolution.face_cells + more_of_face
            mesh = replace(resolution, cells=cells, face_cells=face_cells)
            press = SphereOnDeformedFace(probe, sphere.radius_mm, sphere.young_kpa, sphere.poisson, mesh)
            try:
                return press.fields(forces_n, stop_at_limit=stop_at_limit)
            except MechanicsError as error:
                failure = failure or error
    assert failure is not None
    raise failure


def require_small_sphere(probe: Probe, radius_mm: float) -> None:
    """Refuse an object larger than the probe can measure: its contact would reach the rim."""
    largest = WIDEST_CONTACT * probe.radius_mm
    if radius_mm > largest:
        requirement = f"must be at most {largest:.3g}, {WIDEST_CONTACT:g} of the face's radius"
        cure = "use a wider probe"
        raise InputError(
            f"the object must be smaller than the probe: radius_mm {requirement}; got {radius_mm:g} ({cure})",
            name="radius_mm",
            requirement=requirement,
            value=f"{radius_mm:g}",
            cure=cure,
        )


class SphereOnDeformedFace(SphereOnProbe):
    """Mechanics of the sphere, with fields over the deformed face."""

    def fields(self, forces_n: Sequence[float], *, stop_at_limit: bool) -> tuple[PressField, ...]:
        """Fields at ascending forces in newtons, as far as they converge."""
        forces, fields_found = [force * MN_PER_N for force in forces_n], list[PressField]()
        with suppress(MechanicsError) if stop_at_limit else nullcontext():
            first = find_first_contact(
                self.potential, self.deformed, TOUCH * self._radius, PULL, below_mn=forces[0] / 2
            )
            states = follow_load_path(self.potential, first, forces, refuse=self.refuse)
            for state, force in zip(states, forces_n, strict=True):
                field = self.read(state, force).field
                weights = self.face.face.weights(self.shape.arc_at(field.radius_mm))[:, 0]
                outward = weights @ self.potential.displacements(state.unknowns)[self.face.nodes, 0]
                fields_found.append(to_deformed_radius(field, np.asarray(outward)))
        if not fields_found:
            raise MechanicsError(f"the press does not converge at {forces_n[0]:.3g} N; ask for another resolution")
        return tuple(fields_found)


def to_deformed_radius(field: PressField, outward_mm: NDArray[np.float64]) -> PressField:
    """Field over the deformed radius, for a face displaced by ``outward_mm`` along the radius."""
    radius = field.radius_mm
    deformed = np.maximum.accumulate(np.where(radius > 0, radius + outward_mm, 0.0))
    # A ring carries the same force before and after deformation; its area scales with radius times width.
    wider = np.gradient(deformed, radius)
    around = np.divide(deformed, radius, out=np.full(len(radius), wider[0]), where=radius > 0)
    pressure = field.pressure_kpa / np.maximum(wider * around, 1e-3)
    return replace(
        field,
        pressure_kpa=np.interp(radius, deformed, pressure, right=0.0),
        face_displacement_mm=np.interp(radius, deformed, field.face_displacement_mm),
    )


def hertzian_radius_mm(field: PressField) -> float:
    """Radius in mm of the Hertzian contact whose pressure has the same second moment: ``a² = 5/2 <r²>``.

    The pressure of a Hertzian contact falls as ``sqrt(1 - r²/a²)``, whose mean square radius is ``2/5 a²``. Meshes and
    images determine it ten times more precisely than the edge of the pressure, since the whole contact contributes.
    """
    ring = field.pressure_kpa * field.radius_mm
    return float(
        np.sqrt(2.5 * np.trapezoid(ring * field.radius_mm**2, field.radius_mm) / np.trapezoid(ring, field.radius_mm))
    )
