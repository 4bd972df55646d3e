"""Make scans of lumps in uneven tissue by finite elements in three dimensions; resumable, a file a world.

    python -m benchmarks.mapping.solved_scans --folder FOLDER --seeds 0 1 2     # minutes each; needs NGSolve (fem3d)

The slab with its lumps and its uneven modulus is meshed and factorised once a world, with and without contrast. Each
press is the fixed point of two answers: the face's displacement by the lumps under the present pressure, from three
dimensions, and the contact's answer to it, harmonic by harmonic. Nothing is linear in the contrast or in the field, and
the kernel of the map is not used.
"""

from __future__ import annotations

import itertools
import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Several

import tsis
from tsis.mechanics.tissue_field import TissueFieldResponse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

FLAT, DOMED = "tsis-2011", "tsis-domed"
HARMONICS = 9  # 0 to 8 around the axis
ANGLES = 2 * np.pi * np.arange(24) / 24
SLAB_MM = 85.0  # radius
LARGEST_MM, SCANNED_MM = 12.0, 5.0  # elements far away, and under the scan
POISSON = 0.49
ROUNDS = 4  # of the fixed point
WAVES = 600
POINTS = 61  # radii of the stored profiles
FORCE_N = 1.0
BODIES = ("box", "cone", "torus", "hyperboloid")  # of the seeds from 1000 on, in turn


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """Truth of one scan: lumps as (x, y, depth of the centre, diameter, contrast), tissue, places of the presses.

    ``body`` is a stiff body that is no sphere, one of `BODIES`, of ``body_contrast``: around ``body_mm`` (x, y, depth),
    turned by ``body_turn`` around the vertical.
    """

    seed: int
    lumps: tuple[tuple[float, float, float, float, float], ...]
    young_kpa: float
    thickness_mm: float
    uneven_sd: float
    uneven_mm: float
    heavy_tail: bool  # of the spectrum: not the Gaussian correlation that the map assumes
    places_mm: tuple[tuple[float, float], ...]
    probe: str = FLAT
    body: str = ""
    body_contrast: float = 1.0
    body_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    body_turn: float = 0.0


def world(seed: int) -> World:
    """Blanks for seeds that 3 divides, pairs of 8 mm from 900 on, bodies from 1000 on, else one to three lumps.

    Seeds from 400 to 499 are pressed by the domed probe.
    """
    rng = np.random.default_rng([49, seed])
    grid = [(x, y) for y in (-20.0, -10.0, 0.0, 10.0, 20.0) for x in (-20.0, -10.0, 0.0, 10.0, 20.0)]
    places = tuple(tuple(place) for place in (np.array(grid) + rng.normal(0.0, 1.0, (25, 2))).tolist())
    lumps: list[tuple[float, float, float, float, float]] = []
    sd = float(rng.uniform(0.0, 0.25 if seed % 3 == 0 else 0.15))
    body: dict[str, Any] = {}
    if seed >= 1000:
        sd = 0.05
        body = {
            "body": BODIES[seed % len(BODIES)],
            "body_contrast": float(rng.uniform(6.0, 12.0)),
            "body_mm": tuple(np.append(rng.uniform(-4.0, 4.0, 2), rng.uniform(9.5, 11.0)).tolist()),
            "body_turn": float(rng.uniform(0.0, np.pi)),
        }
    elif seed >= 900:
        apart, angle, sd = 10.0 + 2.0 * (seed % 4), rng.uniform(0, np.pi), 0.05
        middle = rng.uniform(-6.0, 6.0, 2)
        for side in (-0.5, 0.5):
            x, y = middle + side * apart * np.array([np.cos(angle), np.sin(angle)])
            lumps.append((float(x), float(y), 9.0, 8.0, float(rng.uniform(6.0, 15.0))))
    elif seed % 3:
        while len(lumps) < 1 + seed % 3 - (rng.random() < 0.3) or not lumps:
            d, top = float(rng.uniform(6.0, 14.0)), float(rng.uniform(3.0, 11.0))
            x, y = rng.uniform(-21.0, 21.0, 2).tolist()
            one = (x, y, top + d / 2, d, float(np.exp(rng.uniform(np.log(3.0), np.log(20.0)))))
            if all(np.linalg.norm(np.subtract(one[:3], other[:3])) > (d + other[3]) / 2 + 2.0 for other in lumps):
                lumps.append(one)
    return World(
        seed=seed,
        lumps=tuple(lumps),
        young_kpa=float(5.0 * np.exp(rng.normal(0.0, 0.05))),
        thickness_mm=float(30.0 * np.exp(rng.normal(0.0, 0.02))),
        uneven_sd=sd,
        uneven_mm=float(np.exp(rng.uniform(np.log(3.0), np.log(10.0)))),
        heavy_tail=bool(rng.random() < 0.5),
        places_mm=places,
        probe=DOMED if 400 <= seed < 500 else FLAT,
        **body,
    )


def inside_body(truth: World, at: Floats) -> NDArray[np.bool_]:
    """Whether points (n, 3) of x, y and depth lie in the body that is no sphere."""
    across, along, down = _turned(truth, at).T
    away = np.hypot(across, along)
    if truth.body == "box":
        return np.asarray((np.abs(across) < 8.0) & (np.abs(along) < 5.0) & (np.abs(down) < 4.5))
    if truth.body == "cone":  # its top up: 2 mm wide there, 16 mm at the bottom
        return np.asarray((np.abs(down) < 5.0) & (away < 1.0 + 7.0 * (down + 5.0) / 10.0))
    if truth.body == "torus":
        return np.asarray((away - 8.0) ** 2 + down**2 < 3.5**2)
    if truth.body == "hyperboloid":  # of one sheet: 8 mm wide at the waist, 16 mm at both ends
        return np.asarray((np.abs(down) < 5.0) & (away**2 < 4.0**2 + (8.0**2 - 4.0**2) * (down / 5.0) ** 2))
    return np.zeros(len(at), dtype=bool)


def _turned(truth: World, at: Floats) -> Floats:
    """Points (n, 3) in the body's own frame."""
    x, y, down = (at - np.array(truth.body_mm)).T
    cosine, sine = np.cos(truth.body_turn), np.sin(truth.body_turn)
    return np.column_stack([cosine * x + sine * y, cosine * y - sine * x, down])


def _body_solid(truth: World) -> Any:
    """The body that is no sphere as a solid of the mesh, depth downwards."""
    from netgen import occ

    if truth.body == "box":
        solid = occ.Box(occ.Pnt(-8.0, -5.0, -4.5), occ.Pnt(8.0, 5.0, 4.5))
    elif truth.body == "cone":
        solid = occ.Cone(occ.Axes(occ.Pnt(0, 0, -5.0), occ.Z), 8.0, 1.0, 10.0, 2 * np.pi)
    elif truth.body == "torus":
        ring = occ.WorkPlane(occ.Axes((8.0, 0, 0), n=occ.Y, h=occ.X)).Circle(3.5).Face()
        solid = ring.Revolve(occ.Axis((0, 0, 0), occ.Z), 360)
    else:
        height = np.linspace(-5.0, 5.0, 41)
        edge = [occ.Pnt(float(np.sqrt(16.0 + 48.0 * (z / 5.0) ** 2)), 0, float(z)) for z in height]
        sides = [occ.SplineApproximation(edge, tol=1e-4)]
        corners = [edge[-1], occ.Pnt(0, 0, 5.0), occ.Pnt(0, 0, -5.0), edge[0]]
        sides += [occ.Segment(first, second) for first, second in itertools.pairwise(corners)]
        solid = occ.Face(occ.Wire(sides)).Revolve(occ.Axis((0, 0, 0), occ.Z), 360)
    x, y, depth = truth.body_mm
    turned = solid.Rotate(occ.Axis((0, 0, 0), occ.Z), np.degrees(truth.body_turn))
    return turned.Move(occ.Vec(x, y, -depth))


def log_modulus(truth: World, at: Floats) -> Floats:
    """The field at points (n, 3): plane waves with normal wave numbers, or with those of a rougher field."""
    rng = np.random.default_rng([50, truth.seed])
    wave = rng.normal(0.0, 1.0 / truth.uneven_mm, (WAVES, 3))
    if truth.heavy_tail:
        wave /= np.sqrt(rng.chisquare(4, (WAVES, 1)) / 4)
    phase = rng.uniform(0, 2 * np.pi, WAVES)
    total = np.zeros(len(at))
    for part in np.array_split(np.arange(WAVES), 60):
        total += np.cos(at @ wave[part].T + phase[part]).sum(axis=1)
    return np.asarray(truth.uneven_sd * np.sqrt(2 / WAVES) * total)


class SolvedSlab:
    """The slab of a world, factorised with and without contrast."""

    def __init__(self, truth: World) -> None:
        import ngsolve as ng
        from netgen import occ

        self._ng, self.truth = ng, truth
        ng.SetNumThreads(1)
        thickness = truth.thickness_mm
        slab = occ.Cylinder(occ.Pnt(0, 0, -thickness), occ.Z, SLAB_MM, thickness)
        scanned = occ.Box(occ.Pnt(-34, -34, -18), occ.Pnt(34, 34, 0))
        bodies: list[Any] = []
        caps: list[Any] = []  # finer elements between a lump and the skin
        for number, (x, y, depth, diameter, _) in enumerate(truth.lumps):
            body = occ.Sphere(occ.Pnt(x, y, -depth), diameter / 2)
            body.mat(f"lump{number}")
            body.maxh = 0.3 * diameter
            slab, scanned = slab - body, scanned - body
            bodies.append(body)
        for x, y, depth, diameter, _ in truth.lumps:  # after all lumps: none may be cut by a cap
            top, reach = depth - diameter / 2, depth
            cap = occ.Cylinder(occ.Pnt(x, y, -0.9 * top), occ.Z, reach, 0.9 * top)
            for other in bodies:
                cap = cap - other
            for other in caps:
                cap = cap - other
            cap.mat("scanned")
            cap.maxh = float(np.clip(0.6 * top, 2.0, SCANNED_MM))
            slab, scanned = slab - cap, scanned - cap
            caps.append(cap)
        if truth.body:
            body = _body_solid(truth)
            body.mat("body")
            body.maxh = 2.5
            slab, scanned = slab - body, scanned - body
            bodies.append(body)
        outside = slab - scanned
        scanned.mat("scanned")
        scanned.maxh = SCANNED_MM
        outside.mat("outside")
        whole = occ.Glue([outside, scanned, *caps, *bodies])
        for face in whole.faces:
            top = face.bounding_box[1][2]
            face.name = "wall" if top < -thickness + 1e-4 else "other"
        self.mesh = ng.Mesh(occ.OCCGeometry(whole).GenerateMesh(maxh=LARGEST_MM, grading=0.6))
        self.mesh.Curve(3)
        self.scalar = ng.H1(self.mesh, order=3, dirichlet="wall")
        self.space = ng.FESpace([self.scalar] * 3)
        young = self._young()
        self._with = self._inverse(young)
        self._without = self._inverse(ng.CF(truth.young_kpa))

    def _young(self) -> Any:
        ng, truth, thickness = self._ng, self.truth, self.truth.thickness_mm
        axis, down = np.arange(-87.0, 88.0, 1.5), np.linspace(-thickness - 1.0, 1.0, 25)
        z, y, x = np.meshgrid(down, axis, axis, indexing="ij")
        field = np.zeros(x.shape)
        if truth.uneven_sd:
            near = (np.abs(x) < 50) & (np.abs(y) < 50)  # far away it does not matter
            field[near] = log_modulus(truth, np.column_stack([x[near], y[near], -z[near]]))
        tissue = ng.VoxelCoefficient(
            (axis[0], axis[0], down[0]), (axis[-1], axis[-1], down[-1]), truth.young_kpa * np.exp(field), linear=True
        )
        lumps = {f"lump{k}": truth.young_kpa * lump[4] for k, lump in enumerate(truth.lumps)}
        lumps["body"] = truth.young_kpa * truth.body_contrast
        return self.mesh.MaterialCF({"scanned": tissue, "outside": tissue, **lumps})

    def _inverse(self, young: Any) -> Any:
        ng = self._ng
        u, v = self.space.TnT()
        strains = [
            ng.Sym(ng.CF(tuple(entry for part in one for entry in ng.grad(part)), dims=(3, 3))) for one in (u, v)
        ]
        lame, shear = young * POISSON / (1 + POISSON) / (1 - 2 * POISSON), young / 2 / (1 + POISSON)
        form = ng.BilinearForm(self.space, symmetric=True)
        form += (lame * ng.Trace(strains[0]) * ng.Trace(strains[1]) + 2 * shear * ng.InnerProduct(*strains)) * ng.dx
        form.Assemble()
        self.kept = form
        return form.mat.Inverse(self.space.FreeDofs(), inverse="sparsecholesky")

    def points(self, x: Floats, y: Floats) -> Any:
        """Matrix from unknowns to vertical displacements at points of the skin."""
        import scipy

        rows, columns, values = [], [], []
        start = self.space.Range(2).start
        for number, (a, b) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
            where = self.mesh(a, b, -1e-6)
            element = self._ng.ElementId(self._ng.VOL, where.nr)
            shape = np.array(self.scalar.GetFE(element).CalcShape(*where.pnt))
            columns += [start + one for one in self.scalar.GetDofNrs(element)]
            rows += [number] * len(shape)
            values += shape.tolist()
        return scipy.sparse.csr_array((values, (rows, columns)), shape=(len(x), self.space.ndof))

    def softening(self, points: Any, force_mn: Floats) -> Floats:
        """Displacement downwards at points by forces on them, with contrast less without."""
        load = self.kept.mat.CreateColVector()
        load.FV().NumPy()[:] = points.T @ force_mn  # the sign drops out: force and displacement downwards
        difference = load.CreateVector()
        difference.data = self._with * load
        difference.data -= self._without * load
        return np.asarray(points @ difference.FV().NumPy())


def solve(truth: World, report: Any = print) -> dict[str, Floats]:
    """Profiles of each press for `FORCE_N`, harmonic by harmonic: pressure and displacement, complex."""
    began = time.perf_counter()
    probe = tsis.load_probe(truth.probe)
    slab = TissueFieldResponse(probe, young_kpa=truth.young_kpa, thickness_mm=truth.thickness_mm, poisson=POISSON)
    answers = [slab.contact_answer(order) for order in range(HARMONICS)]
    unit = slab.round_forces_mn() @ (FORCE_N, 1.0)  # by the force, and by the dome's shape
    bare = [FORCE_N * part[0] + part[1] for part in slab.press()]
    radius = slab.face.radius_mm
    report(f"seed {truth.seed}: contact {time.perf_counter() - began:.0f} s")
    solid = SolvedSlab(truth)
    report(f"seed {truth.seed}: {solid.space.ndof} unknowns {time.perf_counter() - began:.0f} s")
    r, a = np.meshgrid(radius, ANGLES, indexing="ij")
    waves = np.exp(1j * np.outer(ANGLES, np.arange(HARMONICS)))
    pressure = np.zeros((len(truth.places_mm), HARMONICS, POINTS), dtype=complex)
    displacement = np.zeros_like(pressure)
    for number, (x, y) in enumerate(truth.places_mm):
        at = solid.points(x + (r * np.cos(a)).ravel(), y + (r * np.sin(a)).ravel())
        change = np.zeros((HARMONICS, len(radius)), dtype=complex)  # of nodal forces
        for _ in range(ROUNDS):
            # A nodal force of harmonic m has the amplitude F on the ring: F / n at each angle for m = 0, else 2 F / n.
            share = np.where(np.arange(HARMONICS) == 0, 1.0, 2.0)[:, None] * change / len(ANGLES)
            force = unit[:, None] / len(ANGLES) + (share.T @ waves.conj().T).real
            moved = solid.softening(at, force.ravel()).reshape(len(radius), len(ANGLES))
            parts = moved @ waves * np.where(np.arange(HARMONICS) == 0, 1.0, 2.0) / len(ANGLES)
            for order, answer in enumerate(answers):
                nodes = slice(None) if order == 0 else slice(1, None)
                change[order, nodes] = -answer.force_mn @ parts[nodes, order]
        for order, answer in enumerate(answers):
            nodes = slice(None) if order == 0 else slice(1, None)
            pressure[number, order] = answer.pressure_kpa @ change[order, nodes]
            displacement[number, order] = answer.face_displacement_mm @ change[order, nodes]
    report(f"seed {truth.seed}: done {time.perf_counter() - began:.0f} s")
    return {
        "radius_mm": slab.radius_mm,
        "bare_pressure_kpa": bare[0],
        "bare_displacement_mm": bare[1],
        "pressure_kpa": pressure,
        "displacement_mm": displacement,
    }


def make(seed: int, folder: Path) -> Path:
    """Solve a world unless its file is there."""
    path = folder / f"scan-{seed:04d}.npz"
    if not path.exists():
        truth = world(seed)
        arrays = solve(truth)
        part = folder / f".part-{seed}.npz"
        np.savez_compressed(part, truth=json.dumps(asdict(truth)), **arrays)  # type: ignore[arg-type]
        part.rename(path)
    return path


if __name__ == "__main__":
    bench = Bench(__doc__, folder=Path("scans"), seeds=Several(kind=int))
    bench.folder.mkdir(parents=True, exist_ok=True)
    for each in bench.seeds:
        make(each, bench.folder)
