"""The entry to a press: an argument selects the model."""

from __future__ import annotations

import numpy as np

from tsis.errors import InputError
from tsis.mechanics.finite_strain.neo_hookean_press import press_finite
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.mechanics.mesh import FACE_POINTS
from tsis.mechanics.small_strain.linear_press import small_strain_press
from tsis.mechanics.small_strain.slab import Resolution
from tsis.model.phantom import Phantom
from tsis.model.press import PressField
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type


def press(
    probe: Probe,
    phantom: Phantom,
    *,
    force_n: float,
    strain: str = "small",
    resolution: Resolution | FiniteResolution | None = None,
) -> PressField:
    """Press a probe on a phantom and return the displacement and pressure on the probe's face.

    The tissue is bonded to the chest wall. The contact is frictionless and unilateral: tissue pushes and never pulls,
    and a domed face touches over a disc that grows with the force. The inclusion is a sphere or spheroid on the
    probe's axis. ``press(p, with) - press(p, without)`` is a converged signal, because the inclusion's change is
    computed with and without contrast on one mesh.

    Parameters
    ----------
    probe, phantom
        The probe and the tissue under it.
    force_n
        Force in newtons, in [0, 50]. At small strain the response of a flat face is linear in it.
    strain
        ``"small"``, milliseconds a press, or ``"finite"``: neo-Hookean bodies, large rotations, a probe that slides;
        seconds a press, and a rim rounded by `tsis.mechanics.finite_strain.patches.FiniteResolution`.
    resolution
        Mesh density, a `Resolution` at small strain and a `FiniteResolution` at finite. The default at small strain
        is converged to 0.1 % inside 0.8 of the face's radius; the mesh follows the inclusion's size and depth.

    Raises
    ------
    InputError
        When a value lies outside its range or the inclusion is off the axis.
    MechanicsError
        When the strain is too large for the model; the message names a valid force.

    Examples
    --------
    >>> import tsis
    >>> from tsis.mechanics import press
    >>> field = press(tsis.load_probe("tsis-2011"), tsis.load_phantom("plain"), force_n=1.0)
    >>> f"{field.face_displacement_mm[0]:.4f} mm in the centre"
    '0.1555 mm in the centre'
    """
    require_type("probe", probe, Probe)
    require_type("phantom", phantom, Phantom)
    require_number("force_n", force_n, 0.0, 50.0, hint="newtons")
    if force_n == 0 and strain in ("small", "finite"):
        none = np.zeros(FACE_POINTS)
        radius = np.linspace(0.0, probe.radius_mm, FACE_POINTS)
        return PressField(radius_mm=radius, face_displacement_mm=none, pressure_kpa=none, approach_mm=0.0, force_n=0.0)
    if strain == "small" and isinstance(resolution, Resolution | None):
        return small_strain_press(probe, phantom, force_n, resolution)
    if strain == "finite" and isinstance(resolution, FiniteResolution | None):
        return press_finite(probe, phantom, force_n=force_n, resolution=resolution)
    if strain in ("small", "finite"):
        raise InputError(f"resolution must suit strain {strain!r}; got a {type(resolution).__name__}")
    raise InputError(f"strain must be 'small' or 'finite'; got {strain!r}")
