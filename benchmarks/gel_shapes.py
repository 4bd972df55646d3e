"""Force and pressure from depth maps under punches, bars, cylinders and edges, by another program at finite strain.

    python -m benchmarks.gel_shapes --seed 3202 --gels 2

NGSolve presses rigid frictionless bodies into a bonded neo-Hookean gel: a disc with a rounded edge (axisymmetric); a
bar with rounded edges, a cylinder on its side and a rounded wedge of 120 degrees, all endless (plane strain), compared
by their force per millimetre in the middle of the map. The depth map has 5 µm of noise. Gel and body are drawn from the
seed; the gel's values are known to the estimate, the contact is not. ngsolve is of the extra fem3d.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np
from benchmarks.harness import Bench
from netgen.geom2d import SplineGeometry

from tsis.mechanics.gel.contact import layer_contact
from tsis.mechanics.gel.force import gel_force
from tsis.model.gel_sensor import BoundedValue, GelSensor

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

PIXEL_MM, COLUMNS, ROWS = 0.0632, 320, 240
DEPTH_NOISE_MM = 0.005
FILLET_MM, WEDGE_SLOPE, STEEPEST = 0.3, np.tan(np.radians(30.0)), 2.0
WIDE = 5.0  # gel thicknesses from the middle to the free side
FINE_MM, COARSE_MM, ORDER = 0.08, 0.9, 2
MOST_HALVED = 5
PENALTY = 3000.0  # stiffness of the contact over the modulus of the gel by its thickness
SHARES = (0.06, 0.12, 0.2)  # depth over thickness
ROUND, LONG = "round", "long"


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body: its kind of symmetry and its height above the lowest point over the distance from the middle."""

    name: str
    symmetry: str
    height: Callable[[Any], Any]
    radius_mm: float | None = None


def flat(half_mm: float, symmetry: str) -> Body:
    """A disc or a bar with a rounded edge."""
    name = f"disc {half_mm:.2f} mm" if symmetry == ROUND else f"bar {2 * half_mm:.2f} mm"
    return Body(name=name, symmetry=symmetry, height=lambda x: rounded(x - (half_mm - FILLET_MM), FILLET_MM, STEEPEST))


def rounded(x: Any, radius: float, slope: float) -> Any:
    """Zero for negative x, then an arc of that radius, then its tangent of that slope."""
    end = radius * slope / np.sqrt(1.0 + slope**2)
    arc = radius - ng.sqrt(radius**2 - ng.IfPos(end - x, x, end) ** 2)
    return ng.IfPos(x, arc + ng.IfPos(x - end, slope * (x - end), 0.0), 0.0)


def drawn_bodies(rng: np.random.Generator) -> list[Body]:
    """One of each kind."""
    radius = float(rng.uniform(2.5, 6.0))
    return [
        flat(float(rng.uniform(1.5, 3.0)), ROUND),
        flat(float(rng.uniform(1.0, 2.5)), LONG),
        Body(
            name=f"cylinder {radius:.2f} mm",
            symmetry=LONG,
            height=lambda x: rounded(x, radius, STEEPEST),
            radius_mm=radius,
        ),
        Body(name="wedge of 120 degrees", symmetry=LONG, height=lambda x: rounded(x, 1.0, float(WEDGE_SLOPE))),
    ]


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The face after a press, over the deformed distance from the middle; force in N, or N per mm."""

    place_mm: NDArray[np.float64]
    depth_mm: NDArray[np.float64]
    pressure_kpa: NDArray[np.float64]
    force: float


def pressed(body: Body, young: float, poisson: float, thickness: float, shares: tuple[float, ...]) -> list[Truth]:
    """The body at each depth, a share of the thickness."""
    around = body.symmetry == ROUND
    wide = WIDE * thickness
    geometry = SplineGeometry()
    near = 0.35 * wide
    corners = [(0, -thickness), (wide, -thickness), (wide, 0), (near, 0), (0, 0)]
    points = [geometry.AppendPoint(*corner) for corner in corners]
    names, sizes = ("bottom", "side", "far", "top", "axis"), (COARSE_MM, COARSE_MM, COARSE_MM, FINE_MM, COARSE_MM)
    for number, (name, size) in enumerate(zip(names, sizes, strict=True)):
        ends = [points[number], points[(number + 1) % 5]]
        geometry.Append(["line", *ends], bc=name, maxh=size)
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=COARSE_MM, grading=0.25))
    space = ng.VectorH1(mesh, order=ORDER, dirichletx="bottom|axis", dirichlety="bottom")
    moved, depth = space.TrialFunction(), ng.Parameter(0.0)
    radius = ng.x + 1e-9
    gradient = ng.Grad(moved)
    hoop = 1.0 + moved[0] / radius if around else 1.0
    plane = ng.Id(2) + gradient
    volume = ng.Det(plane) * hoop
    squared = ng.InnerProduct(plane, plane) + hoop**2
    shear, bulk = young / 2 / (1 + poisson), young / 3 / (1 - 2 * poisson)
    energy = shear / 2 * (squared * ng.exp(-2.0 / 3.0 * ng.log(volume)) - 3.0) + bulk / 2 * (volume - 1.0) ** 2
    stiffness = PENALTY * young / thickness
    weight = 2 * np.pi * radius if around else 2.0
    inside = moved[1] - body.height(ng.x + moved[0]) + depth
    form = ng.BilinearForm(space, symmetric=True)
    form += ng.Variation((weight * energy).Compile() * ng.dx)
    form += ng.Variation((weight * 0.5 * stiffness * ng.IfPos(inside, inside, 0.0) ** 2).Compile() * ng.ds("top|far"))
    solution = ng.GridFunction(space)
    results = []
    for before, share in zip((0.0, *shares), shares, strict=False):
        deepened(form, solution, space, depth, thickness * before, thickness * share)
        inside_now = solution[1] - body.height(ng.x + solution[0]) + depth
        traction = weight * stiffness * ng.IfPos(inside_now, inside_now, 0.0)
        force = ng.Integrate(traction, mesh, definedon=mesh.Boundaries("top|far"), order=8) / 1000.0
        results.append(_face(mesh, solution, body, (depth.Get(), stiffness, wide, force), around=around))
    return results


def deepened(form: Any, solution: Any, space: Any, depth: Any, low: float, high: float, halved: int = 0) -> None:
    """The press at a greater depth, by smaller steps where one does not converge."""
    start = solution.vec.CreateVector()
    start.data = solution.vec
    depth.Set(high)
    try:
        _newton(form, solution, space)
    except RuntimeError:
        if halved == MOST_HALVED:
            raise
        solution.vec.data = start
        middle = (low + high) / 2
        deepened(form, solution, space, depth, low, middle, halved + 1)
        deepened(form, solution, space, depth, middle, high, halved + 1)


def _newton(form: Any, solution: Any, space: Any) -> None:
    """Newton's method with a step that is halved until the energy falls."""
    residual, step = solution.vec.CreateVector(), solution.vec.CreateVector()
    for _ in range(40):
        form.Apply(solution.vec, residual)
        form.AssembleLinearization(solution.vec)
        inverse = form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
        step.data = inverse * residual
        energy, start, length = form.Energy(solution.vec), solution.vec.CreateVector(), 1.0
        start.data = solution.vec
        while True:
            solution.vec.data = start - length * step
            now = form.Energy(solution.vec)
            if now == now and now <= energy + 1e-12 * abs(energy) + 1e-12:
                break
            length /= 2
            if length < 1e-4:
                raise RuntimeError("the press does not converge")
        if abs(ng.InnerProduct(step, residual)) < 1e-9 * max(abs(energy), 1e-6):
            return
    raise RuntimeError("the press does not converge")


def _face(mesh: Any, solution: Any, body: Body, at_end: tuple[float, ...], *, around: bool) -> Truth:
    depth, stiffness, wide, force = at_end
    x = np.unique(np.concatenate([np.linspace(1e-6, 0.35 * wide, 800), np.linspace(0.35 * wide, 0.999 * wide, 100)]))
    at = [mesh(float(place), 0.0) for place in x]
    across, up = np.array([solution(point) for point in at]).T
    place = x + across
    height = np.array([ng.CoefficientFunction(body.height(ng.x + solution[0]))(point) for point in at])
    nominal = stiffness * np.maximum(up - height + depth, 0.0)
    stretch = np.gradient(place, x) * (place / x if around else 1.0)
    return Truth(place_mm=place, depth_mm=-up, pressure_kpa=nominal / stretch, force=force)


def compared(body: Body, truth: Truth, sensor: GelSensor, rng: np.random.Generator) -> tuple[float, float, float]:
    """Estimate over true force, error of the pressure over its peak, and depth over thickness."""
    y, x = (np.mgrid[:ROWS, :COLUMNS] - np.array([(ROWS - 1) / 2, (COLUMNS - 1) / 2])[:, None, None]) * PIXEL_MM
    distance = np.hypot(x, y) if body.symmetry == ROUND else np.abs(x)
    depth = np.interp(distance, truth.place_mm, truth.depth_mm)
    expected = np.interp(distance, truth.place_mm, truth.pressure_kpa)
    result = gel_force(depth + rng.normal(0, DEPTH_NOISE_MM, depth.shape), sensor=sensor, draws=20)
    if body.symmetry == ROUND:
        rows, force = slice(None), result.force_n
    else:
        rows = slice(ROWS // 2 - 20, ROWS // 2 + 20)
        force = float(result.pressure_kpa[rows].sum(axis=1).mean()) * PIXEL_MM / 1000.0
    off = (result.pressure_kpa - expected)[rows]
    inside = (expected[rows] > 0) | (result.pressure_kpa[rows] > 0)
    peak = float(np.quantile(expected[rows][expected[rows] > 0], 0.99))
    return force / truth.force, float(np.sqrt(np.mean(off[inside] ** 2))) / peak, result.deepest_mm


def _by_layer(body: Body, truth: Truth, sensor: GelSensor) -> str:
    """Force over the true one by the layer at small strain, which `tsis hardness` corrects, from the true width."""
    if body.radius_mm is None:
        return ""
    half = float(truth.place_mm[truth.pressure_kpa > 0.01 * truth.pressure_kpa.max()].max())
    young, poisson = sensor.young_kpa.best, sensor.poisson.best
    model = layer_contact(
        half, body="cylinder", radius_mm=body.radius_mm, body_compliance=0.0, gel_compliance=(1 - poisson**2) / young,
        thickness_mm=sensor.thickness_mm.best, poisson=poisson,
    )  # fmt: skip
    return f"  layer's model at half a width of {half:.3f} mm: {float(model.force) / 1000.0 / truth.force:.3f}"


def main() -> int:
    """Print one row a press."""
    bench = Bench(__doc__, seed=3202, gels=2)
    rng = np.random.default_rng(bench.seed)
    print("gel kPa  nu     t mm  body                  depth/t  force (N, N/mm)  force ratio  pressure RMS/peak")
    rows: list[tuple[str, float, float]] = []
    for _ in range(bench.gels):
        young, poisson = float(np.exp(rng.uniform(*np.log([60, 300])))), float(rng.uniform(0.45, 0.485))
        thickness = float(rng.uniform(3, 5))
        sensor = GelSensor(
            name="drawn", width_mm=COLUMNS * PIXEL_MM, height_mm=ROWS * PIXEL_MM,
            thickness_mm=BoundedValue(value=thickness), young_kpa=BoundedValue(value=young),
            poisson=BoundedValue(value=poisson), image_px=(COLUMNS, ROWS), mm_per_pixel=(PIXEL_MM, PIXEL_MM),
        )  # fmt: skip
        for body in drawn_bodies(rng):
            try:
                truths = pressed(body, young, poisson, thickness, SHARES)
            except RuntimeError as error:
                print(f"{young:7.0f}  {poisson:.3f}  {thickness:.2f}  {body.name:20}  left out: {error}", flush=True)
                continue
            for truth in truths:
                ratio, off, deepest = compared(body, truth, sensor, rng)
                rows.append((body.name.split()[0], ratio, off))
                print(
                    f"{young:7.0f}  {poisson:.3f}  {thickness:.2f}  {body.name:20}  {deepest / thickness:7.3f}  "
                    f"{truth.force:15.4f}  {ratio:11.3f}  {off:17.3f}{_by_layer(body, truth, sensor)}",
                    flush=True,
                )
    for kind in dict.fromkeys(row[0] for row in rows):
        ratios, off = np.array([row[1:] for row in rows if row[0] == kind]).T
        print(f"{kind}: force largest error {np.abs(ratios - 1).max():.3f}, pressure largest RMS {off.max():.3f}")
    print("goals: force 0.10, pressure 0.15")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
