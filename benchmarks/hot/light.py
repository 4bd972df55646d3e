"""Light: modes of a guide, waves in a pressed one, rays through the probe."""

from __future__ import annotations

from typing import TYPE_CHECKING

from benchmarks.harness import Contest, Side, timed, version
from benchmarks.peers.mitsuba_cylinder import VARIANTS, paths_per_second
from benchmarks.rays import CLEAR
from benchmarks.slab_modes import CASES, by_peer

from tsis.optics import guided_modes
from tsis.optics.propagation import Dent, propagate, thin_guide
from tsis.optics.rays.tracing import trace_rays

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from benchmarks.harness import Place

GUIDE, RAYS, MODES = "10 µm, printed indices", 1e6, 12
NO_MITSUBA = "mitsuba is not installed, or does not run on this machine"


def modes(place: Place) -> Iterator[Contest]:
    """All guided modes of a thin guide."""
    stack = {name: CASES[GUIDE][name] for name in ("index", "thickness_um")} | {"polarization": "TE"}
    count = len(guided_modes(**stack, wavelength_um=0.55).n_eff)
    peers, absent = [], []
    for program in ("PyMoosh", "tidy3d"):
        found = by_peer(place.peer_python, program, {**stack, "count": count})
        if found is None:
            absent.append((program, "not installed, or does not run on this machine"))
            continue
        note = f"the other found {len(found['n_eff'])}"
        result = _told(place.peer_python, program, {**stack, "count": count})
        peers.append(Side(program=f"{program} {found['version']}", seconds=result, note=note))
    yield Contest(
        task=f"guided modes of {GUIDE}, TE",
        own=Side(
            program="tsis", seconds=timed(lambda: guided_modes(**stack, wavelength_um=0.55)), note=f"{count} modes"
        ),
        peers=tuple(peers),
        absent=tuple(absent),
    )


def _told(python: str, program: str, stack: dict[str, object]) -> Callable[[], float]:
    def seconds() -> float:
        found = by_peer(python, program, stack)
        if found is None:
            raise RuntimeError(f"{program} ran once and then no more")
        return float(found["seconds"])

    return seconds


def waves(_place: Place) -> Iterator[Contest]:
    """Beam propagation beside the frequency domain, whose march knows the modes of the flat guide already."""
    guide, dent = thin_guide("dissertation"), Dent(depth_um=4.0)
    marched = propagate(guide, dent, modes=MODES)
    guided = abs(marched.powers.guided.mean())
    solved: list[float] = []

    def solve() -> None:
        found = propagate(guide, dent, method="fdfd", modes=MODES)
        solved.append(abs(found.powers.guided.mean()))

    solve()
    yield Contest(
        task=f"waves under a dent of 4 µm, {MODES} modes",
        own=Side(
            program="tsis",
            seconds=timed(lambda: propagate(guide, dent, modes=MODES)),
            note=f"guided power {abs(guided - solved[0]):.4f} apart",
        ),
        peers=(Side(program=f"frequency domain, SciPy {version('scipy')}", seconds=timed(solve, once=True)),),
    )


def rays(place: Place) -> Iterator[Contest]:
    """A clear cylinder, all cores."""
    peers, absent = [], []
    for variant in VARIANTS:
        program = f"Mitsuba {version('mitsuba')}, {variant}"
        if version("mitsuba") is None or paths_per_second(variant, 1e5) is None:
            absent.append((f"Mitsuba, {variant}", NO_MITSUBA))
            continue
        peers.append(
            Side(program=program, seconds=_paths(variant), note="the other in single precision, without a tally")
        )
    yield Contest(
        task=f"{RAYS / 1e6:g} million rays through a clear cylinder, {place.cores} cores",
        own=Side(program="tsis", seconds=timed(lambda: trace_rays(CLEAR, None, rays=RAYS, threads=place.cores))),
        peers=tuple(peers),
        absent=tuple(absent),
    )


def _paths(variant: str) -> Callable[[], float]:
    def seconds() -> float:
        speed = paths_per_second(variant, RAYS)
        if speed is None:
            raise RuntimeError(f"mitsuba's {variant} ran once and then no more")
        return RAYS / speed

    return seconds
