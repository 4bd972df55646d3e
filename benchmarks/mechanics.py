"""How exact the mechanics are: against finer meshes of their own, against NGSolve, and in three dimensions.

    python -m benchmarks.mechanics

One thread. `benchmarks.speed` has the times of a press beside NGSolve, which comes with the extra fem3d; where it is
not installed it is left out by name.
"""

from __future__ import annotations

import os
import sys
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Bench, duration, missing, timed, version
from threadpoolctl import threadpool_limits

import tsis
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import press_pairs
from tsis.mechanics.finite_strain.patches import FiniteResolution
from tsis.mechanics.finite_strain.probe_on_slab import ProbeOnSlab
from tsis.mechanics.small_strain.linear_press import PressKernel
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.solid import press_solid
from tsis.model.phantom import Inclusion, Phantom

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

PROBE = tsis.load_probe("tsis-2011")
SPHERE = Inclusion(diameter_mm=10.0, depth_mm=5.0, young_kpa=100.0)
LUMP = Phantom(young_kpa=5.0, thickness_mm=30.0, inclusion=SPHERE)
PLAIN = LUMP.without_inclusion()
FAST = Resolution(order=3, edge=0.1, growth=3.0, largest=0.5, below_cells=1, ray_layers=4, ray_ratio=9.0)
FINE = Resolution(order=6, edge=0.006, growth=1.9, largest=0.17, below_cells=4, ray_layers=6)
MESHES = {"fast mesh": FAST, "default mesh": Resolution()}
RADIUS = np.linspace(0.0, 11.0, 45)
MN = 1000.0
Row = tuple[str, str, str]  # task, time, error


def slab_kernel(resolution: Resolution) -> PressKernel:
    """What presses of one slab share."""
    return PressKernel(PROBE, thickness_mm=30.0, poisson=0.49, resolution=resolution)


def solved(kernel: PressKernel, diameter: float, depth: float, young: float) -> NDArray[np.float64]:
    """Displacement of the face over an inclusion that is meshed anew, under 1 N."""
    slab = kernel.slab(diameter_mm=diameter, depth_mm=depth, poisson=0.49)
    return kernel.press(5.0, MN, slab.change(young / 5.0)).face_displacement_mm


def change_of_press(resolution: Resolution | None = None) -> NDArray[np.float64]:
    """What the reference inclusion changes in the displacement at `RADIUS`, mm."""
    with_it, plain = (press(PROBE, phantom, force_n=1.0, resolution=resolution) for phantom in (LUMP, PLAIN))
    return np.interp(RADIUS, with_it.radius_mm, with_it.face_displacement_mm - plain.face_displacement_mm)


def apart(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Largest difference over the largest value of the other."""
    return float(np.abs(one - other).max() / np.abs(other).max())


def small_strain() -> Iterator[Row]:
    """New inclusions (diameter, depth, modulus) against the same model's fine mesh, and one by NGSolve."""
    drawn = np.random.default_rng(1).uniform([2.0, 4.0, 40.0], [14.0, 12.0, 120.0], (40, 3)).tolist()

    def signals(kernel: PressKernel) -> NDArray[np.float64]:
        return np.array([solved(kernel, *one) for one in drawn]) - kernel.press(5.0, MN).face_displacement_mm

    exact = signals(slab_kernel(FINE))
    inner = np.linspace(0.0, PROBE.radius_mm, exact.shape[1]) < RADIUS[-1]
    for label, resolution in MESHES.items():
        kernel = slab_kernel(resolution)
        found = signals(kernel)
        seconds = timed(lambda kernel=kernel: signals(kernel))() / len(drawn)  # type: ignore[misc]
        errors = [apart(one[inner], other[inner]) for one, other in zip(found, exact, strict=True)]
        spread = f"median {np.median(errors):.2%}, worst {max(errors):.2%} of the change"
        yield f"press with a new inclusion, {label}", duration(seconds), spread
    if reason := missing("ngsolve"):
        yield "the same inclusion by NGSolve", "", reason
        return
    from benchmarks.peers.ngsolve_press import change_of_face

    off = apart(change_of_press(), change_of_face(PROBE, LUMP, RADIUS).face_displacement_mm)
    yield f"press, beside NGSolve {version('ngsolve')}", "", f"{off:.2%} of the change"


def finite_strain() -> Iterator[Row]:
    """What an inclusion changes at 0.75 N, paired on one mesh, beside a mesh of order 6."""

    def change(order: int) -> NDArray[np.float64]:
        ((with_it, without),) = press_pairs(PROBE, LUMP, forces_n=(0.75,), resolution=FiniteResolution(order=order))
        return with_it.face_displacement_mm - without.face_displacement_mm

    coarse, fine = change(4), change(6)
    inner = np.linspace(0.0, PROBE.radius_mm, len(fine)) < RADIUS[-1]
    seconds = timed(lambda: ProbeOnSlab(PROBE, LUMP, FiniteResolution()).path((0.75,)))()
    yield "path to 0.75 N, finite strain", duration(seconds), f"{apart(coarse[inner], fine[inner]):.2%} of the change"


def three_dimensions() -> Iterator[Row]:
    """The solid model on the axis, where the axisymmetric one knows the answer."""
    if missing("ngsolve"):
        return
    alike, began = press(PROBE, LUMP, force_n=1.0), perf_counter()
    found = press_solid(PROBE, LUMP, force_n=1.0, threads=os.cpu_count() or 1)
    seconds = perf_counter() - began  # the first call: what it solves is remembered
    row = found.face_displacement_mm[found.y_mm.searchsorted(0.0)]
    along = np.interp(np.abs(found.x_mm), alike.radius_mm, alike.face_displacement_mm)
    inner = np.abs(found.x_mm) < 0.8 * PROBE.radius_mm
    off = np.abs(row - along)[inner].max() / change_of_press().max()
    yield "sphere on the axis in three dimensions", duration(seconds), f"{off:.2%} of the change"


def main() -> int:
    """Measure and print."""
    bench = Bench(__doc__)
    with threadpool_limits(limits=1, user_api="blas"):
        rows = [row for part in (small_strain, finite_strain, three_dimensions) for row in part()]
    bench.table("Mechanics", ("task", "time", "error"), rows)
    return bench.end()


if __name__ == "__main__":
    sys.exit(main())
