"""How fast and how exact the mechanics are, beside other programs, in one run.

    python -m benchmarks.mechanics

One thread, but for the surrogate's build. Every time is the least of several repetitions; a peer that is not installed
is named and left out. NGSolve comes with the extra fem3d; `pip install scikit-fem` and `apt-get install calculix-ccx`
bring the others.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from dataclasses import dataclass, replace
from functools import partial
from importlib import metadata
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, duration
from rich.console import Console
from threadpoolctl import threadpool_limits

import tsis
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import press_pairs
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.mechanics.finite_strain.probe_on_slab import ProbeOnSlab
from tsis.mechanics.finite_strain.soft_sphere import squeeze_path
from tsis.mechanics.mesh import hats, mesh_rectangle, stiffness
from tsis.mechanics.small_strain.linear_press import PressKernel
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.solid import press_solid
from tsis.mechanics.surrogate.building import build_surrogate
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from tsis.mechanics.small_strain.unilateral import PartialContact
    from tsis.mechanics.surrogate.polynomial import PressSurrogate, TissueSurrogate

PROBE, DOMED = tsis.load_probe("tsis-2011"), tsis.load_probe("tsis-domed")
SPHERE = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
LUMP = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=SPHERE)
PLAIN = LUMP.without_inclusion()
FAST = Resolution(order=3, edge=0.1, growth=3.0, largest=0.5, below_cells=1, ray_layers=4, ray_ratio=9.0)
FINE = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
RADIUS = np.linspace(0.0, 11.0, 45)
MN = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table."""

    task: str
    program: str
    seconds: float
    outcome: str


def least(call: Callable[[], object], repeats: int = 5) -> float:
    """Shortest wall time of a call."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return min(times)


def signals(resolution: Resolution, presses: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """What inclusions (diameter, depth, modulus) change on the face, and seconds a solve of a new geometry."""
    kernel = slab_kernel(resolution)
    bare = kernel.press(5.0, MN).face_displacement_mm
    found = np.array([solved(kernel, *one) for one in presses.tolist()])  # which also fills what is remembered
    return found - bare, least(lambda: [solved(kernel, *one) for one in presses.tolist()], 3) / len(presses)


def slab_kernel(resolution: Resolution) -> PressKernel:
    """What presses of one slab share."""
    return PressKernel(PROBE, thickness_mm=30.0, poisson=0.49, resolution=resolution)


def solved(kernel: PressKernel, diameter: float, depth: float, young: float) -> NDArray[np.float64]:
    """Displacement of the face over an inclusion that is meshed anew, under 1 N."""
    slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=0.49)
    return kernel.press(5.0, MN, slab.change(young / 5.0)).face_displacement_mm


def small_strain() -> Iterator[Row]:
    """The condensed kernel, a new inclusion each time, against its own fine mesh; and peers on the reference case."""
    rng = np.random.default_rng(1)
    drawn = rng.uniform([2.0, 4.0, 40.0], [14.0, 12.0, 120.0], (40, 3))
    exact, _ = signals(FINE, drawn)
    inner = np.linspace(0.0, PROBE.radius_mm, exact.shape[1]) < 11.0
    for label, resolution in (("fast mesh", FAST), ("default mesh", Resolution())):
        found, seconds = signals(resolution, drawn)
        errors = np.abs(found - exact)[:, inner].max(axis=1) / np.abs(exact)[:, inner].max(axis=1)
        spread = f"median {np.median(errors):.2%}, 90 % below {np.quantile(errors, 0.9):.2%}, worst {errors.max():.2%}"
        yield Row(
            task="press with a new inclusion, small strain",
            program=f"tsis, {label}",
            seconds=seconds,
            outcome=f"{1 / seconds:.0f} solves/s; error of the change: {spread}",
        )
    with_it, plain = press(PROBE, LUMP, force_n=1.0), press(PROBE, PLAIN, force_n=1.0)
    change = np.interp(RADIUS, with_it.radius_mm, with_it.face_displacement_mm - plain.face_displacement_mm)
    if has("ngsolve"):
        from benchmarks.peers.ngsolve_press import change_of_face

        other = change_of_face(PROBE, LUMP, RADIUS)
        off = np.abs(other.face_displacement_mm - change).max() / np.abs(change).max()
        yield Row(
            task="the same, (10 mm, 5 mm, 100 kPa)",
            program=f"NGSolve {metadata.version('ngsolve')}",
            seconds=least(lambda: change_of_face(PROBE, LUMP, RADIUS), 3),
            outcome=f"{other.unknowns} unknowns, meshing included; differs by {off:.2%} of the change",
        )
    if shutil.which("ccx"):
        from benchmarks.peers.calculix_press import stiffness_n_per_mm

        stiff, unknowns = stiffness_n_per_mm(PROBE, PLAIN, finest_mm=0.1)
        yield Row(
            task="plain tissue, no inclusion",
            program="CalculiX",
            seconds=least(lambda: stiffness_n_per_mm(PROBE, PLAIN, finest_mm=0.1), 3),
            outcome=f"{unknowns} unknowns; stiffness differs by {abs(stiff * plain.approach_mm - 1):.2%}",
        )


def assembly() -> Iterator[Row]:
    """Element matrices of 1,184 quadratic elements."""
    yield Row(
        task="1,184 elements of nine nodes",
        program="tsis",
        seconds=least(element_matrices()),
        outcome="element matrices",
    )
    if has("scikit-fem"):
        from benchmarks.peers.skfem_assembly import assembled

        yield Row(
            task="1,184 elements of nine nodes",
            program=f"scikit-fem {metadata.version('scikit-fem')}",
            seconds=least(lambda: assembled(37, 32, 5.0, 0.49)),
            outcome="sparse matrix",
        )


def element_matrices() -> Callable[[], object]:
    """The call that computes them, by tsis."""
    body = mesh_rectangle(np.linspace(0.0, 10.0, 38), np.linspace(0.0, 10.0, 33), 2, a_is_radius=True)
    elements = np.concatenate([body.layer(index, body.nodes) for index in range(body.layers)])
    young, poisson = np.full(len(elements), 5.0), np.full(len(elements), 0.49)
    return lambda: stiffness(elements, 2, young, poisson)


def domed() -> Iterator[Row]:
    """The contact of a dome, which ends on the face or covers it."""
    kernel = PressKernel(DOMED, thickness_mm=30.0, poisson=0.49)
    both = kernel.probe_compliance + kernel.tissue_compliance(5.0)
    ones = np.ones(len(both))
    yield Row(
        task="contact of a dome",
        program="NumPy",
        seconds=least(lambda: [np.linalg.solve(both, ones) for _ in range(100)]) / 100,
        outcome=f"one linear solve of {len(both)} nodes, for comparison",
    )
    for force in (100.0, 1000.0):
        touch = partial(touched, kernel, both, force)
        yield Row(
            task="contact of a dome",
            program="tsis",
            seconds=least(lambda touch=touch: [touch() for _ in range(50)]) / 50,  # type: ignore[misc]
            outcome=f"{force / MN:g} N, contact to {touch().radius_mm:.2f} mm",
        )


def touched(kernel: PressKernel, both: NDArray[np.float64], force_mn: float) -> PartialContact:
    """One contact, once the compliances are known."""
    return kernel.contact.touch(both, force_mn, kernel.split(both, 5.0))


def finite_strain() -> Iterator[Row]:
    """Large deformations: a path to 0.75 N, and a soft sphere between plate and probe."""
    coarse, fine = (pair_change(order) for order in (4, 6))
    inner = np.linspace(0.0, PROBE.radius_mm, len(fine)) < 11.0
    off = np.abs(coarse - fine)[inner].max() / np.abs(fine[inner]).max()
    yield Row(
        task="path to 0.75 N with an inclusion, finite strain",
        program="tsis",
        seconds=least(lambda: ProbeOnSlab(PROBE, LUMP, FiniteResolution()).path((0.75,)), 3),
        outcome=f"the change differs by {off:.2%} from that of a mesh of order 6",
    )
    squeezed = partial(squeeze_path, PROBE, sphere_radius_mm=3.0, young_kpa=103.0)
    forces = (0.1, 0.3, 0.7, 1.2)
    yield Row(
        task="soft sphere between plate and probe, path to 1.2 N",
        program="tsis",
        seconds=least(lambda: squeezed(forces_n=forces), 1),
        outcome=f"{squeezed(forces_n=forces)[-1].approach_mm:.2f} mm of travel",
    )


def pair_change(order: int) -> NDArray[np.float64]:
    """What the inclusion changes at 0.75 N, paired on one mesh of elements of ``order``."""
    ((with_it, without),) = press_pairs(PROBE, LUMP, forces_n=(0.75,), resolution=FiniteResolution(order=order))
    return with_it.face_displacement_mm - without.face_displacement_mm


def three_dimensions() -> Iterator[Row]:
    """The solid model on the axis, where the axisymmetric one knows the answer, and beside it."""
    if not has("ngsolve"):
        return
    alike, plain = press(PROBE, LUMP, force_n=1.0), press(PROBE, PLAIN, force_n=1.0)
    beside = replace(LUMP, inclusion=replace(SPHERE, offset_mm=(3.0, 0.0)))
    for label, phantom in (("on the axis", LUMP), ("3 mm off it", beside)):
        start = time.perf_counter()
        found = press_solid(PROBE, phantom, force_n=1.0, threads=os.cpu_count() or 1)
        seconds = time.perf_counter() - start
        outcome = f"travel {found.approach_mm:.4f} mm"
        if phantom is LUMP:
            row = found.face_displacement_mm[found.y_mm.searchsorted(0.0)]
            along = np.interp(np.abs(found.x_mm), alike.radius_mm, alike.face_displacement_mm)
            change = np.interp(RADIUS, alike.radius_mm, alike.face_displacement_mm - plain.face_displacement_mm)
            inner = np.abs(found.x_mm) < 0.8 * PROBE.radius_mm
            outcome = f"differs by {np.abs(row - along)[inner].max() / change.max():.2%} of the change (r < 9.6 mm)"
        yield Row(
            task=f"sphere {label} in three dimensions", program="tsis with NGSolve", seconds=seconds, outcome=outcome
        )


def surrogate() -> Iterator[Row]:
    """Building it, and asking it."""
    start = time.perf_counter()
    built = build_surrogate(PROBE, cached=False)
    yield Row(
        task="surrogate of the default box",
        program="tsis",
        seconds=time.perf_counter() - start,
        outcome=f"231 slabs on {os.cpu_count()} cores; error {built.error:.3%} of the mean pressure",
    )
    count = 100_000
    rings, asked = twenty_rings(built), drawn_inclusions(count)
    seconds = least(lambda: rings(*asked))
    yield Row(
        task="profiles of 20 rings from the surrogate",
        program="tsis",
        seconds=seconds / count,
        outcome=f"{count / seconds / 1e6:.2f} million profiles/s",
    )


def twenty_rings(built: PressSurrogate) -> TissueSurrogate:
    """Mean pressures of 20 rings on one tissue."""
    return built.pressure_kpa.mapped(hats(built.radius_mm, np.linspace(0.0, 9.6, 20))).at_tissue(5.0, 30.0)


def drawn_inclusions(count: int) -> list[NDArray[np.float64]]:
    """Diameters, depths and moduli anywhere in the default box, each of shape (count,)."""
    rng = np.random.default_rng(2)
    return [rng.uniform(*interval, count) for interval in ((1.0, 15.0), (4.0, 12.0), (40.0, 120.0))]


def has(package: str) -> bool:
    """Whether a package is installed; says so where it is not."""
    try:
        metadata.version(package)
    except metadata.PackageNotFoundError:
        Console(stderr=True).print(f"{package} is not installed and left out")
        return False
    return True


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__)
    with threadpool_limits(limits=1, user_api="blas"):
        rows = [
            row
            for part in (small_strain, assembly, domed, finite_strain, three_dimensions, surrogate)
            for row in part()
        ]
    cells = [(row.task, row.program, duration(row.seconds), row.outcome) for row in rows]
    bench.table("Mechanics", ("task", "program", "time", "outcome"), cells)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
