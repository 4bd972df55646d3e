"""A domed probe pressed at small strain, by another code: the reference values behind the tests of domed contact.

    python benchmarks/domed_second_code.py            # how far tsis is from the stored values; needs only tsis
    python benchmarks/domed_second_code.py --compute  # solve again with NGSolve (the extra fem3d), store and compare

Axisymmetric triangles of fourth order, one mesh for both bodies with displacements of their own on either side of the
face; the dome is a map of the flat stack that shares its thinning among the layers. Contact is linearised: vertical gap
and vertical forces at equal radii, unilateral, by an energy of 1/(2 eps) on penetration with eps so small that it
changes nothing that is stored. The approach is an unknown, the force is given. What an inclusion changes is taken with
and without contrast on one mesh.
"""

from __future__ import annotations

import importlib
import json
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench

import tsis
from tsis.mechanics import press

if TYPE_CHECKING:
    from numpy.typing import NDArray

STORED = Path(__file__).parents[1] / "tests" / "mechanics" / "data" / "domed_second_code.json"
PROBE = tsis.load_probe("tsis-domed")
PLAIN = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0)
SPHERES = ((10.0, 5.0, 100.0), (13.0, 5.0, 40.0))  # diameter_mm, depth_mm, young_kpa
FORCES_N = (0.2, 0.5, 1.0)  # at 0.2 N the contact ends inside the face
RADIUS_MM = np.arange(0.0, 11.51, 0.5)
HAT_MM = 0.25  # pressures are means with the weight max(0, 1 - |r' - r| / HAT_MM) r'
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
    """One press at `RADIUS_MM`."""

    approach_mm: float
    contact_radius_mm: float
    displacement_mm: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]


def lame(young_kpa: float, poisson: float) -> tuple[float, float]:
    return young_kpa * poisson / (1 + poisson) / (1 - 2 * poisson), young_kpa / 2 / (1 + poisson)


def meshed(diameter_mm: float, depth_mm: float, fine: Fineness) -> Any:
    """Mesh both bodies, the probe flat; they share the lines of the face."""
    ng, occ = importlib.import_module("ngsolve"), importlib.import_module("netgen.occ")
    slab = occ.Rectangle(CUT_MM, PLAIN.thickness_mm).Face().Move(occ.Vec(0, -PLAIN.thickness_mm, 0))
    half = diameter_mm / 2
    box = occ.Rectangle(half, diameter_mm).Face().Move(occ.Vec(0, -depth_mm - diameter_mm, 0))
    ball = occ.Circle(occ.Pnt(0, -depth_mm - half), half).Face() * box
    slab = slab - ball
    slab.name, ball.name, ball.maxh = "slab", "ball", fine.sphere
    bodies, height = [slab, ball], 0.0
    for index, layer in enumerate(PROBE.layers):
        body = occ.Rectangle(PROBE.radius_mm, layer.thickness_mm).Face().Move(occ.Vec(0, height, 0))
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
        elif on(levels[1], -PLAIN.thickness_mm):
            edge.name = "wall"
        elif on(levels[1], PROBE.thickness_mm):
            edge.name = "glass"
        elif on(levels[1], 0.0) and high[0] < 1.001 * PROBE.radius_mm:
            edge.name, edge.maxh = "face", fine.face
    for vertex in whole.vertices:
        if np.hypot(vertex.p.x - PROBE.radius_mm, vertex.p.y) < 1e-6:
            vertex.maxh = fine.rim
    mesh = ng.Mesh(occ.OCCGeometry(whole, dim=2).GenerateMesh(maxh=12.0, grading=0.3))
    mesh.Curve(5)
    return mesh


class SecondCode:
    """The two bodies around one sphere, which may be made of tissue."""

    def __init__(self, diameter_mm: float, depth_mm: float, fine: Fineness) -> None:
        self.ng = ng = importlib.import_module("ngsolve")
        self.fine = fine
        self.mesh = mesh = meshed(diameter_mm, depth_mm, fine)
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
        curvature = PROBE.face_curvature_mm or np.inf
        root = ng.sqrt(curvature**2 - ng.x**2)
        self.sag, self.slope = ng.x**2 / (curvature + root), ng.x / root

    def energy(self, young_kpa: float, force_mn: float) -> Any:
        """Strain energy, contact and the load's potential."""
        ng, mesh, thick = self.ng, self.mesh, PROBE.thickness_mm
        probe_r, probe_z, slab_r, slab_z, approach = self.space.TrialFunction()
        material = {f"layer{index}": lame(layer.young_kpa, layer.poisson) for index, layer in enumerate(PROBE.layers)}
        material |= {"slab": lame(PLAIN.young_kpa, PLAIN.poisson), "ball": lame(young_kpa, PLAIN.poisson)}
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

    def read(self, found: Any) -> Reading:
        """What happens on the face."""
        ng = self.ng
        probe_z, slab_z, approach = found.components[1], found.components[3], float(found.components[4].vec[0])
        gap = self.sag + probe_z - slab_z - approach
        pressure = ng.IfPos(-gap, -gap / self.fine.softness, 0)

        def over_face(what: Any) -> float:
            return float(ng.Integrate(what * ng.ds("face", bonus_intorder=12), self.mesh))

        means = []
        for radius in RADIUS_MM:
            away = ng.sqrt((ng.x - radius) ** 2)
            hat = ng.IfPos(HAT_MM - away, 1 - away / HAT_MM, 0) * ng.x
            means.append(over_face(pressure * hat) / over_face(hat))
        inside = np.maximum(RADIUS_MM, TOUCH_MM)
        near, far = (
            np.array([probe_z(self.mesh(radius, height)) for radius in inside]) for height in (TOUCH_MM, 2 * TOUCH_MM)
        )
        return Reading(
            approach_mm=approach,
            contact_radius_mm=over_face(ng.IfPos(-gap, 1, 0)),
            displacement_mm=2 * near - far,
            pressure_kpa=np.array(means),
        )


def computed(fine: Fineness, forces_n: tuple[float, ...] = FORCES_N) -> list[dict[str, Any]]:
    """All cases, each with its plain press on the same mesh."""
    cases = []
    for diameter, depth, young in SPHERES:
        code = SecondCode(diameter, depth, fine)
        for force in forces_n:
            bare = code.press(PLAIN.young_kpa, 1000 * force)
            plain, full = code.read(bare), code.read(code.press(young, 1000 * force, bare))
            cases.append(
                {
                    "diameter_mm": diameter,
                    "depth_mm": depth,
                    "young_kpa": young,
                    "force_n": force,
                    "plain_approach_mm": plain.approach_mm,
                    "approach_mm": full.approach_mm,
                    "plain_contact_radius_mm": plain.contact_radius_mm,
                    "contact_radius_mm": full.contact_radius_mm,
                    "plain_w_mm": plain.displacement_mm.tolist(),
                    "plain_p_kpa": plain.pressure_kpa.tolist(),
                    "dw_mm": (full.displacement_mm - plain.displacement_mm).tolist(),
                    "dp_kpa": (full.pressure_kpa - plain.pressure_kpa).tolist(),
                    "unknowns": code.space.ndof,
                }
            )
            print(f"d {diameter:g} h {depth:g} E {young:g} at {force:g} N: {code.space.ndof} unknowns", flush=True)
    return cases


def kernel(case: dict[str, Any]) -> dict[str, Any]:
    """The same case by `tsis.mechanics.press`."""
    sphere = tsis.Inclusion(**{name: case[name] for name in ("diameter_mm", "depth_mm", "young_kpa")})
    plain, full = (
        press(PROBE, phantom, force_n=case["force_n"]) for phantom in (PLAIN, replace(PLAIN, inclusion=sphere))
    )
    radius = plain.radius_mm
    hats = np.maximum(0.0, 1 - np.abs(radius - RADIUS_MM[:, None]) / HAT_MM) * radius
    hats /= hats.sum(axis=1, keepdims=True)

    def at(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.interp(RADIUS_MM, radius, values))

    return {
        "plain_approach_mm": plain.approach_mm,
        "approach_mm": full.approach_mm,
        "plain_w_mm": at(plain.face_displacement_mm),
        "plain_p_kpa": hats @ plain.pressure_kpa,
        "dw_mm": at(full.face_displacement_mm - plain.face_displacement_mm),
        "dp_kpa": hats @ (full.pressure_kpa - plain.pressure_kpa),
    }


def deviations(found: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Largest deviation of every curve and value as a share of its largest value."""
    names = ("plain_approach_mm", "approach_mm", "plain_w_mm", "plain_p_kpa", "dw_mm", "dp_kpa")
    pairs = {name: (np.atleast_1d(found[name]), np.atleast_1d(reference[name])) for name in names}
    return {name: float(np.abs(one - other).max() / np.abs(other).max()) for name, (one, other) in pairs.items()}


def main() -> int:
    """Print the deviations from the stored contacts, computed anew with ``--compute`` (minutes)."""
    bench = Bench(__doc__, compute=False)
    stored: dict[str, Any] = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    if bench.compute:
        importlib.import_module("netgen.meshing").SetMessageImportance(0)
        cases = computed(Fineness())
        coarse = computed(Fineness(face=0.25, rim=0.05, sphere=1.0, layer=1.7, softness=2e-4))
        apart = [deviations(one, other) for one, other in zip(coarse, cases, strict=True)]
        meta = {
            "code": f"NGSolve {importlib.import_module('ngsolve').__version__}, benchmarks/domed_second_code.py",
            "radius_mm": RADIUS_MM.tolist(),
            "pressures": f"means with the weight max(0, 1 - |r' - r| / {HAT_MM}) r'",
            "coarser_mesh_and_softer_contact_differ_by": [
                {name: float(f"{value:.2g}") for name, value in one.items()} for one in apart
            ],
        }
        stored |= {"small_strain": {"meta": meta, "cases": [rounded(case) for case in cases]}}
        STORED.parent.mkdir(exist_ok=True)
        STORED.write_text(json.dumps(stored) + "\n", encoding="utf-8")
    cases = stored["small_strain"]["cases"]
    heads = ("d, h, E", "F (N)", "approach plain", "with", "w plain", "p plain", "dw", "dp")
    rows = [
        (
            f"{case['diameter_mm']:g}, {case['depth_mm']:g}, {case['young_kpa']:g}",
            f"{case['force_n']:g}",
            *(f"{100 * value:.3f}" for value in deviations(kernel(case), case).values()),
        )
        for case in cases
    ]
    bench.table("tsis against the stored values, largest deviation over the largest value, %", heads, rows)
    return bench.end()


def rounded(case: dict[str, Any]) -> dict[str, Any]:
    """Seven digits: more than is meant, little to read."""

    def short(value: Any) -> Any:
        return [short(one) for one in value] if isinstance(value, list) else float(f"{value:.7g}")

    return {name: short(value) for name, value in case.items()}


if __name__ == "__main__":
    sys.exit(main())
