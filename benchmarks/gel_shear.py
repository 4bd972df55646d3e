"""Shear force from markers of a bonded gel against finite elements in three dimensions.

    python -m benchmarks.gel_shear --seed 3204 --gels 8

Quadratic tetrahedra by NGSolve (extra fem3d), on a mesh that follows the contact's edge, share nothing with the Green's
function of `tsis.mechanics.gel.shear.gel_shear`. A disc is dragged along: an even shear traction, or one that grows
towards the edge, beside a normal pressure. Markers lie 0.9 mm apart and are read with an error of 5 µm. Linear
elasticity; the gel's values are known to the estimate. `Layer`, for `benchmarks.gel_force`, has bricks of 8 nodes
(B-bar, so that a nearly incompressible gel does not lock).
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import product

import numpy as np
from benchmarks.harness import Bench
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

from tsis.mechanics.gel.shear import gel_shear
from tsis.model.gel_sensor import BoundedValue, GelSensor

WIDE_MM, LAYERS = 24.0, 5
COARSE_MM = 1.4  # of tetrahedra
MARKER_MM, READING_MM, GOAL = 0.9, 0.005, 0.15


def brick(size: np.ndarray, young: float, poisson: float) -> np.ndarray:
    """Stiffness of a brick, kPa mm, with the mean dilatation of its volume."""
    shear, bulk = young / 2 / (1 + poisson), young / 3 / (1 - 2 * poisson)
    corner = np.array(list(product((-1, 1), repeat=3)), dtype=float)
    deviator = np.diag([2.0, 2, 2, 1, 1, 1]) * shear
    deviator[:3, :3] -= 2 * shear / 3
    total, dilatation = np.zeros((24, 24)), np.zeros(24)
    volume = float(size.prod()) / 8
    for point in product((-1 / np.sqrt(3), 1 / np.sqrt(3)), repeat=3):
        terms = 1 + corner * point
        slope = np.stack(
            [corner[:, a] * np.delete(terms, a, axis=1).prod(axis=1) / 8 * 2 / size[a] for a in range(3)], 1
        )
        strain = np.zeros((6, 24))
        for node in range(8):
            x, y, z = slope[node]
            strain[:, 3 * node : 3 * node + 3] = [[x, 0, 0], [0, y, 0], [0, 0, z], [y, x, 0], [0, z, y], [z, 0, x]]
        total += strain.T @ deviator @ strain * volume
        dilatation += strain[:3].sum(axis=0) * volume
    return total + bulk * np.outer(dilatation, dilatation) / (8 * volume)


class Layer:
    """A square layer bonded below, with free sides."""

    def __init__(self, thickness: float, young: float, poisson: float, *, cell_mm: float) -> None:
        self.cell_mm = cell_mm
        self.count = round(WIDE_MM / cell_mm)
        self.shape = (self.count + 1, self.count + 1, LAYERS + 1)
        size = np.array([cell_mm, cell_mm, thickness / LAYERS])
        node = np.arange(np.prod(self.shape)).reshape(self.shape)
        cells = [node[i : i + self.count, j : j + self.count, k : k + LAYERS] for i, j, k in product((0, 1), repeat=3)]
        freedom = 3 * np.stack([part.ravel() for part in cells], axis=1)[:, :, None] + np.arange(3)
        freedom = freedom.reshape(len(freedom), 24)
        stiffness = np.broadcast_to(brick(size, young, poisson), (len(freedom), 24, 24))
        rows, columns = np.repeat(freedom, 24, axis=1).ravel(), np.tile(freedom, (1, 24)).ravel()
        matrix = coo_matrix((stiffness.ravel(), (rows, columns)), shape=(3 * node.size,) * 2).tocsc()
        self.free = np.setdiff1d(np.arange(3 * node.size), (3 * node[:, :, 0].ravel()[:, None] + np.arange(3)).ravel())
        self.solve = splu(
            matrix[self.free][:, self.free], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        ).solve
        self.top, self.size = node[:, :, -1], 3 * node.size
        self.side = (np.arange(self.count + 1) - self.count / 2) * cell_mm

    def displaced(self, traction: np.ndarray) -> np.ndarray:
        """Displacement of the face's nodes (x, y, z) by tractions on them in kPa, shape (3, n, n)."""
        load = np.zeros(self.size)
        for axis in range(3):
            load[3 * self.top.ravel() + axis] = traction[axis].ravel() * self.cell_mm**2
        result = np.zeros(self.size)
        result[self.free] = self.solve(load[self.free])
        return np.stack([result[3 * self.top + axis] for axis in range(3)])


@dataclass(frozen=True, kw_only=True)
class Drag:
    """Tractions on a disc: shear (x, y) in kPa, even or growing towards the edge, and pressure at the middle."""

    centre: tuple[float, float]
    radius: float
    shear: tuple[float, float]
    even: bool
    peak: float


def on_tetrahedra(drag: Drag, gel: tuple[float, float, float], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Movement of the gel at points, and the force; ``gel`` is thickness, modulus and Poisson's ratio."""
    import ngsolve as ng
    from netgen.occ import Axes, Box, Glue, OCCGeometry, Pnt, WorkPlane, X, Z

    (thickness, young, poisson), half = gel, WIDE_MM / 2
    disc = WorkPlane(Axes(Pnt(*drag.centre, 0.0), n=Z, h=X)).Circle(drag.radius).Face()
    disc.name, disc.maxh = "contact", drag.radius / 5
    block = Box(Pnt(-half, -half, -thickness), Pnt(half, half, 0.0))
    block.faces.Min(Z).name = "bottom"
    geometry = OCCGeometry(Glue([block, disc]))
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=COARSE_MM, grading=0.3))
    space = ng.VectorH1(mesh, order=2, dirichlet="bottom")
    trial, test = space.TnT()
    strain = [0.5 * (ng.Grad(part) + ng.Grad(part).trans) for part in (trial, test)]
    shear, lame = young / 2 / (1 + poisson), young * poisson / (1 + poisson) / (1 - 2 * poisson)
    form, load = ng.BilinearForm(space, symmetric=True), ng.LinearForm(space)
    form += (2 * shear * ng.InnerProduct(*strain) + lame * ng.div(trial) * ng.div(test)) * ng.dx
    squared = ((ng.x - drag.centre[0]) ** 2 + (ng.y - drag.centre[1]) ** 2) / drag.radius**2
    shape = ng.CoefficientFunction(1.0) if drag.even else 0.4 + squared
    left = ng.IfPos(1 - squared, 1 - squared, 0.0)
    traction = ng.CoefficientFunction((shape * drag.shear[0], shape * drag.shear[1], -drag.peak * ng.sqrt(left)))
    contact = mesh.Boundaries("contact")
    load += traction * test * ng.ds(definedon=contact)
    form.Assemble()
    load.Assemble()
    moved = ng.GridFunction(space)
    moved.vec.data = form.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky") * load.vec
    force = [ng.Integrate(traction[axis], mesh, definedon=contact) / 1000 for axis in (0, 1)]
    return np.array([moved(mesh(x, y, 0.0))[:2] for x, y in points]), np.array(force)


def main() -> int:
    """Print one row a press."""
    bench = Bench(__doc__, seed=2031, gels=8)
    rng = np.random.default_rng(bench.seed)
    print("gel kPa  nu     t mm  contact mm  shear N  estimate N        error  in 90 %")
    errors, held = [], []
    for number in range(bench.gels):
        young, poisson = float(np.exp(rng.uniform(*np.log([60, 300])))), float(rng.uniform(0.45, 0.49))
        thickness, radius = float(rng.uniform(2.5, 4.5)), float(rng.uniform(1.5, 3.0))
        centre = rng.uniform(-1.5, 1.5, 2)
        angle, strength = rng.uniform(0, 2 * np.pi), float(rng.uniform(0.03, 0.1)) * young
        drag = Drag(
            centre=(float(centre[0]), float(centre[1])), radius=radius, even=number % 2 == 0, peak=0.3 * young,
            shear=(float(strength * np.cos(angle)), float(strength * np.sin(angle))),
        )  # fmt: skip
        places = np.arange(-7.2, 7.3, MARKER_MM)
        points = np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)
        moved, truth = on_tetrahedra(drag, (thickness, young, poisson), points)
        shift = moved + rng.normal(0, READING_MM, points.shape)
        sensor = GelSensor(
            name="drawn", width_mm=WIDE_MM, height_mm=WIDE_MM, thickness_mm=BoundedValue(value=thickness),
            young_kpa=BoundedValue(value=young), poisson=BoundedValue(value=poisson), image_px=(300, 300),
            mm_per_pixel=(0.06, 0.06), scale_uncertainty=0.0,
        )  # fmt: skip
        found = gel_shear(
            points, shift, sensor=sensor, centre_mm=(centre[0], centre[1]), radius_mm=radius, sd_mm=READING_MM
        )
        size = float(np.hypot(*truth))
        errors.append(float(np.hypot(*(np.array(found.force_n) - truth))) / size)
        inside_90 = [low <= part <= high for part, (low, high) in zip(truth, found.interval_n(), strict=True)]
        held += inside_90
        text = f"{found.force_n[0]:+.3f}, {found.force_n[1]:+.3f}"
        print(
            f"{young:7.0f}  {poisson:.3f}  {thickness:.2f}  {radius:10.2f}  {size:7.3f}  {text}  {errors[-1]:10.3f}  "
            f"{sum(inside_90)} of 2",
            flush=True,
        )
    print(f"shear: largest error {max(errors):.3f}, median {np.median(errors):.3f}; goal {GOAL}")
    print(f"interval (gel known): holds {sum(held)} of {len(held)} components")
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
