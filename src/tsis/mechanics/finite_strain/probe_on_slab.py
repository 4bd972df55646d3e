"""A probe on a slab: its load path, displacement and pressure."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np
from numpy.polynomial import legendre

from tsis.errors import MechanicsError
from tsis.mechanics.finite_strain import equilibrium as load_path
from tsis.mechanics.finite_strain import neo_hookean
from tsis.mechanics.finite_strain.equilibrium import Potential
from tsis.mechanics.finite_strain.neo_hookean import FIXED, OWN, ElasticBody, number_unknowns
from tsis.mechanics.finite_strain.patches import (
    FiniteResolution,
    RoundedProbe,
    join_meshes,
    mesh_probe,
    mesh_slab,
    rounded,
)
from tsis.mechanics.finite_strain.sliding import SlidingContact, SmoothFace, SoftFace
from tsis.mechanics.mesh import FACE_POINTS, Booleans, Floats, Integers, face_lines, gauss_points, hat_areas, lagrange
from tsis.model.press import MN_PER_N, PressField

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.mechanics.finite_strain.equilibrium import State
    from tsis.mechanics.finite_strain.patches import SlabLines
    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe


TRAVEL = 0  # index of the probe's travel among the unknowns
PARTS = 24  # of every closed segment of an element edge, to sum up the force
PRESSURE_DEGREES_LESS = 2  # than the displacement has; higher degrees of the pressure on an edge are ripple


def _face_pressure_kpa(
    shape: RoundedProbe, contact: SlidingContact, face: SoftFace, positions: Floats, radius_mm: Floats
) -> Floats:
    """Axial force per area of the undeformed face in kPa, as means around each of ``radius_mm``.

    The means are weighted by area and by distance to the neighbours, so that their integral is the force. On each
    element edge the pressure is projected onto the polynomials that the displacements resolve, with the same integral.
    """
    radius, force = _force_within(shape, contact, face, positions)

    # The mean of a hat function over the force is a difference of the integrals of "force within a radius".
    # The pressure is constant between two radii, so the force grows with the square of the radius.
    def primitive(cell: Integers, at: Floats) -> Floats:
        low, high = radius[cell], radius[cell + 1]
        pressure = (force[cell + 1] - force[cell]) / np.maximum(high**2 - low**2, 1e-12)
        return np.asarray((at - low) * force[cell] + pressure * ((at**3 - low**3) / 3 - low**2 * (at - low)))

    whole = primitive(np.arange(len(radius) - 1), radius[1:])
    up_to = np.concatenate([[0.0], np.cumsum(whole)])
    inside = np.minimum(radius_mm, radius[-1])
    cell = np.clip(np.searchsorted(radius, inside, side="right") - 1, 0, len(radius) - 2)
    total = force[-1]
    integral = up_to[cell] + primitive(cell, inside) + (radius_mm - inside) * total
    means = np.diff(integral) / np.diff(radius_mm)
    ring = np.concatenate([means, [total]]) - np.concatenate([[0.0], means])
    return np.asarray(ring / hat_areas(radius_mm))


def _force_within(
    shape: RoundedProbe, contact: SlidingContact, face: SoftFace, positions: Floats
) -> tuple[Floats, Floats]:
    """Material radii, ascending from 0, and the axial force in mN on the face inside each radius."""
    gauss, weight = gauss_points(4)
    radii, forces = [np.zeros(1)], [np.zeros(1)]
    for part in contact.pressed(positions):
        ends = np.linspace(part.low, part.high, PARTS + 1)
        half = np.diff(ends) / 2
        position = ((ends[:-1] + half)[:, None] + half[:, None] * gauss).ravel()
        fraction = (half[:, None] * weight).ravel() * contact.area(np.full(len(position), part.edge), position)
        values, _ = lagrange(contact.gauss, position)
        pressure = (values @ part.pressure_kpa) * (values @ part.axial)
        middle = 2 * (position - part.low) / (part.high - part.low) - 1
        basis = legendre.legvander(middle, contact.order - PRESSURE_DEGREES_LESS)
        smooth = basis @ np.linalg.solve(basis.T @ (fraction[:, None] * basis), basis.T @ (fraction * pressure))
        pieces = (fraction * smooth).reshape(PARTS, -1).sum(axis=1)
        points = contact.points(np.full(PARTS, part.edge), ends[1:], positions)
        foot = face.face.closest(positions[face.nodes], points)
        radii.append(shape.radius_at(foot.parameter))
        forces.append(forces[-1][-1] + np.cumsum(pieces))
    radius, force = np.concatenate(radii), np.concatenate(forces)
    return np.maximum.accumulate(np.clip(radius, 0.0, shape.radius_mm)), force


SPRING = 1e7  # mN/mm, pulls the bodies together for the first touch
STIFFNESS = 400.0  # of the contact's springs, kPa/mm for each kPa of the softer body
STEERING = 20.0  # the same for the open or closed decision in Newton's method
TOUCH = 0.02  # travel of the first touch as a fraction of the slab's or the probe's thickness, the smaller
LARGEST_STRETCH = 3.0
COLLAPSED = 0.5  # least determinant of the deformation gradient near which Newton's method may fail
RIM_CELL = 0.8  # largest cell on the rim as a fraction of its radius
PULLING = 0.05  # of the mean pressure; with more tension the mesh does not resolve the contact
INNER = 0.9  # of the face's radius; outside it the rounded rim makes the pressure steep
RIM_FILLETS = 3.0  # zone around the rim in its radii where strains come from its rounding


Result = TypeVar("Result")


class LoadedFace(ABC, Generic[Result]):
    """The face of a probe in sliding contact with another body: its load path, and its fields in each state."""

    shape: RoundedProbe
    face: SoftFace
    contact: SlidingContact
    potential: Potential
    touch_mm: float  # travel of the first touch
    _strained: Booleans  # elements whose stretch is limited
    _largest_stretch: float

    @abstractmethod
    def deformed(self, travel_mm: float) -> Floats:
        """Unknowns when undeformed bodies move by ``travel_mm``."""

    @abstractmethod
    def read(self, state: State, force_n: float) -> Result:
        """Result in a state."""

    def path(self, forces_n: Sequence[float]) -> tuple[Result, ...]:
        """Results at ascending ``forces_n`` in newtons."""
        forces = [force * MN_PER_N for force in forces_n]
        first = load_path.find_first_contact(
            self.potential, self.deformed, self.touch_mm, SPRING, below_mn=forces[0] / 2
        )
        states = load_path.follow_load_path(self.potential, first, forces, refuse=self.refuse, explain=self.explain)
        return tuple(self.read(state, force) for state, force in zip(states, forces_n, strict=True))

    def stretch(self, state: State) -> float:
        """Largest principal stretch or its inverse."""
        gradient = self.potential.body.gradient(self.potential.displacements(state.unknowns))[:, self._strained]
        stretches = neo_hookean.principal_stretches(gradient)
        return float(max(stretches.max(), (1 / stretches).max()))

    def refuse(self, state: State) -> str | None:
        """Reason why a state lies outside the model's range, or None."""
        stretch = self.stretch(state)
        if stretch <= self._largest_stretch:
            return None
        return f"lengths change {stretch:.2g} times, more than {self._largest_stretch:g}, the limit of this model,"

    def explain(self, state: State) -> str | None:
        """Reason why the model ends near a state, or None: the contact's edge, its size, or a collapsing element."""
        positions = self.potential.positions(state.unknowns)
        parts = self.contact.pressed(positions)
        if not parts:
            return "the bodies do not touch"
        outer = parts[-1]
        edge = self.contact.points(np.array([outer.edge]), np.array([outer.high]), positions)
        arc = float(self.face.face.closest(positions[self.face.nodes], edge).parameter[0])
        # Half of the rim's arc: beyond it the tissue wraps around the side.
        if arc > self.shape.middle_mm:
            return "the tissue wraps around the probe's rim"
        if outer.edge == 0:
            return "the contact is smaller than a cell of the mesh"
        gradient = self.potential.body.gradient(self.potential.displacements(state.unknowns))
        smallest = float(neo_hookean.volume_ratio(gradient).min())
        if smallest < COLLAPSED:
            return f"an element is compressed to {smallest:.2g} of its volume"
        return None

    def _field(self, state: State, force_n: float, *, glass_moves: bool) -> PressField:
        """Displacement of the face towards the glass, and its pressure."""
        displacements = self.potential.displacements(state.unknowns)
        positions = self.potential.positions(state.unknowns)
        travel = float(state.unknowns[self.potential.travel])
        radius = np.linspace(0.0, self.shape.radius_mm, FACE_POINTS)
        axial = self.face.face.weights(self.shape.arc_at(radius))[:, 1] @ displacements[self.face.nodes, 1]
        return PressField(
            radius_mm=radius,
            face_displacement_mm=(travel if glass_moves else 0.0) - axial,
            pressure_kpa=_face_pressure_kpa(self.shape, self.contact, self.face, positions, radius),
            approach_mm=travel,
            force_n=force_n,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FinitePress:
    """One state of a press with large deformations."""

    field: PressField  # displacement and pressure on the probe's face
    stored_mn_mm: float  # strain energy of probe, tissue and the contact's springs, mN mm: the work of the force
    stretch: float  # largest principal stretch or its inverse outside the rounded rim


def suited(resolution: FiniteResolution, probe: Probe) -> FiniteResolution:
    """The mesh density that a probe needs at this resolution."""
    # The cells of a small rim are small too.
    finest = min(resolution.rim_mm, RIM_CELL * rounded(probe, resolution.fillet_mm).fillet_mm)
    # The edge of the contact travels over a whole dome.
    largest = resolution.largest / (1 if probe.face_curvature_mm is None else 2)
    return replace(resolution, largest=largest, rim_mm=finest)


class ProbeOnSlab(LoadedFace[FinitePress]):
    """A probe on a slab; ``contrast=False`` gives the inclusion the tissue's own material on the same mesh.

    ``lines`` are the element boundaries of the slab; by default those that suit the phantom.
    """

    def __init__(
        self,
        probe: Probe,
        phantom: Phantom,
        resolution: FiniteResolution,
        *,
        contrast: bool = True,
        lines: SlabLines | None = None,
    ) -> None:
        resolution = suited(resolution, probe)
        self.shape = rounded(probe, resolution.fillet_mm)
        largest, finest = resolution.largest, resolution.rim_mm / probe.radius_mm
        along = face_lines(1.0, finest=finest, growth=resolution.growth, largest=largest)
        meshed, slab = mesh_probe(self.shape, along, resolution), mesh_slab(phantom, probe, resolution, lines)
        tissue = slab.solid
        if contrast and phantom.inclusion is not None:
            tissue = replace(
                tissue,
                young_kpa=np.where(slab.inclusion, phantom.inclusion.young_kpa, tissue.young_kpa),
                poisson=np.where(slab.inclusion, phantom.inclusion.poisson, tissue.poisson),
            )
        solid = join_meshes(meshed.solid, tissue)
        self._probe_nodes = len(meshed.solid.nodes)
        shared = np.full((len(solid.nodes), 2), OWN)
        shared[np.abs(solid.nodes[:, 0]) < 1e-9, 0] = FIXED
        shared[meshed.glass] = [FIXED, 0]
        if probe.sides == "bonded":
            shared[meshed.side] = [FIXED, 0]  # the housing moves with the glass
        shared[np.abs(solid.nodes[:, 1] - phantom.thickness_mm) < 1e-7] = FIXED
        body = ElasticBody(solid, number_unknowns(solid, shared, 1))
        curve = SmoothFace(meshed.arc_mm, resolution.order, self.shape.points)
        self.face = SoftFace(curve, meshed.face)
        softer = min(phantom.young_kpa, probe.layers[0].young_kpa)
        skin = slab.skin + self._probe_nodes
        stiffness = (STIFFNESS * softer, STEERING * softer)
        self.contact = SlidingContact(solid.nodes, skin, resolution.order, self.face, *stiffness)
        self.potential = Potential(body, [self.contact], TRAVEL)
        self.touch_mm = TOUCH * min(probe.thickness_mm, phantom.thickness_mm)
        self._strained = _away_from_rim(solid.nodes[solid.cells].mean(axis=1), self.shape)
        self._largest_stretch = LARGEST_STRETCH

    def deformed(self, travel_mm: float) -> Floats:
        """Unknowns when the whole undeformed probe moves by ``travel_mm``."""
        unknowns = np.zeros(self.potential.size)
        axial = self.potential.body.numbering.of_node[: self._probe_nodes, 1]
        unknowns[axial[axial >= 0]] = travel_mm
        return unknowns

    def read(self, state: State, force_n: float) -> FinitePress:
        """Field on the face in a state."""
        field = self._field(state, force_n, glass_moves=True)
        _refuse_pulling(field)
        stored = self.potential.stored(state.unknowns)
        return FinitePress(field=field, stored_mn_mm=stored, stretch=self.stretch(state))


def _refuse_pulling(field: PressField) -> None:
    inside = field.radius_mm < INNER * field.radius_mm[-1]
    mean = field.force_n * MN_PER_N / (np.pi * field.radius_mm[-1] ** 2)
    least = float(field.pressure_kpa[inside].min())
    if least < -PULLING * mean:
        raise MechanicsError(
            f"the contact's pressure is not resolved: it falls to {least:.2g} kPa at a mean of {mean:.2g} kPa; "
            "choose a finer FiniteResolution, a smaller force, or a deeper or less flat inclusion"
        )


def _away_from_rim(centres: Floats, shape: RoundedProbe) -> Booleans:
    """Mask of the elements outside the neighbourhood of the rounded rim."""
    probe = shape.probe
    on_probe = np.array([probe.radius_mm, -float(probe.sag_mm(probe.radius_mm))])
    on_skin = np.array([probe.radius_mm, 0.0])
    difference = np.minimum(np.linalg.norm(centres - on_probe, axis=1), np.linalg.norm(centres - on_skin, axis=1))
    return np.asarray(difference > RIM_FILLETS * shape.fillet_mm)
