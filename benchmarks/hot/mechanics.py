"""Mechanics: presses of new phantoms, matrices of elements, profiles from the surrogate."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.harness import Contest, Side, missing, timed, version
from benchmarks.mechanics import (
    FAST,
    LUMP,
    PLAIN,
    PROBE,
    RADIUS,
    SPHERE,
    drawn_inclusions,
    element_matrices,
    slab_kernel,
    solved,
    twenty_rings,
)
from benchmarks.peers.chebyshev_rings import rings_by_numpy

from tsis.mechanics import press
from tsis.mechanics.small_strain.slab import Resolution
from tsis.mechanics.surrogate.building import build_surrogate

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from benchmarks.harness import Place

PROFILES = 20_000


def presses(_place: Place) -> Iterator[Contest]:
    """A slab whose probe is known, with an inclusion that is new."""
    reason = missing("ngsolve")
    for label, resolution in (("default mesh", Resolution()), ("fast mesh", FAST)):
        peers: tuple[Side, ...] = ()
        if not reason:
            from benchmarks.peers.ngsolve_press import change_of_face

            other = change_of_face(PROBE, LUMP, RADIUS).face_displacement_mm
            off = np.abs(_change(resolution) - other).max() / np.abs(other).max()
            peers = (
                Side(
                    program=f"NGSolve {version('ngsolve')}",
                    seconds=timed(lambda: change_of_face(PROBE, LUMP, RADIUS)),
                    note="the other meshes and solves from nothing",
                ),
            )
            apart = f"changes {off:.2%} apart"
        yield Contest(
            task=f"press with a new inclusion, {label}",
            own=Side(program="tsis", seconds=timed(_new_press(resolution)), note="" if reason else apart),
            peers=peers,
            absent=(("NGSolve", reason),) if reason else (),
        )


def _new_press(resolution: Resolution) -> Callable[[], object]:
    kernel = slab_kernel(resolution)
    return lambda: solved(kernel, SPHERE.diameter_mm, SPHERE.depth_mm, SPHERE.young_kpa)


def _change(resolution: Resolution) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    with_it, plain = (press(PROBE, one, force_n=1.0, resolution=resolution) for one in (LUMP, PLAIN))
    return np.interp(RADIUS, with_it.radius_mm, with_it.face_displacement_mm - plain.face_displacement_mm)


def plain_tissue(_place: Place) -> Iterator[Contest]:
    """A probe and a slab that are both new."""
    peers: tuple[Side, ...] = ()
    if shutil.which("ccx"):
        from benchmarks.peers.calculix_press import stiffness_n_per_mm

        peers = (
            Side(program="CalculiX", seconds=timed(lambda: stiffness_n_per_mm(PROBE, PLAIN, finest_mm=0.1), once=True)),
        )
    yield Contest(
        task="press of plain tissue, from nothing",
        own=Side(program="tsis", seconds=timed(lambda: slab_kernel(Resolution()).press(5.0, 1000.0))),
        peers=peers,
        absent=() if peers else (("CalculiX", "ccx is not installed"),),
    )


def elements(_place: Place) -> Iterator[Contest]:
    """Matrices of 1,184 quadratic elements."""
    reason = missing("scikit-fem", "skfem")
    peers: tuple[Side, ...] = ()
    if not reason:
        from benchmarks.peers.skfem_assembly import assembled

        peers = (
            Side(
                program=f"scikit-fem {version('scikit-fem')}",
                seconds=timed(lambda: assembled(37, 32, 5.0, 0.49)),
                note="the other also makes a sparse matrix",
            ),
        )
    yield Contest(
        task="stiffness of 1,184 elements of nine nodes",
        own=Side(program="tsis", seconds=timed(element_matrices())),
        peers=peers,
        absent=(("scikit-fem", reason),) if reason else (),
    )


def surrogate(_place: Place) -> Iterator[Contest]:
    """Profiles from the table of the default box, beside NumPy's evaluation of the same polynomial."""
    rings, asked = twenty_rings(build_surrogate(PROBE)), drawn_inclusions(PROFILES)
    by_numpy = rings_by_numpy(rings)
    off = float(np.abs(by_numpy(*asked) - rings(*asked)).max())
    yield Contest(
        task=f"{PROFILES:,} profiles of 20 rings from the surrogate",
        own=Side(program="tsis", seconds=timed(lambda: rings(*asked)), note=f"at most {off:.0e} kPa apart"),
        peers=(Side(program=f"NumPy {np.__version__}, chebval3d", seconds=timed(lambda: by_numpy(*asked))),),
    )
