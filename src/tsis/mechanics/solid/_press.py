"""A press in three dimensions, as the sum of the reference press and the change by the inclusions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError, MechanicsError, import_extra
from tsis.mechanics._face import EDGE_FRACTION
from tsis.mechanics.small_strain import small_strain_press, strain_problem
from tsis.mechanics.solid._mesh import (
    FEATURE,
    SolidResolution,
    inclusion_name,
    layer_name,
    outer_radius_mm,
    solid_mesh,
    symmetry_of,
)
from tsis.model.phantom import Phantom
from tsis.model.press import MN_PER_N, PressField, PressMap
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics._element import Booleans, Floats
    from tsis.mechanics.small_strain import Resolution
    from tsis.mechanics.solid._mesh import Symmetry


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


OFF_RIM = 1e-4  # of the face's radius
THINNEST_GAP = 0.02  # between an inclusion and skin or wall, of its smallest diameter; thinner gaps mesh badly
FARTHEST = 0.6  # of the slab's radius; the slab's side disturbs inclusions beyond it
PULLING = 0.05  # of the mean pressure: more tension than an error of rounding and mesh
MOST_CACHED = 8
_CACHE: dict[tuple[Probe, Phantom, tuple[bytes, bytes], SolidResolution], FaceChange] = {}


def press_solid(
    probe: Probe,
    phantom: Phantom,
    *,
    force_n: float,
    spacing_mm: float = 0.25,
    resolution: SolidResolution | None = None,
    reference_resolution: Resolution | None = None,
    threads: int = 2,
    progress: Callable[[str], None] | None = None,
) -> PressMap:
    """Press a flat probe on a phantom with inclusions at any position: small strain, three dimensions.

    The contact is frictionless and covers the face. The change by the inclusions is computed with and without contrast
    on one mesh, and added to the reference press of `tsis.mechanics.press`: the error of a coarse mesh is then a
    fraction of the signal, not of the press. Mirror symmetry reduces one inclusion to half a model, on the axis to a
    quarter.

    Parameters
    ----------
    probe, phantom
        The flat probe and the tissue under it.
    force_n
        Force in newtons, in [0, 50]; the result is linear in it.
    spacing_mm
        Spacing of the result's grid, in [0.02, 5].
    resolution
        Mesh density in three dimensions. With the default the signal of the displacement is right to 1 % of its peak
        inside 0.8 of the face's radius and to 2 % up to its rim.
    reference_resolution
        Mesh density of the reference press.
    threads
        Threads of the linear algebra, in [1, 64]; they wait busily, so use no more than there are idle cores.
    progress
        Called with a short text at the start of each stage.

    Raises
    ------
    InputError
        When a value lies outside its range, the face is domed, or an inclusion is too close to the skin, the chest
        wall or the slab's side.
    MechanicsError
        When the strain is too large for the model, or the contact would open.
    MissingExtraError
        When NGSolve is not installed.
    """
    require_type("probe", probe, Probe)
    require_type("phantom", phantom, Phantom)
    require_number("force_n", force_n, 0.0, 50.0, hint="newtons")
    require_number("spacing_mm", spacing_mm, 0.02, 5.0, hint="millimetres")
    require_number("threads", threads, 1, 64)
    if probe.face_curvature_mm is not None:
        raise InputError(
            f"face_curvature_mm must be None for a press in three dimensions; got {probe.face_curvature_mm:g}"
        )
    _check_inside(probe, phantom)
    steps = int(np.ceil(probe.radius_mm / spacing_mm))
    axis = np.asarray(spacing_mm * np.arange(-steps, steps + 1), dtype=float)
    reference = small_strain_press(probe, phantom.without_inclusion(), force_n, reference_resolution).on_grid(
        axis, axis
    )
    if not phantom.inclusions or force_n == 0:
        return reference
    points = _points(axis, probe.radius_mm)
    change = _change(probe, phantom, points.key, resolution or SolidResolution(), threads, progress)
    result = _added(reference, points, change)
    _check_model(probe, phantom, result, points.radius_mm < EDGE_FRACTION * probe.radius_mm)
    return result


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Points:
    """The grid's points on the face and the fraction of each cell on it.

    A cell across the rim with its centre outside has the values at the rim.
    """

    radius_mm: Floats
    covered: Floats
    key: tuple[bytes, bytes]


def _points(axis: Floats, edge: float) -> _Points:
    ones = np.ones(2)
    disc = PressField(
        radius_mm=np.array([0.0, edge]), face_displacement_mm=ones, pressure_kpa=ones, approach_mm=0.0, force_n=0.0
    )
    covered = disc.on_grid(axis, axis).pressure_kpa
    x, y = np.meshgrid(axis, axis)
    radius = np.hypot(x, y)
    # The mesh's curved triangles end just inside the rim.
    inwards = np.minimum(1.0, (1 - OFF_RIM) * edge / np.maximum(radius, OFF_RIM * edge))[covered > 0]
    key = ((inwards * x[covered > 0]).tobytes(), (inwards * y[covered > 0]).tobytes())
    return _Points(radius_mm=radius, covered=covered, key=key)


def _change(
    probe: Probe,
    phantom: Phantom,
    points: tuple[bytes, bytes],
    resolution: SolidResolution,
    threads: int,
    progress: Callable[[str], None] | None,
) -> FaceChange:
    """Change by the inclusions at 1 mN, cached because the result is linear in the force."""
    key = (probe, phantom, points, resolution)
    if key not in _CACHE:
        while len(_CACHE) >= MOST_CACHED:
            _CACHE.pop(next(iter(_CACHE)))
        ng = import_extra("ngsolve", feature=FEATURE, extra="fem3d")
        report = progress or (lambda _: None)
        report("meshing")
        ng.SetNumThreads(threads)
        with ng.TaskManager():
            solid = TiedSolid(probe, phantom, symmetry_of(phantom.inclusions), resolution)
            x, y = (np.frombuffer(point) for point in points)
            _CACHE[key] = solid.change(x, y, report)
    return _CACHE[key]


def _added(reference: PressMap, points: _Points, change: FaceChange) -> PressMap:
    """The sum of the reference press and the change by the inclusions."""
    force_mn = reference.force_n * MN_PER_N
    displacement, pressure = np.zeros_like(points.covered), np.zeros_like(points.covered)
    at = points.covered > 0
    displacement[at] = force_mn * change.face_displacement_mm
    pressure[at] = force_mn * change.pressure_kpa
    return replace(
        reference,
        face_displacement_mm=reference.face_displacement_mm + displacement * (reference.face_displacement_mm != 0),
        pressure_kpa=reference.pressure_kpa + pressure * points.covered,
        approach_mm=reference.approach_mm + force_mn * change.approach_mm,
    )


def _check_inside(probe: Probe, phantom: Phantom) -> None:
    extent = FARTHEST * outer_radius_mm(probe, phantom.thickness_mm)
    for inclusion in phantom.inclusions:
        gap = THINNEST_GAP * 2 * min(inclusion.half_axes_mm)
        if inclusion.depth_mm < gap:
            raise InputError(
                f"depth_mm must be at least {gap:g} under the skin for this size; got {inclusion.depth_mm:g}"
            )
        below = phantom.thickness_mm - inclusion.bottom_mm
        if below < gap:
            raise InputError(
                f"depth_mm must leave {gap:g} mm between inclusion and chest wall for this size; got {below:g}"
            )
        away = float(np.hypot(*inclusion.offset_mm)) + max(inclusion.half_axes_mm[:2])
        if away > extent:
            raise InputError(
                f"offset_mm must place the inclusion within {extent:g} mm of the axis, inside the meshed slab; "
                f"got {away:g}"
            )


def _check_model(probe: Probe, phantom: Phantom, result: PressMap, inner: Booleans) -> None:
    problem = strain_problem(result.approach_mm, probe, phantom.thickness_mm)
    if problem is not None:
        raise MechanicsError(f"{problem}: choose a smaller force_n or stiffer tissue")
    mean = result.force_n * MN_PER_N / (np.pi * probe.radius_mm**2)
    least = float(result.pressure_kpa[inner].min())
    if least < -PULLING * mean:
        raise MechanicsError(
            f"the contact would open: tissue would pull with {-least:.2g} kPa at a mean pressure of {mean:.2g} kPa; "
            "choose inclusions that are deeper or not so soft"
        )
