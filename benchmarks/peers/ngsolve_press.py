"""The axisymmetric press with NGSolve: triangles of order 4, the normal displacement shared, the radial one not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.model.phantom import Inclusion, Phantom
    from tsis.model.probe import Probe

ORDER = 4


@dataclass(frozen=True, kw_only=True)
class Pressed:
    """Displacement of the face relative to the glass per newton, and the size of the system."""

    face_displacement_mm: NDArray[np.float64]
    unknowns: int


def change_of_face(probe: Probe, phantom: Phantom, radius_mm: NDArray[np.float64]) -> Pressed:
    """What the inclusion changes under 1 N, from solves with and without contrast on one mesh."""
    import ngsolve as ng

    assert phantom.inclusion is not None
    mesh = _mesh(probe, phantom, phantom.inclusion)
    space = ng.FESpace(
        [
            ng.H1(
                mesh,
                order=ORDER,
                dirichlet="glass|axis",
                definedon="|".join(f"layer{i}" for i in range(len(probe.layers))),
            ),
            ng.H1(mesh, order=ORDER, dirichlet="wall|axis", definedon="tissue|ball"),
            ng.H1(mesh, order=ORDER, dirichlet="glass|wall"),
        ]
    )
    found = [
        _solve(space, mesh, probe, phantom, young, radius_mm)
        for young in (phantom.inclusion.young_kpa, phantom.young_kpa)
    ]
    return Pressed(face_displacement_mm=found[0] - found[1], unknowns=space.ndof)


def _solve(
    space: Any, mesh: Any, probe: Probe, phantom: Phantom, ball_kpa: float, radius_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    import ngsolve as ng

    materials = {f"layer{i}": (layer.young_kpa, layer.poisson) for i, layer in enumerate(probe.layers)}
    materials |= {"tissue": (phantom.young_kpa, phantom.poisson), "ball": (ball_kpa, phantom.poisson)}
    lame = mesh.MaterialCF({k: e * nu / (1 + nu) / (1 - 2 * nu) for k, (e, nu) in materials.items()})
    shear = mesh.MaterialCF({k: e / 2 / (1 + nu) for k, (e, nu) in materials.items()})
    trial, test = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    for part, region in ((0, "layer.*"), (1, "tissue|ball")):
        one, other = (_strain(fields[part], fields[2]) for fields in (trial, test))
        trace = [sum(strain[:3]) for strain in (one, other)]
        density = lame * trace[0] * trace[1] + shear * one[3] * other[3]
        density += 2 * shear * sum(a * b for a, b in zip(one[:3], other[:3], strict=True))
        form += 2 * np.pi * ng.x * density * ng.dx(definedon=mesh.Materials(region))
    form.Assemble()
    moved = ng.GridFunction(space)
    moved.components[2].Set(1.0, definedon=mesh.Boundaries("glass"))
    load = form.mat.CreateColVector()
    load.data = -form.mat * moved.vec
    moved.vec.data += form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky") * load
    load.data = form.mat * moved.vec
    force = ng.InnerProduct(moved.vec, load)  # work of a travel of 1 mm, mN
    points = [mesh(max(r, 1e-6), 0.0) for r in radius_mm]
    face = np.array([moved.components[2](point) for point in points], dtype=float)
    return (1.0 - face) * 1000.0 / float(force)


def _strain(radial: Any, axial: Any) -> tuple[Any, Any, Any, Any]:
    import ngsolve as ng

    across, along = ng.grad(radial), ng.grad(axial)
    return across[0], along[1], radial / ng.x, across[1] + along[0]


def _mesh(probe: Probe, phantom: Phantom, inclusion: Inclusion) -> Any:
    import ngsolve as ng
    from netgen.occ import Circle, Glue, MoveTo, OCCGeometry, X, Y

    outer, faces = 120.0, []
    top = 0.0
    for index, layer in enumerate(probe.layers):
        face = MoveTo(0, top - layer.thickness_mm).Rectangle(probe.radius_mm, layer.thickness_mm).Face()
        face.faces.name = f"layer{index}"
        faces.append(face)
        top -= layer.thickness_mm
    half = MoveTo(0, 0).Rectangle(outer, phantom.thickness_mm).Face()
    ball = Circle((0, inclusion.centre_depth_mm), inclusion.diameter_mm / 2).Face() * half
    tissue = half - ball
    tissue.faces.name, ball.faces.name = "tissue", "ball"
    ball.faces.maxh = inclusion.diameter_mm / 4
    shape = Glue([*faces, tissue, ball])
    for edge in shape.edges:
        centre, box = edge.center, edge.bounding_box
        if box[1][0] < 1e-9:
            edge.name = "axis"
        elif abs(centre.y - top) < 1e-9:
            edge.name = "glass"
        elif abs(centre.y - phantom.thickness_mm) < 1e-9:
            edge.name = "wall"
    for vertex in shape.vertices:
        if abs(vertex.p[0] - probe.radius_mm) < 1e-9 and abs(vertex.p[1]) < 1e-9:
            vertex.maxh = 0.02
    del X, Y
    mesh = ng.Mesh(OCCGeometry(shape, dim=2).GenerateMesh(maxh=8.0, grading=0.3))
    return mesh.Curve(ORDER)
