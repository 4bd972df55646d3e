"""Presses in three dimensions: inclusions off the axis, ellipsoids, several at once (extra ``fem3d``).

A press is the sum of the axisymmetric reference press and the change by the inclusions, which finite elements find.
Mirror planes through the probe's axis halve or quarter their mesh.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from tsis.errors import InputError, MechanicsError, import_extra
from tsis.mechanics.mesh import EDGE_FRACTION
from tsis.mechanics.small_strain.linear_press import small_strain_press, strain_problem
from tsis.model.phantom import Phantom
from tsis.model.press import MN_PER_N, PressField, PressMap
from tsis.model.probe import Probe
from tsis.model.require import require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.mechanics.mesh import Booleans, Floats
    from tsis.mechanics.small_strain.slab import Resolution
    from tsis.model.phantom import Inclusion


ROUNDING_MM = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Symmetry:
    """Mirror symmetry of a phantom in a frame rotated about the probe's axis."""

    angle: float  # angle of the frame's x axis from the phantom's, radians
    mirrors: str  # mirrored coordinates of the frame: ``""``, ``"y"`` (half model) or ``"xy"`` (quarter)

    @property
    def copies(self) -> int:
        """Number of modelled parts in the whole: 1, 2 or 4."""
        return int(2 ** len(self.mirrors))

    def rotated(self, x_mm: Floats, y_mm: Floats) -> tuple[Floats, ...]:
        """Points of the phantom in the rotated frame."""
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        return cosine * x_mm + sine * y_mm, cosine * y_mm - sine * x_mm

    def folded(self, x_mm: Floats, y_mm: Floats) -> tuple[Floats, ...]:
        """The mirror images of the points in the modelled part."""
        x, y = self.rotated(x_mm, y_mm)
        return np.abs(x) if "x" in self.mirrors else x, np.abs(y) if "y" in self.mirrors else y


def symmetry_of(inclusions: tuple[Inclusion, ...]) -> Symmetry:
    """The symmetry with the smallest modelled part.

    Ellipsoids lie along the phantom's axes, so the frame's angle is free only with equal horizontal semi-axes.
    """
    free = all(_is_round(inclusion) for inclusion in inclusions)
    away = [inclusion for inclusion in inclusions if np.hypot(*inclusion.offset_mm) > ROUNDING_MM]
    angles = [0.0, np.pi / 2]
    if free and away:
        x, y = away[0].offset_mm
        angles = [float(np.arctan2(y, x))]
    for angle in angles:
        frame = Symmetry(angle=angle, mirrors="")
        offsets = [frame.rotated(*np.array(inclusion.offset_mm)) for inclusion in inclusions]
        positions = np.array(offsets).reshape(-1, 2)
        if np.abs(positions[:, 1:]).max(initial=0.0) <= ROUNDING_MM:
            on_axis = np.abs(positions).max(initial=0.0) <= ROUNDING_MM
            return Symmetry(angle=angle, mirrors="xy" if on_axis else "y")
    return Symmetry(angle=0.0, mirrors="")


def _is_round(inclusion: Inclusion) -> bool:
    x, y, _ = inclusion.half_axes_mm
    return x == y


FEATURE = "a press in three dimensions (inclusions off the axis, ellipsoids, several at once)"
SAME = 1e-6  # of the face's radius: coordinates closer than this are equal


@dataclass(frozen=True, slots=True, kw_only=True)
class SolidResolution:
    """Mesh density of a press in three dimensions.

    Parameters
    ----------
    order
        Polynomial order of the elements; order 2 locks in nearly incompressible material.
    face
        Largest triangle on the contact face as a fraction of its radius.
    rim
        The same along the rim, where the pressure is singular.
    inclusion
        Largest element of an inclusion as a fraction of its smallest diameter.
    growth
        Growth of elements away from small ones, in (0, 1].
    """

    order: int = 3
    face: float = 0.1
    rim: float = 0.08
    inclusion: float = 0.3
    growth: float = 0.5


def outer_radius_mm(probe: Probe, thickness_mm: float) -> float:
    """Outer radius of the slab: the influence of the face has decayed there."""
    return max(10 * probe.radius_mm, 4 * thickness_mm)


def layer_name(index: int) -> str:
    """Name of the probe's layer, counted from the tissue up."""
    return f"layer{index}"


def inclusion_name(index: int) -> str:
    """Name of an inclusion."""
    return f"inclusion{index}"


def solid_mesh(probe: Probe, phantom: Phantom, symmetry: Symmetry, resolution: SolidResolution) -> Any:
    """Mesh the modelled part of probe and slab.

    The skin lies at z = 0 and the glass above. Regions: ``tissue``, ``inclusion0`` ..., ``layer0`` ... from the tissue
    up; boundaries: ``face``, ``glass``, ``side`` (of the probe), ``wall``, ``mirror_x``, ``mirror_y``.
    """
    occ = import_extra("netgen.occ", feature=FEATURE, extra="fem3d")
    whole = occ.Glue([*_slab(occ, probe, phantom, symmetry, resolution), *_layers(occ, probe)])
    part = _cut(occ, whole, probe, phantom, symmetry)
    _name_faces(part, probe, phantom, resolution, symmetry)
    meshing = import_extra("netgen.meshing", feature=FEATURE, extra="fem3d")
    meshing.SetMessageImportance(0)  # it prints on the terminal
    try:
        generated = occ.OCCGeometry(part).GenerateMesh(maxh=phantom.thickness_mm, grading=resolution.growth)
    except meshing.NgException as error:
        raise MechanicsError(
            f"the phantom cannot be meshed at {resolution}; choose smaller elements or a smaller growth"
        ) from error
    mesh = import_extra("ngsolve", feature=FEATURE, extra="fem3d").Mesh(generated)
    mesh.Curve(resolution.order)
    return mesh


def _slab(occ: Any, probe: Probe, phantom: Phantom, symmetry: Symmetry, resolution: SolidResolution) -> list[Any]:
    thickness = phantom.thickness_mm
    tissue = occ.Cylinder(occ.Pnt(0, 0, -thickness), occ.Z, outer_radius_mm(probe, thickness), thickness)
    bodies = []
    for index, inclusion in enumerate(phantom.inclusions):
        body = _ellipsoid(occ, inclusion, symmetry)
        body.mat(inclusion_name(index))
        body.maxh = 2 * resolution.inclusion * min(inclusion.half_axes_mm)
        tissue = tissue - body
        bodies.append(body)
    tissue.mat("tissue")
    return [tissue, *bodies]


def _ellipsoid(occ: Any, inclusion: Inclusion, symmetry: Symmetry) -> Any:
    x, y = (float(value) for value in symmetry.rotated(*np.array(inclusion.offset_mm)))
    centre = occ.Pnt(x, y, -inclusion.centre_depth_mm)
    half_x, half_y, half_z = inclusion.half_axes_mm
    if half_x == half_y == half_z:
        return occ.Sphere(centre, half_z)
    along = occ.Vec(np.cos(symmetry.angle), -np.sin(symmetry.angle), 0)  # the phantom's x axis in the rotated frame
    return occ.Ellipsoid(occ.Axes(centre, n=occ.Z, h=along), half_z, half_x, half_y)  # along n, along h, across both


def _layers(occ: Any, probe: Probe) -> list[Any]:
    layers, height = [], 0.0
    for index, layer in enumerate(probe.layers):
        body = occ.Cylinder(occ.Pnt(0, 0, height), occ.Z, probe.radius_mm, layer.thickness_mm)
        body.mat(layer_name(index))
        layers.append(body)
        height += layer.thickness_mm
    return layers


def _cut(occ: Any, whole: Any, probe: Probe, phantom: Phantom, symmetry: Symmetry) -> Any:
    if not symmetry.mirrors:
        return whole
    far = 2 * outer_radius_mm(probe, phantom.thickness_mm)
    low = (0 if "x" in symmetry.mirrors else -far, 0, -2 * phantom.thickness_mm)
    return whole * occ.Box(occ.Pnt(*low), occ.Pnt(far, far, 2 * probe.thickness_mm))


def _name_faces(part: Any, probe: Probe, phantom: Phantom, resolution: SolidResolution, symmetry: Symmetry) -> None:
    """Name the boundaries by their position, and set the mesh density of the face and its rim."""
    radius, close = probe.radius_mm, SAME * probe.radius_mm

    def flat(shape: Any, axis: int, level: float) -> bool:
        low, high = shape.bounding_box
        # Bounding boxes of curved shapes are a little too large; those of planes are not.
        return bool(abs(low[axis] - level) < close and abs(high[axis] - level) < close)

    def extent(shape: Any) -> float:
        low, high = shape.bounding_box
        return float(max(abs(low[0]), abs(high[0]), abs(low[1]), abs(high[1])))

    for face in part.faces:
        face.name = "inside"
        if flat(face, 2, -phantom.thickness_mm):
            face.name = "wall"
        elif flat(face, 2, probe.thickness_mm):
            face.name = "glass"
        elif flat(face, 2, 0.0):
            face.name = "skin"
            if extent(face) < 1.01 * radius:
                face.name, face.maxh = "face", resolution.face * radius
        elif "y" in symmetry.mirrors and flat(face, 1, 0.0):
            face.name = "mirror_y"
        elif "x" in symmetry.mirrors and flat(face, 0, 0.0):
            face.name = "mirror_x"
        elif _is_side(face, close) and extent(face) > 0.99 * radius:
            face.name = "side"
    for edge in part.edges:
        if flat(edge, 2, 0.0) and 0.99 * radius < extent(edge) < 1.01 * radius and abs(edge.center[1]) > close:
            edge.maxh = resolution.rim * radius


def _is_side(face: Any, close: float) -> bool:
    """Whether a face is vertical and beside a layer of the probe."""
    low, high = face.bounding_box
    return bool(low[2] > -close and high[2] - low[2] > close)


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
