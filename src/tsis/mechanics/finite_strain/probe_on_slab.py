"""A probe on a slab as one potential energy: meshes, contact, what moves, and how its states are read."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from tsis.mechanics.face import FACE_POINTS
from tsis.mechanics.finite_strain import load_path, neo_hookean
from tsis.mechanics.finite_strain.bodies import FiniteResolution, mesh_probe, mesh_slab
from tsis.mechanics.finite_strain.elastic_body import FIXED, OWN, ElasticBody, number_unknowns
from tsis.mechanics.finite_strain.face_reading import face_displacement_mm, face_pressure_kpa
from tsis.mechanics.finite_strain.meshed_solid import join_meshes
from tsis.mechanics.finite_strain.obstacle import SoftFace
from tsis.mechanics.finite_strain.potential import Potential
from tsis.mechanics.finite_strain.rounded_probe import RoundedProbe, rounded
from tsis.mechanics.finite_strain.sliding_contact import SlidingContact
from tsis.mechanics.finite_strain.smooth_face import SmoothFace
from tsis.mechanics.mesh import face_lines
from tsis.model import PressField
from tsis.model.errors import MechanicsError
from tsis.model.press import MN_PER_N

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from tsis.mechanics.finite_strain.load_path import State
    from tsis.model import Phantom, Probe

SPRING = 1e7  # mN/mm, pulls the bodies together for the first touch
STIFFNESS = 400.0  # of the contact's springs, kPa/mm for each kPa of the softer one of what meets
STEERING = 20.0  # the same for what steers Newton's method
TOUCH = 0.02  # travel of the first touch as a share of the slab's or the probe's thickness, the smaller
LARGEST_STRETCH = 3.0
RIM_CELL = 0.8  # largest cell on the rim as a share of its radius
PULLING = 0.05  # of the mean pressure: more tension says that the mesh does not resolve the contact
INNER = 0.9  # of the face's radius; outside it the rounded rim makes the pressure steep
RIM_FILLETS = 3.0  # distance from the rim in its radii within which strains are those of its rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FinitePress:
    """One state of a press with large deformations.

    Attributes
    ----------
    field
        What happens on the probe's face.
    stored_mn_mm
        Strain energy of probe and tissue and of the contact's springs, mN mm: the work of the force on its way.
    stretch
        Largest ratio of a length to its reference length, or of the reference length to it, outside the rounded rim.
    """

    field: PressField
    stored_mn_mm: float
    stretch: float


class ProbeOnSlab:
    """A probe on a slab.

    Parameters
    ----------
    probe, phantom
        What presses and what is pressed.
    resolution
        Mesh density.
    contrast
        False gives the inclusion the tissue's own material, on the same mesh.
    """

    def __init__(self, probe: Probe, phantom: Phantom, resolution: FiniteResolution, *, contrast: bool = True) -> None:
        if probe.face_curvature_mm is not None:  # the edge of the contact travels over the whole face
            resolution = replace(resolution, largest=resolution.largest / 2)
        self.shape = rounded(probe, resolution.fillet_mm)
        # The cells of a small rim are small too.
        resolution = replace(resolution, rim_mm=min(resolution.rim_mm, RIM_CELL * self.shape.fillet_mm))
        largest, finest = resolution.largest, resolution.rim_mm / probe.radius_mm
        lines = face_lines(1.0, finest=finest, growth=resolution.growth, largest=largest)
        meshed, slab = mesh_probe(self.shape, lines, resolution), mesh_slab(phantom, probe, resolution)
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
        self.contact = SlidingContact(
            solid.nodes,
            slab.skin + self._probe_nodes,
            resolution.order,
            self.face,
            STIFFNESS * softer,
            STEERING * softer,
        )
        self.potential = Potential(body, [self.contact], 0)
        self._touch_mm = TOUCH * min(probe.thickness_mm, phantom.thickness_mm)
        self._inner = _away_from_rim(solid.nodes[solid.cells].mean(axis=1), self.shape)

    def path(self, forces_n: Sequence[float]) -> tuple[FinitePress, ...]:
        """States at ascending ``forces_n`` in newtons."""
        forces = [force * MN_PER_N for force in forces_n]
        first = load_path.find_first_contact(
            self.potential, self._moved, self._touch_mm, SPRING, below_mn=forces[0] / 2
        )
        states = load_path.follow_load_path(self.potential, first, forces, refuse=self._refuse)
        return tuple(self.read(state, force) for state, force in zip(states, forces_n, strict=True))

    def _moved(self, travel_mm: float) -> NDArray[np.float64]:
        """Unknowns when the whole probe moves by ``travel_mm``."""
        unknowns = np.zeros(self.potential.size)
        axial = self.potential.body.numbering.of_node[: self._probe_nodes, 1]
        unknowns[axial[axial >= 0]] = travel_mm
        return unknowns

    def read(self, state: State, force_n: float) -> FinitePress:
        """What a state says about the face."""
        displacements, positions = (
            self.potential.displacements(state.unknowns),
            self.potential.positions(state.unknowns),
        )
        travel = float(state.unknowns[self.potential.travel])
        radius = np.linspace(0.0, self.shape.radius_mm, FACE_POINTS)
        field = PressField(
            radius_mm=radius,
            face_displacement_mm=face_displacement_mm(self.shape, self.face, displacements, radius, glass_mm=travel),
            pressure_kpa=face_pressure_kpa(self.shape, self.contact, self.face, positions, radius),
            approach_mm=travel,
            force_n=force_n,
        )
        _refuse_pulling(field)
        return FinitePress(
            field=field,
            stored_mn_mm=self.potential.stored(state.unknowns),
            stretch=largest_stretch(self.potential, state, self._inner),
        )

    def _refuse(self, state: State) -> str | None:
        return stretch_problem(largest_stretch(self.potential, state, self._inner), LARGEST_STRETCH)


def _refuse_pulling(field: PressField) -> None:
    inside = field.radius_mm < INNER * field.radius_mm[-1]
    mean = field.force_n * MN_PER_N / (np.pi * field.radius_mm[-1] ** 2)
    least = float(field.pressure_kpa[inside].min())
    if least < -PULLING * mean:
        raise MechanicsError(
            f"the contact's pressure is not resolved: it falls to {least:.2g} kPa at a mean of {mean:.2g} kPa; "
            "choose a finer FiniteResolution, a smaller force, or a deeper or less flat inclusion"
        )


def largest_stretch(potential: Potential, state: State, elements: NDArray[np.bool_]) -> float:
    """Largest ratio of a length to its reference length, or of the reference length to it, in some ``elements``."""
    gradient = potential.body.gradient(potential.displacements(state.unknowns))[:, elements]
    stretches = neo_hookean.principal_stretches(gradient)
    return float(max(stretches.max(), (1 / stretches).max()))


def stretch_problem(stretch: float, largest: float) -> str | None:
    """Why a state is no answer of this model, or None."""
    if stretch <= largest:
        return None
    return f"lengths change {stretch:.2g} times, more than the {largest:g} that this model is good for,"


def _away_from_rim(centres: NDArray[np.float64], shape: RoundedProbe) -> NDArray[np.bool_]:
    """Which elements lie outside the neighbourhood of the rounded rim, where strains are those of the rounding."""
    probe = shape.probe
    on_probe = np.array([probe.radius_mm, -float(probe.sag_mm(probe.radius_mm))])
    on_skin = np.array([probe.radius_mm, 0.0])
    apart = np.minimum(np.linalg.norm(centres - on_probe, axis=1), np.linalg.norm(centres - on_skin, axis=1))
    return np.asarray(apart > RIM_FILLETS * shape.fillet_mm)
