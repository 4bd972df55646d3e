"""What finite strain does to a lump beside the axis: neo-Hookean presses of the flat probe in three dimensions.

    python -m benchmarks.mapping.finite_solid --out FOLDER     # half an hour; needs NGSolve (fem3d)

Probe and slab are one half model, second order. Their skins move alike vertically and slide on each other; the face is
sharp and whole in contact. Its pressure, at the places to which the skin has moved, is averaged over rings of 3 mm,
harmonic by harmonic. The changes by a lump at three distances from the axis are compared with the map's kernel at small
and at finite strain, as norms over the change at small strain. The kernel's tables have a rounded rim, whose part, that
of the lightest press, is left out. The mesh errs by some 10 %, at both strains alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from benchmarks.harness import Bench

import tsis
from tsis.mechanics.lump_kernel import LumpKernel, finite_strain_kernel, lump_kernel
from tsis.mechanics.surrogate.correction_building import build_finite_correction
from tsis.mechanics.surrogate.finite_correction import wide_box

PROBE = tsis.load_probe("tsis-2011")
YOUNG_KPA, POISSON, THICK_MM, SLAB_MM = 5.0, 0.49, 30.0, 50.0
DISTANCES_MM = (0.0, 9.0, -13.0)  # which do not touch one another
RINGS_MM, WIDTH_MM = (0.0, 3.0, 6.0, 9.0), 3.0
TESTS = [(order, ring) for order in range(4) for ring in RINGS_MM if ring or not order]
STEP_N, LIGHT_N = 0.125, 1e-3
GLASS_KPA = 1e5
ROUNDS, TOLERANCE = 14, 1e-7


class Solid:
    """Half of the probe on half of the slab, with lumps whose contrast is switched on one by one."""

    def __init__(self, top_mm: float, diameter_mm: float, contrast: float, near_mm: float) -> None:
        import ngsolve as ng

        ng.SetNumThreads(1)
        self._ng, self.contrast = ng, contrast
        self.mesh = _mesh(top_mm, diameter_mm, near_mm)
        slab = "|".join(["far", "near", *(f"lump{n}" for n in range(len(DISTANCES_MM)))])
        gel = "|".join(f"gel{n}" for n in range(len(PROBE.layers)))
        one, other = self.mesh.Materials(slab), self.mesh.Materials(gel)
        self.vertical = ng.H1(self.mesh, order=2, dirichlet="wall")
        self.space = ng.FESpace(
            [
                self.vertical,
                ng.H1(self.mesh, order=2, dirichlet="wall", definedon=one),
                ng.H1(self.mesh, order=2, dirichlet="wall|mirror", definedon=one),
                ng.H1(self.mesh, order=2, dirichlet="glass", definedon=other),
                ng.H1(self.mesh, order=2, dirichlet="glass|mirror", definedon=other),
            ]
        )
        z, slab_x, slab_y, gel_x, gel_y = self.space.TrialFunction()
        self.stiff = [ng.Parameter(1.0) for _ in DISTANCES_MM]
        self.force_n = ng.Parameter(0.0)
        moduli = {"far": YOUNG_KPA, "near": YOUNG_KPA, "plate": 1.0}
        moduli |= {f"lump{n}": YOUNG_KPA * factor for n, factor in enumerate(self.stiff)}
        moduli |= {f"gel{n}": layer.young_kpa for n, layer in enumerate(PROBE.layers)}
        young = self.mesh.MaterialCF(moduli)

        def stored(x: Any, y: Any, part: Any) -> Any:
            rows = [
                *(ng.grad(x)[i] for i in range(3)),
                *(ng.grad(y)[i] for i in range(3)),
                *(ng.grad(z)[i] for i in range(3)),
            ]
            gradient = ng.Id(3) + ng.CF(tuple(rows), dims=(3, 3))
            shear = young / 2 / (1 + POISSON)
            lame, log = young * POISSON / (1 + POISSON) / (1 - 2 * POISSON), ng.log(ng.Det(gradient))
            density = shear / 2 * (ng.Trace(gradient.trans * gradient) - 3 - 2 * log) + lame / 2 * log**2
            return ng.Variation((density * ng.dx(definedon=part, bonus_intorder=2)).Compile())

        self.energy = ng.BilinearForm(self.space, symmetric=True, condense=True)
        self.energy += stored(slab_x, slab_y, one)
        self.energy += stored(gel_x, gel_y, other)
        self.energy += ng.Variation(GLASS_KPA * ng.InnerProduct(ng.grad(z), ng.grad(z)) * ng.dx("plate"))
        area = np.pi * PROBE.radius_mm**2
        self.energy += ng.Variation(self.force_n * 1000.0 / area * z * ng.ds("top"))
        self.of_slab = ng.BilinearForm(self.space, symmetric=True)
        self.of_slab += stored(slab_x, slab_y, one)

    def linear(self) -> Any:
        """Means of the pressure per newton at small strain."""
        state = self._ng.GridFunction(self.space)
        self.force_n.Set(LIGHT_N)
        step, _ = self._step(state)
        self.of_slab.AssembleLinearization(state.vec)
        forces = state.vec.CreateVector()
        forces.data = self.of_slab.mat * step
        return self._means(state, forces) / LIGHT_N

    def _step(self, state: Any) -> tuple[Any, float]:
        """Newton's step, to be subtracted, and its decrement."""
        energy = self.energy
        energy.AssembleLinearization(state.vec)
        rest, step = state.vec.CreateVector(), state.vec.CreateVector()
        energy.Apply(state.vec, rest)
        inverse = energy.mat.Inverse(self.space.FreeDofs(coupling=True), inverse="sparsecholesky")
        rest.data += energy.harmonic_extension_trans * rest
        step.data = inverse * rest
        step.data += energy.harmonic_extension * step
        step.data += energy.inner_solve * rest
        return step, abs(float(self._ng.InnerProduct(step, rest)))

    def settle(self, state: Any) -> None:
        """Newton's method with shorter steps where the energy grows."""
        for _ in range(ROUNDS):
            before = self.energy.Energy(state.vec)
            step, decrement = self._step(state)
            start, part = state.vec.CreateVector(), 1.0
            start.data = state.vec
            while True:
                state.vec.data = start - part * step
                after = self.energy.Energy(state.vec)
                if part < 1e-3 or (np.isfinite(after) and after <= before + 1e-9 * abs(before) + 1e-9):
                    break
                part /= 2
            if part == 1.0 and decrement < TOLERANCE * max(abs(before), 1e-9):
                return
        raise RuntimeError("the press does not converge")

    def read(self, state: Any) -> Any:
        """Means of the pressure in kPa."""
        forces = state.vec.CreateVector()
        self.of_slab.Apply(state.vec, forces)
        return -self._means(state, forces)

    def _means(self, state: Any, forces: Any) -> Any:
        """Forces of the slab on the face, averaged over `TESTS` at the places to which the skin has moved."""
        ng = self._ng
        x = ng.x + state.components[1] - state.components[3]
        y = ng.y + state.components[2] - state.components[4]
        weight, means = ng.GridFunction(self.space), []
        for order, ring in TESTS:
            hat = _hat(ng, ng.sqrt(x**2 + y**2), ring)
            weight.vec[:] = 0
            weight.components[0].Set(hat * ng.cos(order * ng.atan2(y, x)), definedon=self.mesh.Boundaries("face"))
            whole = ng.Integrate(_hat(ng, ng.sqrt(ng.x**2 + ng.y**2), ring) * ng.ds("face"), self.mesh)
            means.append(ng.InnerProduct(forces, weight.vec) / whole)
        return np.array(means)


def _hat(ng: Any, radius: Any, ring: float) -> Any:
    share = 1 - ng.sqrt((radius - ring) ** 2) / WIDTH_MM
    return ng.IfPos(share, share, 0)


def _mesh(top_mm: float, diameter_mm: float, near_mm: float) -> Any:
    import ngsolve as ng
    from netgen import occ

    radius = PROBE.radius_mm
    half = occ.Box(occ.Pnt(-100, 0, -100), occ.Pnt(100, 100, 100))
    slab = occ.Cylinder(occ.Pnt(0, 0, -THICK_MM), occ.Z, SLAB_MM, THICK_MM)
    near = occ.Cylinder(occ.Pnt(0, 0, -16), occ.Z, radius + 5, 16)
    parts: list[tuple[str, Any, float]] = []
    for number, x in enumerate(DISTANCES_MM):
        sphere = occ.Sphere(occ.Pnt(x, 0, -(top_mm + diameter_mm / 2)), diameter_mm / 2)
        slab, near = slab - sphere, near - sphere
        parts.append((f"lump{number}", sphere, 0.45 * diameter_mm))
    parts += [("far", slab - near, 9.0), ("near", near * slab, near_mm)]
    height = 0.0
    for number, layer in enumerate(PROBE.layers):
        parts.append((f"gel{number}", occ.Cylinder(occ.Pnt(0, 0, height), occ.Z, radius, layer.thickness_mm), 3.5))
        height += layer.thickness_mm
    parts.append(("plate", occ.Cylinder(occ.Pnt(0, 0, height), occ.Z, radius, 3.0), 6.0))
    solids = []
    for name, whole, largest in parts:
        solid = whole * half
        solid.mat(name)
        solid.maxh = largest
        solids.append(solid)
    glued = occ.Glue(solids)
    for face in glued.faces:
        low, high = face.bounding_box
        levels = {"wall": -THICK_MM, "glass": height, "top": height + 3.0}
        name = next((key for key, z in levels.items() if max(abs(low[2] - z), abs(high[2] - z)) < 1e-3), "other")
        if max(abs(low[1]), abs(high[1])) < 1e-3:
            name = "mirror"
        elif max(abs(low[2]), abs(high[2])) < 1e-3 and max(-low[0], high[0]) < radius + 0.01:
            name = "face"
        face.name = name
    for edge in glued.edges:
        low, high = edge.bounding_box
        if max(abs(low[2]), abs(high[2])) < 1e-3 and abs(max(-low[0], high[0]) - radius) < 0.1:
            edge.maxh = 1.2
    mesh = ng.Mesh(occ.OCCGeometry(glued).GenerateMesh(maxh=9.0, grading=0.5))
    mesh.Curve(2)
    return mesh


def by_kernel(
    kernel: LumpKernel, distance_mm: float, top_mm: float, diameter_mm: float, contrast: float, force_n: float
) -> Any:
    """The same means by a kernel, per newton."""
    profiles = kernel.response(
        distance_mm=abs(distance_mm),
        centre_mm=top_mm + diameter_mm / 2,
        diameter_mm=diameter_mm,
        contrast=contrast,
        force_n=force_n,
    )
    radius, means = np.linspace(0.0, PROBE.radius_mm, 2401), []
    for order, ring in TESTS:
        weight = np.clip(1 - np.abs(radius - ring) / WIDTH_MM, 0.0, None) * radius
        side = np.sign(distance_mm) ** order if distance_mm else 1.0
        value = np.interp(radius, kernel.radius_mm, profiles[order])
        means.append(side * (value * weight).sum() / weight.sum() / (2.0 if order else 1.0))
    return np.array(means) / force_n


def compared(top_mm: float, diameter_mm: float, contrast: float, near_mm: float, forces_n: list[float]) -> Any:
    """Rows of the table."""
    import ngsolve as ng

    small = lump_kernel(PROBE)
    finite = finite_strain_kernel(
        small, PROBE, build_finite_correction(PROBE, ranges=wide_box(PROBE)), young_kpa=YOUNG_KPA
    )
    lump = (top_mm, diameter_mm, contrast)
    solid = Solid(*lump, near_mm)
    plain, linear = solid.linear(), []
    for factor in solid.stiff:
        factor.Set(contrast)
        linear.append(solid.linear() - plain)
        factor.Set(1.0)
    state, force = ng.GridFunction(solid.space), 0.0
    for target in forces_n:
        while force < target - 1e-9:
            force = min(force + STEP_N, target)
            solid.force_n.Set(force)
            solid.settle(state)
        plain, kept = solid.read(state), state.vec.CreateVector()
        kept.data = state.vec
        for factor, distance, before in zip(solid.stiff, DISTANCES_MM, linear, strict=True):
            factor.Set(contrast)
            solid.settle(state)
            change = (solid.read(state) - plain) / target - before
            factor.Set(1.0)
            state.vec.data = kept
            light = by_kernel(finite, distance, *lump, float(finite.force_n[0]))
            told = by_kernel(finite, distance, *lump, target) - light
            mesh = before - by_kernel(small, distance, *lump, 1.0)
            size = np.linalg.norm(before)
            yield (
                f"{target:g}",
                f"{distance:g}",
                *(f"{100 * np.linalg.norm(one) / size:.0f}" for one in (change, change - told, mesh)),
            )


HEADS = (
    "force, N",
    "distance, mm",
    "change by finite strain, %",
    "left by the correction, %",
    "error at small strain, %",
)

if __name__ == "__main__":
    bench = Bench(__doc__, top=5.0, diameter=8.0, contrast=6.0, near=3.0, forces=[0.375, 0.75])
    bench.table(
        "A lump beside the axis in three dimensions",
        HEADS,
        list(compared(bench.top, bench.diameter, bench.contrast, bench.near, bench.forces)),
    )
    raise SystemExit(bench.end([]))
