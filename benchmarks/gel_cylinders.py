"""Width and force of cylinders at finite strain: rigid ones on bonded gels, soft ones on a rigid plate.

    python -m benchmarks.gel_cylinders --seed 3206 --gels 4

By NGSolve in plane strain (`benchmarks.gel_shapes`; extra fem3d). Each row gives the true force per mm over that of the
layer's model at the true width, small strain, and over the model with the correction of `tsis hardness --cylinder-mm`.
``--fit`` prints the coefficients of that correction for the rows; those in the package are of seed 1 with 8 gels.
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np
from benchmarks.gel_shapes import COARSE_MM, FINE_MM, LONG, ORDER, PENALTY, STEEPEST, Body, deepened, pressed, rounded
from netgen.geom2d import SplineGeometry

from tsis.hardness import finite_cylinder
from tsis.mechanics.gel import layer_contact

if TYPE_CHECKING:
    from numpy.typing import NDArray

SHARES = (0.04, 0.08, 0.13, 0.18)  # depth over the gel's thickness
SQUEEZES = (0.03, 0.06, 0.1, 0.15)  # of a soft cylinder over its radius
RIGID, SOFT = "rigid on gel", "soft on plate"


def on_gel(rng: np.random.Generator) -> list[tuple[str, float, float, float, float, float]]:
    """Rows of a rigid cylinder: kind, half width, radius, thickness, Poisson's ratio, force over E/(1 - nu²)."""
    young, poisson, thickness = 150.0, float(rng.uniform(0.46, 0.49)), float(rng.uniform(3.0, 6.0))
    radius = float(rng.uniform(2.5, 7.0))
    body = Body(name="cylinder", symmetry=LONG, height=lambda x: rounded(x, radius, STEEPEST), radius_mm=radius)
    compliance = (1 - poisson**2) / young
    return [
        (RIGID, hertzian(truth.place_mm, truth.pressure_kpa), radius, thickness, poisson,
         1000.0 * truth.force * compliance)
        for truth in pressed(body, young, poisson, thickness, SHARES)
    ]  # fmt: skip


def on_plate(rng: np.random.Generator) -> list[tuple[str, float, float, float, float, float]]:
    """Rows of a soft cylinder of radius 1, squeezed between plates; half of it, cut where it is widest."""
    young, poisson = 1.0, float(rng.uniform(0.46, 0.49))
    geometry = SplineGeometry()
    bottom, corner, side, middle, axis = (
        geometry.AppendPoint(*point) for point in ((0, 0), (0.9999, 0), (1, 1), (0, 1), (0, 0.5))
    )
    scale = 0.3
    geometry.Append(["spline3", bottom, corner, side], bc="arc", maxh=scale * FINE_MM)
    geometry.Append(["line", side, middle], bc="middle", maxh=scale * COARSE_MM)
    geometry.Append(["line", middle, axis], bc="axis", maxh=scale * COARSE_MM)
    geometry.Append(["line", axis, bottom], bc="axis", maxh=scale * COARSE_MM)
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=scale * COARSE_MM, grading=0.25))
    mesh.Curve(3)
    space = ng.VectorH1(mesh, order=ORDER, dirichletx="axis", dirichlety="middle")
    moved, depth = space.TrialFunction(), ng.Parameter(0.0)
    gradient = ng.Id(2) + ng.Grad(moved)
    volume = ng.Det(gradient)
    shear, bulk = young / 2 / (1 + poisson), young / 3 / (1 - 2 * poisson)
    squared = ng.InnerProduct(gradient, gradient) + 1.0
    energy = shear / 2 * (squared * ng.exp(-2.0 / 3.0 * ng.log(volume)) - 3.0) + bulk / 2 * (volume - 1.0) ** 2
    stiffness = PENALTY * young
    inside = depth - ng.y - moved[1]
    form = ng.BilinearForm(space, symmetric=True)
    form += ng.Variation((2.0 * energy).Compile() * ng.dx)
    form += ng.Variation((stiffness * ng.IfPos(inside, inside, 0.0) ** 2).Compile() * ng.ds("arc"))
    solution = ng.GridFunction(space)
    rows = []
    for before, now in zip((0.0, *SQUEEZES), SQUEEZES, strict=False):
        deepened(form, solution, space, depth, before, now)
        left = depth - ng.y - solution[1]
        force = 2.0 * ng.Integrate(
            stiffness * ng.IfPos(left, left, 0.0), mesh, definedon=mesh.Boundaries("arc"), order=8
        )
        rows.append((SOFT, hertzian(*_arc(mesh, solution, now)), 1.0, 1e3, poisson, force * (1 - poisson**2) / young))
    return rows


def hertzian(place: NDArray[np.float64], pressure: NDArray[np.float64]) -> float:
    """Half the width of the contact by Hertz's law near its edge: a mesh smears the edge itself."""
    part = (pressure > 0.25 * pressure.max()) & (pressure < 0.75 * pressure.max())
    slope, level = np.polyfit(place[part] ** 2, pressure[part] ** 2, 1)
    return float(np.sqrt(-level / slope))


def _arc(mesh: Any, solution: Any, depth: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distances from the axis of points of the deformed arc, and how far they lie in the plate."""
    found = []
    for angle in np.linspace(1e-4, 1.2, 3000):
        try:
            x, y = float(np.sin(angle)), 1.0 - float(np.cos(angle))
            across, up = solution(mesh(x, y + 1e-6))
        except Exception:
            continue  # a point between the arc and its spline
        found.append((x + across, max(depth - y - up, 0.0)))
    place, inside = np.array(found).T
    return place, inside


def main() -> None:
    """Print the rows, and with ``--fit`` the coefficients."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=3206)
    parser.add_argument("--gels", type=int, default=4)
    parser.add_argument("--fit", action="store_true")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    rows, terms, logs, soft = [], [], [], []
    for number in range(arguments.gels):
        for kind, half, radius, thickness, poisson, force in on_plate(rng) if number % 4 == 3 else on_gel(rng):
            softness = 1.0 - 1e-9 if kind == SOFT else 0.0
            model = layer_contact(
                half, body="cylinder", radius_mm=radius, body_compliance=softness, gel_compliance=1.0 - softness,
                thickness_mm=thickness, poisson=poisson,
            )  # fmt: skip
            small = force / float(model.force)
            x, dent = half / radius, float(model.dent_mm) / thickness
            corrected = small / float(np.exp(finite_cylinder(x, dent, softness)[0]))
            rows.append((kind, small, corrected))
            terms.append([dent, x**2 * (1 - softness), x**6, x**2])
            logs.append(np.log(small))
            soft.append(softness)
            print(
                f"{kind:14} a/R {x:.3f}  dent/t {dent:.3f}  true force over small strain {small:.3f}, corrected "
                f"{corrected:.3f}",
                flush=True,
            )
    if arguments.fit:
        fit = np.linalg.lstsq(np.array(terms), np.array(logs), rcond=None)[0]
        left = np.array(logs) - np.array(terms) @ fit
        print("coefficients", np.round(fit, 3), "RMS", round(float(np.sqrt(np.mean(left**2))), 4))
    for kind in (RIGID, SOFT):
        part = np.array([row[1:] for row in rows if row[0] == kind])
        if len(part):
            print(f"{kind}: largest error {np.abs(part - 1).max(axis=0).round(3)} (small strain, corrected)")


if __name__ == "__main__":
    main()
