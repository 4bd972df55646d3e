"""A rigid sphere pressed on the bare probe, layered or not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.compiled import one_blas_thread
from tsis.errors import InputError, MechanicsError
from tsis.mechanics.small_strain import unilateral as disc_contact
from tsis.mechanics.small_strain.linear_press import STRAIN_LIMIT, half_space_compliance
from tsis.mechanics.small_strain.slab import Resolution, face_of, probe_compliance
from tsis.model.press import MN_PER_N
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from tsis.mechanics.mesh import Floats


POINTS = 481
STEEPEST = 0.5  # largest contact radius over the sphere's; the paraboloid's gap is right within some per cent


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Indentation:
    """A sphere in the probe's face.

    Attributes
    ----------
    force_n
        Force, N.
    depth_mm
        Depth of the sphere's lowest point below the undeformed face.
    contact_radius_mm
        Radius of the contact.
    radius_mm, face_displacement_mm
        Displacement of the face towards the glass over the face, positive inwards, shape (n,) each.
    """

    force_n: float
    depth_mm: float
    contact_radius_mm: float
    radius_mm: Floats
    face_displacement_mm: Floats

    @property
    def contact_area_mm2(self) -> float:
        """Area of the contact."""
        return float(np.pi * self.contact_radius_mm**2)

    def area_deeper_than_mm2(self, depth_mm: float) -> float:
        """Area of the face in mm² with a displacement above ``depth_mm``, which lies in [0, 1000]."""
        require_number("depth_mm", depth_mm, 0.0, 1e3, hint="millimetres")
        deeper = self.face_displacement_mm - depth_mm
        if deeper[0] <= 0:
            return 0.0
        if deeper.min() > 0:
            return float(np.pi * self.radius_mm[-1] ** 2)
        edge = scipy.optimize.brentq(
            lambda radius: np.interp(radius, self.radius_mm, deeper), 0.0, self.radius_mm[deeper.argmin()]
        )
        return float(np.pi * edge**2)


def indent(
    probe: Probe, *, sphere_radius_mm: float, force_n: float, resolution: Resolution | None = None
) -> Indentation:
    """Press a rigid, smooth sphere on the middle of a flat probe at small strain.

    Parameters
    ----------
    probe
        A flat probe.
    sphere_radius_mm
        Radius of the sphere in mm, in [0.5, 1000].
    force_n
        Force in newtons, in [1e-4, 50].
    resolution
        Mesh density.

    Raises
    ------
    InputError
        When a value lies outside its range or the face is domed.
    MechanicsError
        When the contact would be wider than the face or half of the sphere's radius, or the strain too large.

    Examples
    --------
    >>> import tsis
    >>> contact = indent(tsis.load_probe("tsis-2011"), sphere_radius_mm=10.0, force_n=0.2)
    >>> f"{contact.depth_mm:.3f} mm deep, contact of {contact.contact_radius_mm:.2f} mm"
    '0.520 mm deep, contact of 2.13 mm'
    """
    require_type("probe", probe, Probe)
    require_number("sphere_radius_mm", sphere_radius_mm, 0.5, 1000.0, hint="millimetres")
    require_number("force_n", force_n, 1e-4, 50.0, hint="newtons")
    if probe.face_curvature_mm is not None:
        raise InputError(f"probe must be flat to be indented; got face_curvature_mm {probe.face_curvature_mm:g}")
    with one_blas_thread():
        return _indent(probe, sphere_radius_mm, force_n, resolution or Resolution())


def _indent(probe: Probe, sphere_radius_mm: float, force_n: float, resolution: Resolution) -> Indentation:
    skin = probe.layers[0]
    face = face_of(probe.radius_mm, resolution, skin.thickness_mm / 2)
    compliance = probe_compliance(probe, face, resolution)
    softness = (1 - skin.poisson**2) / skin.young_kpa
    elastic = disc_contact.Elastic(
        half_space=softness, smooth=compliance - softness * half_space_compliance(face, skin.poisson, resolution)
    )

    def gap(radius: Floats) -> Floats:
        return np.asarray(radius**2 / (2 * sphere_radius_mm))

    extent = min(probe.radius_mm, STEEPEST * sphere_radius_mm)
    largest = disc_contact.on_disc(elastic, disc_contact.loads(face, gap, extent), extent)
    most = float(largest.force.sum()) / MN_PER_N
    if force_n >= most:
        raise MechanicsError(
            f"the contact would be wider than {extent:g} mm, the face or half of the sphere's radius; "
            f"choose a force below {most:.2g} N or a larger sphere"
        )
    result = disc_contact.under_force(elastic, face, gap, force_n * MN_PER_N, largest=largest)
    if result.approach_mm > STRAIN_LIMIT * probe.thickness_mm:
        raise MechanicsError(
            f"the sphere would sink {result.approach_mm:.2g} mm into {probe.thickness_mm:g} mm of probe, small strain "
            f"is valid to {STRAIN_LIMIT:g} of it; choose a smaller force or a larger sphere"
        )
    radius = np.linspace(0.0, probe.radius_mm, POINTS)
    touched = radius <= result.radius_mm
    displacement = face.interpolation(radius) @ elastic.smooth @ result.force
    displacement[~touched] += softness * disc_contact.displaced_outside(result, radius[~touched])
    return Indentation(
        force_n=force_n,
        depth_mm=result.approach_mm,
        contact_radius_mm=result.radius_mm,
        radius_mm=radius,
        face_displacement_mm=np.where(touched, result.approach_mm - gap(radius), displacement),
    )
