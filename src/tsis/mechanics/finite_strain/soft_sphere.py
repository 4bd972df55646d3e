"""A sphere squeezed between a plate and the probe, and its mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.compiled import one_blas_thread
from tsis.mechanics.finite_strain.equilibrium import Potential
from tsis.mechanics.finite_strain.neo_hookean import FIXED, OWN, ElasticBody, number_unknowns
from tsis.mechanics.finite_strain.neo_hookean_press import require_ascending_forces, require_enough_force
from tsis.mechanics.finite_strain.patches import (
    FiniteResolution,
    MeshPatch,
    Solid,
    join_meshes,
    mesh_probe,
    rounded,
    weld,
)
from tsis.mechanics.finite_strain.probe_on_slab import STEERING, STIFFNESS, LoadedFace
from tsis.mechanics.finite_strain.sliding import Plate, SlidingContact, SmoothFace, SoftFace
from tsis.mechanics.mesh import LayeredMesh, graded, refine
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics.finite_strain.equilibrium import State
    from tsis.mechanics.mesh import Floats, Integers
    from tsis.model.press import PressField


CORE = 0.5  # half the core's side as a fraction of the radius


def mesh_ball(
    *, radius_mm: float, young_kpa: float, poisson: float, order: int, cells: int, rings: int
) -> tuple[Solid, Integers]:
    """Mesh a ball with its pole (0, 0) on a face and its centre at z = radius; see `SphereResolution`.

    Returns the body, and the nodes of its surface from the pole at z = 0 to the other pole.
    """
    side = CORE * radius_mm
    centre = np.array([0.0, radius_mm])
    line = refine(np.linspace(0.0, 1.0, cells + 1), order)
    upright = refine(np.linspace(-1.0, 1.0, cells + 1), order)
    flat = np.zeros_like(line)
    below = np.column_stack([line, flat - 1])
    beside = np.column_stack([np.ones_like(upright), upright])
    above = np.column_stack([line[::-1], flat + 1])
    outline = side * np.concatenate([below, beside[1:], above[1:]])
    angles = np.pi * np.concatenate([line / 4, (1 / 4 + (upright + 1) / 4)[1:], (3 / 4 + line / 4)[1:]])
    circle = radius_mm * np.column_stack([np.sin(angles), -np.cos(angles)])
    circle[[0, -1], 0] = 0.0
    fraction = refine(np.linspace(0.0, 1.0, rings + 1), order)
    ring = centre + circle[:, None] + fraction[None, :, None] * (outline - circle)[:, None]
    core = centre + side * np.stack(np.meshgrid(line, upright, indexing="ij"), axis=-1)
    patches = [
        MeshPatch(
            mesh=LayeredMesh(nodes=nodes, order=order),
            young_kpa=np.full(layers, young_kpa),
            poisson=np.full(layers, poisson),
        )
        for nodes, layers in ((ring, rings), (core, cells))
    ]
    solid = weld(patches)
    return solid, solid.patches[0][:, 0]


LIGHTEST = 3e-4  # force over modulus times radius squared; below it the mesh does not resolve the contact
TOUCH = 0.02  # travel of the first touch as a fraction of the sphere's radius
WIDEST_CONTACT = 0.6  # radius of the sphere as a fraction of the face's, so that the contact stays on the face
LARGEST_STRETCH = 4.0
FIT_DEGREE = 3  # of the polynomial in r^2 fitted to the square of the pressure
FIT_POINTS = 12  # on each closed part of an element edge


@dataclass(frozen=True, slots=True, kw_only=True)
class SphereResolution:
    """Mesh density of sphere and probe.

    Parameters
    ----------
    order
        Polynomial order of the elements; at least 3.
    cells
        Elements along an eighth of the sphere's circumference.
    rings
        Element layers between the sphere's core and its surface.
    face_cells
        Elements on the face along one radius of the sphere.
    """

    order: int = 4
    cells: int = 8
    rings: int = 2
    face_cells: int = 7


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpherePress:
    """A sphere between a plate and the probe.

    Attributes
    ----------
    approach_mm
        Travel of the plate since first contact.
    contact_radius_mm
        Radius of the contact on the deformed face.
    peak_pressure_kpa
        Pressure on the axis, per deformed area, from an even fit of its square over the contact.
    field
        Displacement and pressure on the probe's face, over its material radius.
    stored_mn_mm
        Strain energy of sphere, probe and the contacts' springs, mN mm.
    stretch
        Largest principal stretch or its inverse.
    """

    approach_mm: float
    contact_radius_mm: float
    peak_pressure_kpa: float
    field: PressField
    stored_mn_mm: float
    stretch: float


def squeeze_sphere(
    probe: Probe,
    *,
    sphere_radius_mm: float,
    young_kpa: float,
    poisson: float = 0.49,
    force_n: float,
    resolution: SphereResolution | None = None,
) -> SpherePress:
    """Squeeze an elastic sphere between a rigid frictionless plate and the probe's face.

    Parameters
    ----------
    probe
        The probe; its glass is fixed.
    sphere_radius_mm, young_kpa, poisson
        The sphere, neo-Hookean; its radius is at most 0.6 of the face's.
    force_n
        Force in newtons, in [1e-6, 50].
    resolution
        Mesh density.

    Raises
    ------
    InputError
        When a value lies outside its range.
    MechanicsError
        When the load does not converge or strains leave the range of the model; the message names the last valid load.
    """
    (result,) = squeeze_path(
        probe,
        sphere_radius_mm=sphere_radius_mm,
        young_kpa=young_kpa,
        poisson=poisson,
        forces_n=(force_n,),
        resolution=resolution,
    )
    return result


def squeeze_path(
    probe: Probe,
    *,
    sphere_radius_mm: float,
    young_kpa: float,
    poisson: float = 0.49,
    forces_n: Sequence[float],
    resolution: SphereResolution | None = None,
) -> tuple[SpherePress, ...]:
    """Results of `squeeze_sphere` at several ascending forces in newtons, on one load path."""
    require_type("probe", probe, Probe)
    require_number(
        "sphere_radius_mm", sphere_radius_mm, 0.1, WIDEST_CONTACT * probe.radius_mm, hint="0.6 of the face's radius"
    )
    require_number("young_kpa", young_kpa, 0.1, 1e6, hint="kilopascals")
    require_number("poisson", poisson, 0.0, 0.495)
    require_ascending_forces(forces_n)
    softer = min(young_kpa, probe.layers[0].young_kpa)
    require_enough_force(forces_n[0], softer, sphere_radius_mm, lightest=LIGHTEST)
    with one_blas_thread():  # threads slow down matrices this small
        press = SphereOnProbe(probe, sphere_radius_mm, young_kpa, poisson, resolution or SphereResolution())
        return press.path(forces_n)


class SphereOnProbe(LoadedFace[SpherePress]):
    """A sphere between a plate and a probe as one potential energy; units as in `squeeze_sphere`."""

    def __init__(
        self, probe: Probe, radius_mm: float, young_kpa: float, poisson: float, resolution: SphereResolution
    ) -> None:
        order, size = resolution.order, radius_mm / resolution.face_cells
        layers = FiniteResolution(order=order, rim_mm=size, growth=2.0)
        self.shape = rounded(probe, layers.fillet_mm)
        meshed = mesh_probe(self.shape, _lines(probe, radius_mm, size), layers)
        ball, surface = mesh_ball(
            radius_mm=radius_mm,
            young_kpa=young_kpa,
            poisson=poisson,
            order=order,
            cells=resolution.cells,
            rings=resolution.rings,
        )
        both = join_meshes(meshed.solid, ball)
        plate = len(both.nodes)
        solid = replace(both, nodes=np.concatenate([both.nodes, np.zeros((1, 2))]))
        shared = np.full((len(solid.nodes), 2), OWN)
        shared[np.abs(solid.nodes[:, 0]) < 1e-9, 0] = FIXED
        shared[meshed.glass] = FIXED
        if probe.sides == "bonded":
            shared[meshed.side] = FIXED
        shared[plate] = [FIXED, 0]
        body = ElasticBody(solid, number_unknowns(solid, shared, 1))
        self._first, self._plate, self._radius = len(meshed.solid.nodes), plate, radius_mm
        curve = SmoothFace(meshed.arc_mm, order, self.shape.points)
        self.face = SoftFace(curve, meshed.face)
        softer = min(young_kpa, probe.layers[0].young_kpa)
        stiffness = (STIFFNESS * softer, STEERING * softer)
        extent = (2 * len(surface) // 3) // order * order + 1  # each contact may pass the equator
        nodes = solid.nodes
        self.contact = SlidingContact(nodes, surface[:extent] + self._first, order, self.face, *stiffness)
        above = SlidingContact(
            nodes, surface[::-1][:extent] + self._first, order, Plate(plate, 2 * radius_mm), *stiffness
        )
        self.potential = Potential(body, [self.contact, above], 0)
        self.touch_mm, self._largest_stretch = TOUCH * radius_mm, LARGEST_STRETCH
        self._strained = np.ones(len(solid.cells), dtype=bool)

    def deformed(self, travel_mm: float) -> Floats:
        """Unknowns when the plate moves by ``travel_mm`` and the sphere by half of it."""
        unknowns = np.zeros(self.potential.size)
        axial = self.potential.body.numbering.of_node[self._first : self._plate, 1]
        unknowns[axial[axial >= 0]] = -travel_mm / 2
        unknowns[self.potential.travel] = travel_mm
        return unknowns

    def read(self, state: State, force_n: float) -> SpherePress:
        """Contact and field in a state."""
        field = self._field(state, force_n, glass_moves=False)
        edge, peak = self._contact(self.potential.positions(state.unknowns))
        return SpherePress(
            approach_mm=field.approach_mm,
            contact_radius_mm=edge,
            peak_pressure_kpa=peak,
            field=field,
            stored_mn_mm=self.potential.stored(state.unknowns),
            stretch=self.stretch(state),
        )

    def _contact(self, positions: Floats) -> tuple[float, float]:
        """Radius of the contact in mm and pressure on the axis in kPa."""
        radii, pressures, areas, edge = [], [], [], 0.0
        for part in self.contact.pressed(positions):
            gauss, weight = np.polynomial.legendre.leggauss(FIT_POINTS)
            position = (part.high + part.low + (part.high - part.low) * gauss) / 2
            edges = np.full(FIT_POINTS, part.edge)
            area = self.contact.area(edges, position, positions)
            nominal = self.contact.between(position) @ part.pressure_kpa
            pressures.append(nominal * self.contact.area(edges, position) / area)
            areas.append(weight * area * (part.high - part.low) / 2)
            radii.append(self.contact.points(edges, position, positions)[:, 0])
            end = self.contact.points(np.array([part.edge]), np.array([part.high]), positions)
            edge = max(edge, float(end[0, 0]))
        squared = np.concatenate(radii) ** 2 / edge**2
        basis = np.vander(squared, FIT_DEGREE + 1, increasing=True)
        root = np.sqrt(np.concatenate(areas))
        fit, *_ = np.linalg.lstsq(root[:, None] * basis, root * np.concatenate(pressures) ** 2, rcond=None)
        return edge, float(np.sqrt(max(fit[0], 0.0)))


def _lines(probe: Probe, radius_mm: float, size: float) -> Floats:
    """Element boundaries along the face as fractions of its radius: even under the sphere, coarser beyond it."""
    even = int(np.ceil(min(1.4 * radius_mm, 0.8 * probe.radius_mm) / size))
    near = size * np.arange(even + 1)
    far = near[-1] + graded(probe.radius_mm - near[-1], 2 * size, 2.0, probe.radius_mm / 3)
    return np.asarray(np.concatenate([near, far[1:]]) / probe.radius_mm)
