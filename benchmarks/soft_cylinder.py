"""A soft cylinder on its side pressed into a bonded gel, by NGSolve in plane strain at finite strain.

    python -m benchmarks.soft_cylinder [--seed 900] [--states 19]

Both are neo-Hookean and touch without friction. The cylinder's equator moves as a plane and may widen, as between the
two equal fingers of a gripper. Used by `gel_hardness`; nothing is shared with `tsis.mechanics`. As a program it presses
cylinders of drawn states and fits the correction for large strain of `tsis.hardness`.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from benchmarks.harness import Bench
from netgen.geom2d import SplineGeometry

from tsis.mechanics.gel.contact import layer_contact

WIDE = 4.0  # gel thicknesses from the middle to the free side, at least
FINE, COARSE, ORDER = 0.03, 0.25, 2  # meshes over the cylinder's radius
PENALTY = 1000.0  # stiffness of the contact over the softer modulus by the radius
APPROACHES = (0.02, 0.05, 0.09, 0.14, 0.2, 0.26)  # of the fit: equator's travel over the radius
LEAST_FITTED = 0.2  # contact over the radius, below which the mesh errs as much as the layer
STEPS, MOST_HALVED, UPDATES, CLOSE = 4, 4, 25, 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """Force in N per mm of length, half the width of the Hertzian contact of that second moment, and the dent."""

    force_n_mm: float
    half_mm: float
    dent_mm: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Solid:
    """A neo-Hookean solid."""

    young_kpa: float
    poisson: float

    def energy(self, gradient: Any) -> Any:
        """Energy by volume in plane strain."""
        shear, bulk = self.young_kpa / 2 / (1 + self.poisson), self.young_kpa / 3 / (1 - 2 * self.poisson)
        plane = ng.Id(2) + gradient
        volume = ng.Det(plane)
        squared = ng.InnerProduct(plane, plane) + 1.0
        return shear / 2 * (squared * volume ** (-2.0 / 3.0) - 3.0) + bulk / 2 * (volume - 1.0) ** 2


def _mesh(radius: float, thickness: float) -> Any:
    """The right half of gel and cylinder, which touch in one point but share none."""
    wide, near, fine, coarse = WIDE * max(thickness, radius), 1.0 * radius, FINE * radius, COARSE * radius
    geometry = SplineGeometry()
    corners = [(0, -thickness), (wide, -thickness), (wide, 0), (near, 0), (0, 0)]
    points = [geometry.AppendPoint(*corner) for corner in corners]
    for number, (name, size) in enumerate(
        [("bottom", coarse), ("side", coarse), ("far", coarse), ("face", fine), ("axis", coarse)]
    ):
        geometry.Append(["line", points[number], points[(number + 1) % 5]], bc=name, maxh=size, leftdomain=1)
    gap = 1e-3 * radius
    low, turn, right, corner, middle = (
        geometry.AppendPoint(*place)
        for place in [
            (0, gap),
            (radius * np.tan(np.pi / 8), gap),
            (radius * np.sqrt(0.5), radius * (1 - np.sqrt(0.5)) + gap),
            (radius, radius * (1 - np.tan(np.pi / 8)) + gap),
            (radius, radius + gap),
        ]
    )
    top = geometry.AppendPoint(0, radius + gap)
    geometry.Append(["spline3", low, turn, right], bc="skin", maxh=fine, leftdomain=2)
    geometry.Append(["spline3", right, corner, middle], bc="free", maxh=coarse, leftdomain=2)
    geometry.Append(["line", middle, top], bc="equator", maxh=coarse, leftdomain=2)
    geometry.Append(["line", top, low], bc="axis", maxh=coarse, leftdomain=2)
    geometry.SetMaterial(1, "gel")
    geometry.SetMaterial(2, "cylinder")
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=coarse, grading=0.3))
    mesh.Curve(3)
    return mesh


def cylinder_presses(
    gel: Solid, cylinder: Solid, *, radius_mm: float, thickness_mm: float, approaches_mm: tuple[float, ...]
) -> list[Press]:
    """The presses at ascending approaches; fewer where the next does not converge."""
    mesh = _mesh(radius_mm, thickness_mm)
    space = ng.VectorH1(mesh, order=ORDER, dirichletx="bottom|axis", dirichlety="bottom|equator")
    moved = space.TrialFunction()
    elastic, form = ng.BilinearForm(space, symmetric=True), ng.BilinearForm(space, symmetric=True)
    for name, solid in (("gel", gel), ("cylinder", cylinder)):
        energy = ng.Variation(solid.energy(ng.Grad(moved)).Compile() * ng.dx(definedon=mesh.Materials(name)))
        elastic += energy
        form += energy
    contact = ng.ContactBoundary(mesh.Boundaries("skin"), mesh.Boundaries("face"))
    place = ng.CoefficientFunction((ng.x, ng.y))
    inside = (place + moved - place.Other() - moved.Other()) * contact.normal
    stiffness = PENALTY * min(gel.young_kpa, cylinder.young_kpa) / radius_mm
    contact.AddEnergy(ng.IfPos(inside, 0.5 * stiffness * inside * inside, ng.CoefficientFunction(0.0)))
    solution, results, before = ng.GridFunction(space), list[Press](), 0.0
    lift = ng.GridFunction(space)
    lift.Set(ng.CoefficientFunction((0.0, -1.0)), definedon=mesh.Boundaries("equator"))
    for approach in approaches_mm:
        try:
            for step in range(STEPS):
                travel = (approach - before) / STEPS
                _moved(form, contact, solution, lift, (before + step * travel, travel), 0.3 * radius_mm)
        except RuntimeError:
            if not results:
                raise
            break
        before = approach
        results.append(_read(mesh, elastic, solution, space, lift))
    return results


def _moved(
    form: Any, contact: Any, solution: Any, lift: Any, travel: tuple[float, float], reach: float, halved: int = 0
) -> None:
    """The press after the equator's travel, from and by so many mm, in smaller steps where one does not converge.

    All but the first step start from the last state, stretched to the new travel.
    """
    done, step = travel
    start = solution.vec.CreateVector()
    start.data = solution.vec
    solution.vec.data = (1.0 + step / done) * start if done > 0 else start + step * lift.vec
    try:
        _balance(form, contact, solution, solution.space, reach)
    except RuntimeError:
        if halved == MOST_HALVED:
            raise
        solution.vec.data = start
        for part in (0.0, 0.5):
            _moved(form, contact, solution, lift, (done + part * step, step / 2), reach, halved + 1)


def _balance(form: Any, contact: Any, solution: Any, space: Any, reach: float) -> None:
    """Newton's method; the pairs of the contact are sought anew at each step."""
    residual, step = solution.vec.CreateVector(), solution.vec.CreateVector()
    scale = None
    for _ in range(UPDATES):
        contact.Update(solution, form, 8, reach)
        form.Apply(solution.vec, residual)
        form.AssembleLinearization(solution.vec)
        step.data = form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky") * residual
        size = float(ng.Norm(step))
        if not np.isfinite(size):
            break
        scale = size if scale is None else scale
        solution.vec.data -= step
        if size < CLOSE * max(scale, float(ng.Norm(solution.vec))):
            return
    raise RuntimeError("the press does not converge")


def _read(mesh: Any, elastic: Any, solution: Any, space: Any, lift: Any) -> Press:
    inner, weight = solution.vec.CreateVector(), ng.GridFunction(space)
    elastic.Apply(solution.vec, inner)
    force = 2.0 * float(ng.InnerProduct(inner, lift.vec))
    along = ng.x + solution.components[0]
    moments = []
    for power in (0, 2):
        weight.Set(ng.CoefficientFunction((0.0, along**power)), definedon=mesh.Boundaries("face"))
        moments.append(float(ng.InnerProduct(inner, weight.vec)))
    dent = -float(solution.components[1](mesh(1e-9, 0.0)))
    return Press(force_n_mm=force / 1e3, half_mm=2.0 * float(np.sqrt(moments[1] / moments[0])), dent_mm=dent)


def against_layer(gel: Solid, cylinder: Solid, radius: float, thickness: float) -> list[list[float]]:
    """Terms of the correction, and logarithms of force and dent over those of the layer at small strain, by press."""
    compliance = [(1 - solid.poisson**2) / solid.young_kpa for solid in (cylinder, gel)]
    soft, rows = compliance[0] / sum(compliance), []
    approaches = tuple(share * radius for share in APPROACHES)
    for press in cylinder_presses(gel, cylinder, radius_mm=radius, thickness_mm=thickness, approaches_mm=approaches):
        small = layer_contact(
            press.half_mm, body="cylinder", radius_mm=radius, body_compliance=compliance[0],
            gel_compliance=compliance[1], thickness_mm=thickness, poisson=gel.poisson,
        )  # fmt: skip
        x, dent = press.half_mm / radius, float(small.dent_mm)
        logarithms = [np.log(1e3 * press.force_n_mm / float(small.force)), np.log(press.dent_mm / dent)]
        rows.append([dent / thickness, x**2 * (1 - soft), x**6, x**2, *logarithms])
    return rows


def main() -> int:
    """Press cylinders of drawn states and fit."""
    bench = Bench(__doc__, seed=900, states=19)
    rng, rows = np.random.default_rng(bench.seed), list[list[float]]()
    for _ in range(bench.states):
        thickness, radius = rng.uniform(2.0, 9.0), rng.uniform(3.0, 9.0)
        gel = Solid(young_kpa=150.0, poisson=rng.uniform(0.47, 0.497))
        own_ratio, young = rng.uniform(0.44, 0.49), float(np.exp(rng.uniform(np.log(15.0), np.log(2000.0))))
        rows += against_layer(gel, Solid(young_kpa=young, poisson=own_ratio), radius, thickness)
    values = np.array(rows)
    used = values[values[:, 3] > LEAST_FITTED**2]
    print(f"{len(values)} presses, {len(used)} of them wider than {LEAST_FITTED} of the radius, the largest")
    print(f"{np.sqrt(values[:, 3].max()):.2f}; dent/thickness, x² (1 - s), x⁶, x²; RMS error")
    for name, column in (("force", 4), ("dent", 5)):
        fit = np.linalg.lstsq(used[:, :4], used[:, column], rcond=None)[0]
        error = float(np.sqrt(np.mean((used[:, :4] @ fit - used[:, column]) ** 2)))
        print(f"{name}: {', '.join(f'{part:.3f}' for part in fit)}; {error:.4f}")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
