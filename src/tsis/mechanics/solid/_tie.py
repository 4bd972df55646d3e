"""A closed frictionless contact in three dimensions: the inclusions' change on the face, on one mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import import_extra
from tsis.mechanics.solid._mesh import FEATURE, inclusion_name, layer_name, solid_mesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics._element import Floats
    from tsis.mechanics.solid._mesh import SolidResolution, Symmetry
    from tsis.model import Phantom, Probe


RESIDUAL = 1e-9  # of the iteration for tissue without inclusion, relative
INSIDE = 1e-6  # of the face's radius: offset of points on mirrors and skin into the mesh


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FaceChange:
    """Change on the face by the inclusions under a force of 1 mN."""

    face_displacement_mm: Floats  # at the requested points
    pressure_kpa: Floats  # at the requested points
    approach_mm: float  # change of the glass's travel
    unknowns: int  # size of the linear system
    iterations: int  # for tissue without inclusion


class TiedSolid:
    """Probe and slab in closed frictionless contact, without a penalty.

    The normal displacement is one continuous function over both bodies; the tangential ones are functions of each body.
    """

    def __init__(self, probe: Probe, phantom: Phantom, symmetry: Symmetry, resolution: SolidResolution) -> None:
        self._ng = import_extra("ngsolve", feature=FEATURE, extra="fem3d")
        self.probe, self.phantom, self.symmetry = probe, phantom, symmetry
        self.mesh = solid_mesh(probe, phantom, symmetry, resolution)
        self._layers = [layer_name(index) for index in range(len(probe.layers))]
        self._inclusions = [inclusion_name(index) for index in range(len(phantom.inclusions))]
        self._pushed = "glass|side" if probe.sides == "bonded" else "glass"
        self._space = self._displacements(resolution.order)

    def _displacements(self, order: int) -> Any:
        """Spaces of u_x and u_y of the probe, of u_x and u_y of the slab, and of u_z of both."""

        def scalar(fixed: str, region: str = "") -> Any:
            where = {"definedon": region} if region else {}
            return self._ng.H1(self.mesh, order=order, dirichlet=fixed, **where)

        above, below = "|".join(self._layers), "|".join(["tissue", *self._inclusions])
        return self._ng.FESpace(
            [
                scalar(f"{self._pushed}|mirror_x", above),
                scalar(f"{self._pushed}|mirror_y", above),
                scalar("wall|mirror_x", below),
                scalar("wall|mirror_y", below),
                scalar(f"wall|{self._pushed}"),
            ]
        )

    def change(self, x_mm: Floats, y_mm: Floats, report: Callable[[str], None]) -> FaceChange:
        """Change by the inclusions at points of the face in the phantom's frame."""
        probe, with_it, reference = (self._stiffness(part) for part in ("probe", "with", "without"))
        report(f"factorising {self._space.ndof} unknowns")
        inverse = with_it.Inverse(self._space.FreeDofs(), inverse="sparsecholesky")
        pushed = self._ng.GridFunction(self._space)
        pushed.components[4].Set(-1.0, definedon=self.mesh.Boundaries(self._pushed))
        load = with_it.CreateColVector()
        load.data = with_it * pushed.vec
        loaded = pushed.vec.CreateVector()
        loaded.data = pushed.vec - inverse * load
        report("solving tissue without inclusion on the same mesh")
        load.data = -1 * (reference * pushed.vec)
        # Inclusions fill a small part, so the factors with them are a good preconditioner.
        solver = self._ng.krylovspace.CGSolver(mat=reference, pre=inverse, tol=RESIDUAL, maxiter=500)
        bare = pushed.vec.CreateVector()
        bare.data = solver * load
        bare.data += pushed.vec
        forces = [self._force(matrix, item, pushed) for matrix, item in ((with_it, loaded), (reference, bare))]
        difference = self._ng.GridFunction(self._space)
        difference.vec.data = (1 / forces[0]) * loaded - (1 / forces[1]) * bare
        approach = 1 / forces[0] - 1 / forces[1]
        points = self._points(x_mm, y_mm)
        pressure = self._pressure(probe, difference)
        return FaceChange(
            face_displacement_mm=np.asarray(difference.components[4](points)).ravel() + approach,
            pressure_kpa=np.asarray(pressure(points)).ravel(),
            approach_mm=approach,
            unknowns=self._space.ndof,
            iterations=solver.iterations,
        )

    def _stiffness(self, part: str) -> Any:
        """Stiffness of ``"probe"``, or of the whole ``"with"`` or ``"without"`` contrast of the inclusions."""
        ng, phantom = self._ng, self.phantom
        u, v = self._space.TnT()
        above = {
            name: (layer.young_kpa, layer.poisson) for name, layer in zip(self._layers, self.probe.layers, strict=True)
        }
        form = ng.BilinearForm(self._space, symmetric=True)
        form += self._energy((u[0], u[1], u[4]), (v[0], v[1], v[4]), above)
        if part != "probe":
            tissue = (phantom.young_kpa, phantom.poisson)
            below = {"tissue": tissue}
            for name, inclusion in zip(self._inclusions, phantom.inclusions, strict=True):
                below[name] = (inclusion.young_kpa, inclusion.poisson) if part == "with" else tissue
            form += self._energy((u[2], u[3], u[4]), (v[2], v[3], v[4]), below)
        return form.Assemble().mat

    def _energy(self, u: tuple[Any, ...], v: tuple[Any, ...], material: dict[str, tuple[float, float]]) -> Any:
        """Twice the elastic energy of the regions of ``material``, each with its (young_kpa, poisson)."""
        ng = self._ng
        lame = {name: (e * nu / (1 + nu) / (1 - 2 * nu), e / 2 / (1 + nu)) for name, (e, nu) in material.items()}
        first, shear = (self.mesh.MaterialCF({name: pair[index] for name, pair in lame.items()}) for index in (0, 1))
        strains = []
        for displacement in (u, v):
            rows = tuple(entry for component in displacement for entry in ng.grad(component))
            strains.append(ng.Sym(ng.CF(rows, dims=(3, 3))))
        left, right = strains
        density = first * ng.Trace(left) * ng.Trace(right) + 2 * shear * ng.InnerProduct(left, right)
        return density * ng.dx("|".join(material))

    def _force(self, matrix: Any, displacement: Any, pushed: Any) -> float:
        """Force in mN for a travel of the glass of 1 mm, all mirrored parts together."""
        reaction = matrix.CreateColVector()
        reaction.data = matrix * displacement
        return float(self._ng.InnerProduct(reaction, pushed.vec)) * self.symmetry.copies

    def _pressure(self, probe: Any, displacement: Any) -> Any:
        """Pressure from the nodal forces on the probe's face; unlike stresses, it sums up to the force."""
        ng = self._ng
        force = probe.CreateColVector()
        force.data = probe * displacement.vec
        nodal = ng.GridFunction(self._space)
        nodal.vec.data = force
        normal = self._space.components[4]
        # One order below the displacement, as stresses have; a higher order would follow errors of the mesh.
        space = ng.H1(self.mesh, order=normal.globalorder - 1)
        to_normal = ng.ConvertOperator(space, normal)
        on_face = space.GetDofs(self.mesh.Boundaries("face"))
        u, v = space.TnT()
        mass = ng.BilinearForm(u * v * ng.ds("face")).Assemble().mat
        load = mass.CreateColVector()
        load.data = to_normal.T * nodal.components[4].vec
        pressure = ng.GridFunction(space)
        pressure.vec.data = mass.Inverse(on_face, inverse="sparsecholesky") * load
        return pressure

    def _points(self, x_mm: Floats, y_mm: Floats) -> Any:
        """Points of the face in the mesh."""
        x, y = self.symmetry.folded(x_mm, y_mm)
        step = INSIDE * self.probe.radius_mm
        x = np.maximum(x, step) if "x" in self.symmetry.mirrors else x
        y = np.maximum(y, step) if "y" in self.symmetry.mirrors else y
        return self.mesh(x, y, np.full_like(x, step))
