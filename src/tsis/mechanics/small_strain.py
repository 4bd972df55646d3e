"""A flat probe pressed on a slab: small strain, frictionless contact that stays closed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from tsis.mechanics.bodies import Resolution, Slab, SlabWithSphere, face_of, probe_stiffness
from tsis.model import Phantom, PressField, Probe, check
from tsis.model.errors import InputError, MechanicsError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.mechanics.face import Face

MN_PER_N = 1000.0
FACE_POINTS = 241
EDGE_SHARE = 0.95  # outside it the pressure is singular and its sign says nothing


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UnitPress:
    """Answer to a force of 1 mN at the face's nodes.

    Attributes
    ----------
    pressure
        Nodal pressure in kPa/mN, shape (n,).
    displacement
        Displacement of the probe's face relative to the glass in mm/mN, shape (n,).
    approach
        Travel of the glass in mm/mN.
    """

    pressure: NDArray[np.float64]
    displacement: NDArray[np.float64]
    approach: float

    def __add__(self, other: UnitPress) -> UnitPress:
        return UnitPress(
            pressure=self.pressure + other.pressure,
            displacement=self.displacement + other.displacement,
            approach=self.approach + other.approach,
        )

    def __sub__(self, other: UnitPress) -> UnitPress:
        return UnitPress(
            pressure=self.pressure - other.pressure,
            displacement=self.displacement - other.displacement,
            approach=self.approach - other.approach,
        )


class PressKernel:
    """One probe on slabs of one thickness: everything that does not depend on the inclusion, computed once."""

    def __init__(
        self,
        probe: Probe,
        *,
        thickness_mm: float,
        poisson: float,
        block_mm: float | None = None,
        resolution: Resolution | None = None,
    ) -> None:
        resolution = resolution or Resolution()
        self.probe = probe
        self.thickness_mm, self.poisson = thickness_mm, poisson
        self.face: Face = face_of(probe.radius_mm, resolution)
        self._probe_compliance = np.linalg.inv(probe_stiffness(probe, resolution))
        self._mass = self.face.mass()
        self._slab = Slab(
            thickness_mm=thickness_mm,
            poisson=poisson,
            probe_radius_mm=probe.radius_mm,
            block_mm=block_radius_mm(probe) if block_mm is None else block_mm,
            resolution=resolution,
        )

    def slab(self, *, diameter_mm: float, depth_mm: float, poisson: float) -> SlabWithSphere:
        """Mesh a sphere into the slab."""
        return self._slab.with_sphere(diameter_mm=diameter_mm, depth_mm=depth_mm, poisson=poisson)

    def solve(self, slab_stiffness: NDArray[np.float64], tissue_kpa: float) -> UnitPress:
        """Press tissue whose face stiffness at unit modulus is ``slab_stiffness``."""
        compliance = self._probe_compliance + np.linalg.inv(slab_stiffness) / tissue_kpa
        force = np.linalg.solve(compliance, np.ones(len(compliance)))
        force, approach = force / force.sum(), 1 / force.sum()
        return UnitPress(
            pressure=np.linalg.solve(self._mass, force),
            displacement=self._probe_compliance @ force,
            approach=float(approach),
        )

    def plain(self, tissue_kpa: float) -> UnitPress:
        """Plain tissue, on a mesh that depends on nothing but the slab."""
        return self.solve(self._plain_stiffness, tissue_kpa)

    @cached_property
    def _plain_stiffness(self) -> NDArray[np.float64]:
        return self._slab.plain_stiffness()

    def signal(self, slab: SlabWithSphere, contrast: float, tissue_kpa: float) -> UnitPress:
        """What the sphere changes: with it minus without it, ON ONE MESH (else the mesh manufactures signal)."""
        return self.solve(slab.stiffness(contrast), tissue_kpa) - self.solve(slab.plain_stiffness(), tissue_kpa)


def block_radius_mm(probe: Probe, diameter_mm: float = 0.0) -> float:
    """Radius of the block around the axis that is meshed anew for inclusions of up to ``diameter_mm``."""
    return max(0.8 * probe.radius_mm, 0.65 * diameter_mm)


def press(
    probe: Probe,
    phantom: Phantom,
    *,
    force_n: float,
    strain: str = "small",
    resolution: Resolution | None = None,
) -> PressField:
    """Press a probe on a phantom and return what happens on the probe's face.

    The tissue is bonded to the chest wall, the contact is frictionless and closed, the inclusion sits on the axis.
    The field of a phantom with an inclusion is that of plain tissue plus the inclusion's change, the latter computed
    with and without contrast on one mesh, so that ``press(p, with) - press(p, without)`` is a converged signal.

    Parameters
    ----------
    probe, phantom
        What presses and what is pressed.
    force_n
        Force in newtons, in [0, 50]; the answer is linear in it.
    strain
        ``"small"``; the finite-strain model is not part of this version.
    resolution
        Mesh density. The default is converged to 0.1 % inside 0.8 of the face's radius for faces of about 12 mm and
        inclusions from 1 mm; smaller ones, very shallow ones and much larger faces need a finer one.

    Raises
    ------
    InputError
        When a value lies outside its range or the inclusion is not a sphere on the axis.
    MechanicsError
        When the tissue would lift off the face or the glass would travel through the slab, which this linear model
        cannot describe.

    Examples
    --------
    >>> import tsis
    >>> from tsis.mechanics import press
    >>> field = press(tsis.load_probe("tsis-2011"), tsis.load_phantom("plain"), force_n=1.0)
    >>> f"{field.face_displacement_mm[0]:.4f} mm in the centre"
    '0.1555 mm in the centre'
    """
    check.kind("probe", probe, Probe)
    check.kind("phantom", phantom, Phantom)
    check.number("force_n", force_n, 0.0, 50.0, hint="newtons")
    if strain != "small":
        raise InputError(f"strain must be 'small' in this version; got {strain!r}")
    if probe.face_curvature_mm is not None or probe.sides != "free":
        raise InputError("probe must be flat with free sides in this version; got a domed face or bonded sides")
    resolution = resolution or Resolution()
    with threadpool_limits(limits=1, user_api="blas"):  # matrices this small only lose time to threads
        unit = _unit_press(probe, phantom, resolution)
    load, face = force_n * MN_PER_N, face_of(probe.radius_mm, resolution)
    _refuse_impossible_travel(unit.approach * load, probe, phantom)
    radius = np.linspace(0.0, probe.radius_mm, FACE_POINTS)
    pressure = load * face.averages(radius) @ unit.pressure
    _refuse_lift_off(radius, pressure)
    return PressField(
        radius_mm=radius,
        face_displacement_mm=load * face.interpolation(radius) @ unit.displacement,
        pressure_kpa=pressure,
        approach_mm=unit.approach * load,
        force_n=force_n,
    )


def _refuse_impossible_travel(approach_mm: float, probe: Probe, phantom: Phantom) -> None:
    room = probe.thickness_mm + phantom.thickness_mm
    if approach_mm >= room:
        raise MechanicsError(
            f"the glass would travel {approach_mm:.0f} mm, and probe and slab are only {room:g} mm thick together; "
            "small strain cannot describe this press: choose a smaller force or stiffer tissue"
        )


def _refuse_lift_off(radius: NDArray[np.float64], pressure: NDArray[np.float64]) -> None:
    inside = radius < EDGE_SHARE * radius[-1]
    lowest = int(np.argmin(np.where(inside, pressure, np.inf)))
    if pressure[lowest] < 0:
        raise MechanicsError(
            f"the tissue lifts off the face at r = {radius[lowest]:.1f} mm, and this model keeps the contact closed; "
            "choose a smaller, deeper or softer inclusion"
        )


def _unit_press(probe: Probe, phantom: Phantom, resolution: Resolution) -> UnitPress:
    inclusion = phantom.inclusion
    if inclusion is None:
        return _kernel(probe, phantom.thickness_mm, phantom.poisson, None, resolution).plain(phantom.young_kpa)
    if phantom.more_inclusions or inclusion.offset_mm != (0.0, 0.0) or inclusion.semi_axes_mm is not None:
        raise InputError(
            "inclusion must be one sphere on the probe's axis (offset_mm (0, 0), no semi_axes_mm) for this model; "
            f"got offset_mm {inclusion.offset_mm}, semi_axes_mm {inclusion.semi_axes_mm}"
        )
    block = block_radius_mm(probe, inclusion.diameter_mm)
    kernel = _kernel(probe, phantom.thickness_mm, phantom.poisson, block, resolution)
    slab = kernel.slab(diameter_mm=inclusion.diameter_mm, depth_mm=inclusion.depth_mm, poisson=inclusion.poisson)
    contrast = inclusion.young_kpa / phantom.young_kpa
    return kernel.plain(phantom.young_kpa) + kernel.signal(slab, contrast, phantom.young_kpa)


@lru_cache(maxsize=8)
def _kernel(
    probe: Probe, thickness_mm: float, poisson: float, block_mm: float | None, resolution: Resolution
) -> PressKernel:
    return PressKernel(probe, thickness_mm=thickness_mm, poisson=poisson, block_mm=block_mm, resolution=resolution)
