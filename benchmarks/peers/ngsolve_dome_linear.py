"""A domed probe pressed at small strain with NGSolve, in unilateral contact at equal radii.

Axisymmetric triangles of fourth order, one mesh for both bodies with displacements of their own on either side of the
face; the dome is a map of the flat stack that shares its thinning among the layers. Contact is linearised: vertical gap
and vertical forces at equal radii, unilateral, by an energy of 1/(2 eps) on penetration with eps so small that it
changes nothing that is stored. The approach is an unknown, the force is given. What an inclusion changes is taken with
and without contrast on one mesh.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

CUT_MM = 120.0
ROUNDS = 60
TOUCH_MM = 1e-5  # where values of the face are read: just above it, inside the probe


@dataclass(frozen=True, slots=True, kw_only=True)
class Fineness:
    """Sizes of the triangles in mm, their order, and the softness of the contact in mm/kPa."""

    face: float = 0.15
    rim: float = 0.02
    sphere: float = 0.7
    layer: float = 1.2
    order: int = 4
    softness: float = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """One press at the radii that were asked for."""

    approach_mm: float
    contact_radius_mm: float
    displacement_mm: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]


def lame(young_kpa: float, poisson: float) -> tuple[float, float]:
    return young_kpa * poisson / (1 + poisson) / (1 - 2 * poisson), young_kpa / 2 / (1 + poisson)


def meshed(probe: Probe, tissue: Phantom, diameter_mm: float, depth_mm: float, fine: Fineness) -> Any:
    """Mesh both bodies, the probe flat; they share the lines of the face."""
    ng, occ = importlib.import_module("ngsolve"), importlib.import_module("netgen.occ")
    slab = occ.Rectangle(CUT_MM, tissue.thickness_mm).Face().Move(occ.Vec(0, -tissue.thickness_mm, 0))
    half = diameter_mm / 2
    box = occ.Rectangle(half, diameter_mm).Face().Move(occ.Vec(0, -depth_mm - diameter_mm, 0))
    ball = occ.Circle(occ.Pnt(0, -depth_mm - half), half).Face() * box
    slab = slab - ball
    slab.name, ball.name, ball.maxh = "slab", "ball", fine.sphere
    bodies, height = [slab, ball], 0.0
    for index, layer in enumerate(probe.layers):
        body = occ.Rectangle(probe.radius_mm, layer.thickness_mm).Face().Move(occ.Vec(0, height, 0))
        body.name, body.maxh = f"layer{index}", fine.layer
        bodies.append(body)
        height += layer.thickness_mm
    whole = occ.Glue(bodies)

    def on(level: float, wanted: float) -> bool:
        return abs(level - wanted) < 1e-5  # bounding boxes are a little too large

    for edge in whole.edges:
        low, high = edge.bounding_box
        levels = [low[axis] if abs(low[axis] - high[axis]) < 1e-5 else np.nan for axis in (0, 1)]
        edge.name = "free"
        if on(levels[0], 0.0):
            edge.name = "axis"
        elif on(levels[1], -tissue.thickness_mm):
            edge.name = "wall"
        elif on(levels[1], probe.thickness_mm):
            edge.name = "glass"
        elif on(levels[1], 0.0) and high[0] < 1.001 * probe.radius_mm:
            edge.name, edge.maxh = "face", fine.face
    for vertex in whole.vertices:
        if np.hypot(vertex.p.x - probe.radius_mm, vertex.p.y) < 1e-6:
            vertex.maxh = fine.rim
    mesh = ng.Mesh(occ.OCCGeometry(whole, dim=2).GenerateMesh(maxh=12.0, grading=0.3))
    mesh.Curve(5)
    return mesh


class LinearPress:
    """The two bodies around one sphere, which may be made of tissue."""

    def __init__(self, probe: Probe, tissue: Phantom, diameter_mm: float, depth_mm: float, fine: Fineness) -> None:
        self.ng = ng = importlib.import_module("ngsolve")
        importlib.import_module("netgen.meshing").SetMessageImportance(0)
        self.probe, self.tissue, self.fine = probe, tissue, fine
        self.mesh = mesh = meshed(probe, tissue, diameter_mm, depth_mm, fine)
        above, below = mesh.Materials("layer.*"), mesh.Materials("slab|ball")

        def space(where: Any, fixed: str) -> Any:
            return ng.H1(mesh, order=fine.order, definedon=where, dirichlet=fixed)

        self.space = ng.FESpace(
            [
                space(above, "axis|glass"),
                space(above, "glass"),
                space(below, "axis|wall"),
                space(below, "wall"),
                ng.NumberSpace(mesh),
            ]
        )
        curvature = probe.face_curvature_mm or np.inf
        root = ng.sqrt(curvature**2 - ng.x**2)
        self.sag, self.slope = ng.x**2 / (curvature + root), ng.x / root

    def energy(self, young_kpa: float, force_mn: float) -> Any:
        """Strain energy, contact and the load's potential."""
        ng, mesh, thick = self.ng, self.mesh, self.probe.thickness_mm
        probe_r, probe_z, slab_r, slab_z, approach = self.space.TrialFunction()
        material = {
            f"layer{index}": lame(layer.young_kpa, layer.poisson) for index, layer in enumerate(self.probe.layers)
        }
        material |= {
            "slab": lame(self.tissue.young_kpa, self.tissue.poisson),
            "ball": lame(young_kpa, self.tissue.poisson),
        }
        first, shear = (mesh.MaterialCF({name: pair[i] for name, pair in material.items()}) for i in (0, 1))

        def density(radial: Any, axial: Any, tilt: Any, stretch: Any) -> Any:
            # The dome maps (r, z) to (r, z'), with dz'/dr = tilt and dz'/dz = stretch.
            (rr, rz), (zr, zz) = (
                (ng.grad(u)[0] - tilt / stretch * ng.grad(u)[1], ng.grad(u)[1] / stretch) for u in (radial, axial)
            )
            hoop = radial / ng.x
            squares = rr * rr + zz * zz + hoop * hoop + (rz + zr) ** 2 / 2
            return (first / 2 * (rr + zz + hoop) ** 2 + shear * squares) * stretch

        ring = 2 * np.pi * ng.x
        gap = self.sag + probe_z - slab_z - approach
        dome = density(probe_r, probe_z, (thick - ng.y) / thick * self.slope, (thick - self.sag) / thick)
        form = ng.BilinearForm(self.space, symmetric=True)
        form += ng.Variation(ring * dome * ng.dx("layer.*", bonus_intorder=4))
        form += ng.Variation(ring * density(slab_r, slab_z, ng.CF(0), ng.CF(1)) * ng.dx("slab|ball"))
        pushed = ng.IfPos(-gap, gap * gap / (2 * self.fine.softness), 0)
        form += ng.Variation(ring * pushed * ng.ds("face", bonus_intorder=6))
        form += ng.Variation(-force_mn / CUT_MM * approach * ng.ds("wall"))
        return form

    def press(self, young_kpa: float, force_mn: float, start: Any = None) -> Any:
        """Newton's method with halved steps; ``start`` is another press."""
        ng, form = self.ng, self.energy(young_kpa, force_mn)
        found = ng.GridFunction(self.space)
        if start is None:
            found.components[4].vec[0] = 1.0 + 4e-3 * force_mn  # so far that all of the face touches
        else:
            found.vec.data = start.vec
        residual, step, trial = (found.vec.CreateVector() for _ in range(3))
        energy = form.Energy(found.vec)
        for _ in range(ROUNDS):
            form.AssembleLinearization(found.vec)
            form.Apply(found.vec, residual)
            step.data = form.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky") * residual
            length = 1.0
            while True:
                trial.data = found.vec - length * step
                reached = form.Energy(trial)
                if reached <= energy + 1e-10 * abs(energy) or length < 1e-3:
                    break
                length /= 2
            found.vec.data, energy = trial, reached
            if abs(ng.InnerProduct(step, residual)) < 1e-14 * abs(energy):
                break
        return found

    def read(self, found: Any, radius_mm: NDArray[np.float64], hat_mm: float) -> Reading:
        """What happens on the face; pressures are means over hats of this half width."""
        ng = self.ng
        probe_z, slab_z, approach = found.components[1], found.components[3], float(found.components[4].vec[0])
        gap = self.sag + probe_z - slab_z - approach
        pressure = ng.IfPos(-gap, -gap / self.fine.softness, 0)

        def over_face(what: Any) -> float:
            return float(ng.Integrate(what * ng.ds("face", bonus_intorder=12), self.mesh))

        means = []
        for radius in radius_mm:
            away = ng.sqrt((ng.x - radius) ** 2)
            hat = ng.IfPos(hat_mm - away, 1 - away / hat_mm, 0) * ng.x
            means.append(over_face(pressure * hat) / over_face(hat))
        inside = np.maximum(radius_mm, TOUCH_MM)
        near, far = (
            np.array([probe_z(self.mesh(radius, height)) for radius in inside]) for height in (TOUCH_MM, 2 * TOUCH_MM)
        )
        return Reading(
            approach_mm=approach,
            contact_radius_mm=over_face(ng.IfPos(-gap, 1, 0)),
            displacement_mm=2 * near - far,
            pressure_kpa=np.array(means),
        )
