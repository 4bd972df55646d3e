"""A domed probe pressed at finite strain, by another code: does the contact of `tsis.mechanics` find the same fields?

    python -m benchmarks.domed_second_code_finite                      # all states, beside the stored values
    python -m benchmarks.domed_second_code_finite --states soft stiff
    python -m benchmarks.domed_second_code_finite --again              # solve with NGSolve again (the extra fem3d)

The other code is `benchmarks.peers.ngsolve_dome`. States without a stored value are solved and stored one by one, so
that an interrupted run goes on where it stopped. Forces are those of `tsis.inclusion.tissue.protocol_forces`. A signal
is the field with the inclusion less that without, on one mesh; each code has its own. Deviations are shares of the
largest signal within 0.95 of the face's radius.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Choice, Goal, Several
from benchmarks.peers.ngsolve_dome_mesh import Fineness
from rich.console import Console
from rich.progress import Progress, TextColumn, TimeElapsedColumn

import tsis
from tsis.inclusion.tissue import protocol_forces
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries, press_pairs
from tsis.mechanics.finite_strain.patches import FiniteResolution

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.press import PressField

    Floats = NDArray[np.float64]

STORED = Path(__file__).parents[1] / "tests" / "mechanics" / "data" / "domed_second_code_finite.json"
PROBE = tsis.load_probe("tsis-domed")
RADIUS_MM = np.arange(0.0, 11.41, 0.3)  # to 0.95 of the face's radius
INNER_MM = 9.0  # beyond it pressures and what an inclusion changes about them rise steeply to the rim
INNER = int(np.searchsorted(RADIUS_MM, INNER_MM, side="right"))
HAT_MM = 0.5  # pressures are means with the weight max(0, 1 - |r' - r| / HAT_MM) r'
MESHES = {
    "usual": Fineness(),
    "coarse": Fineness(skin=0.7, face=0.7, rim=0.16, sphere=2.0, layer=1.4, piece=0.7, rim_piece=0.08),
    "fine": Fineness(
        skin=0.35, face=0.35, rim=0.09, sphere=1.1, layer=0.8, piece=0.35, rim_piece=0.045, softness_mm=1e-3
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Tissue and sphere, in kPa and mm."""

    tissue_kpa: float
    diameter_mm: float
    depth_mm: float
    contrast: float
    thickness_mm: float = 30.0
    triangle_mm: float = np.inf  # largest in the sphere, of the other code

    @property
    def phantom(self) -> Phantom:
        """The slab with its sphere."""
        young = self.contrast * self.tissue_kpa
        sphere = tsis.Inclusion(diameter_mm=self.diameter_mm, depth_mm=self.depth_mm, young_kpa=young)
        return tsis.Phantom(young_kpa=self.tissue_kpa, thickness_mm=self.thickness_mm, inclusion=sphere)

    @property
    def forces_n(self) -> tuple[float, ...]:
        """The protocol's forces."""
        return protocol_forces(PROBE, tissue_young_kpa=self.tissue_kpa, thickness_mm=self.thickness_mm)


CASES = {
    "medium": Case(tissue_kpa=5, diameter_mm=10, depth_mm=5, contrast=20),
    "soft": Case(tissue_kpa=2, diameter_mm=10, depth_mm=5, contrast=20),
    "stiff": Case(tissue_kpa=30, diameter_mm=10, depth_mm=5, contrast=5),
    "small": Case(tissue_kpa=5, diameter_mm=4, depth_mm=3, contrast=20, triangle_mm=0.5),
    "large": Case(tissue_kpa=8, diameter_mm=22, depth_mm=5, contrast=6, thickness_mm=40),
    "shallow": Case(tissue_kpa=5, diameter_mm=8, depth_mm=2, contrast=10),
    "deep": Case(tissue_kpa=10, diameter_mm=14, depth_mm=16, contrast=10, thickness_mm=40),
    "faint": Case(tissue_kpa=20, diameter_mm=12, depth_mm=6, contrast=1.5),
    "wide": Case(tissue_kpa=3, diameter_mm=18, depth_mm=6, contrast=8, thickness_mm=35),
    "far": Case(tissue_kpa=20, diameter_mm=6, depth_mm=15, contrast=10, triangle_mm=0.8),
}


def solved(name: str, mesh: str, say: Callable[[str], object]) -> list[dict[str, Any]]:
    """A case by the other code, one entry a force."""
    from benchmarks.peers.ngsolve_dome import presses

    case, fine = CASES[name], MESHES[mesh]
    fine = replace(fine, sphere=min(fine.sphere, case.triangle_mm))
    pairs = presses(PROBE, case.phantom, case.forces_n, RADIUS_MM, fine, say)
    return [
        {"force_n": force, "plain": _rounded(asdict(plain)), "full": _rounded(asdict(full))}
        for force, (plain, full) in zip(case.forces_n, pairs, strict=True)
    ]


def _rounded(values: dict[str, Any]) -> dict[str, Any]:
    def short(value: Any) -> Any:
        return [short(one) for one in value] if np.ndim(value) else float(f"{value:.6g}")

    return {name: short(value) for name, value in values.items()}


def own(name: str, finer: FiniteResolution | None = None) -> list[dict[str, dict[str, Any]]]:
    """A case by tsis, one entry a force: by `PressSeries`, or by load paths on another mesh."""
    case = CASES[name]
    if finer is None:
        series = PressSeries(PROBE)
        slabs = (replace(case.phantom, inclusion=None), case.phantom)
        pairs = [tuple(series.press(slab, force_n=force) for slab in slabs) for force in case.forces_n]
    else:
        both = press_pairs(PROBE, case.phantom, forces_n=case.forces_n, resolution=finer)
        pairs = [(without, with_it) for with_it, without in both]
    return [{"plain": _at_radii(plain), "full": _at_radii(full)} for plain, full in pairs]


def _at_radii(field: PressField) -> dict[str, Any]:
    radius = field.radius_mm
    hats = np.maximum(0.0, 1 - np.abs(radius - RADIUS_MM[:, None]) / HAT_MM) * radius
    return {
        "approach_mm": field.approach_mm,
        "displacement_mm": np.interp(RADIUS_MM, radius, field.face_displacement_mm),
        "pressure_kpa": hats @ field.pressure_kpa / hats.sum(axis=1),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """Of one field, as shares of the other code's largest signal."""

    peak: float
    largest: float  # of the signal
    inner: float  # of the signal within `INNER_MM`
    rms: float  # of the signal
    whole: float  # largest of the whole field with the inclusion


def deviation(one: dict[str, Any], other: dict[str, Any], field: str) -> Deviation:
    """Of ``one`` code's pressures or displacements from the ``other``'s."""
    plain, full = (np.asarray(one[which][field]) for which in ("plain", "full"))
    plain_too, full_too = (np.asarray(other[which][field]) for which in ("plain", "full"))
    signal = full_too - plain_too
    peak, apart = float(np.abs(signal).max()), np.abs(full - plain - signal)
    return Deviation(
        peak=peak,
        largest=float(apart.max()) / peak,
        inner=float(apart[:INNER].max()) / peak,
        rms=float(np.sqrt((apart**2).mean())) / peak,
        whole=float(np.abs(full - full_too).max()) / peak,
    )


def row(name: str, one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """A line of the table."""
    case, cells = CASES[name], []
    for field in ("pressure_kpa", "displacement_mm"):
        apart = deviation(one, other, field)
        cells.append(f"{apart.peak:.3g}")
        cells += [f"{100 * share:.2f}" for share in (apart.largest, apart.inner, apart.rms, apart.whole)]
    travel = max(abs(one[which]["approach_mm"] / other[which]["approach_mm"] - 1) for which in ("plain", "full"))
    force = max(abs(other[which]["force_mn"] / other["force_n"] / 1000 - 1) for which in ("plain", "full"))
    sphere = f"{case.tissue_kpa:g}; {case.diameter_mm:g}, {case.depth_mm:g}, {case.contrast:g}; {case.thickness_mm:g}"
    return [f"{name}: {sphere}", f"{other['force_n']:g}", *cells, f"{100 * travel:.2f}", f"{100 * force:.3f}"]


HEADINGS = [
    "tissue; d, h, contrast; thickness",
    "F (N)",
    *("dp (kPa)", "largest %", f"to {INNER_MM:g} mm %", "RMS %", "whole p %"),
    *("dw (mm)", "largest %", f"to {INNER_MM:g} mm %", "RMS %", "whole w %"),
    "travel %",
    "sum of forces %",
]


def completed(names: list[str], mesh: str, *, again: bool) -> dict[str, list[dict[str, Any]]]:
    """Stored states of a mesh; what lacks is solved and stored."""
    every: dict[str, dict[str, Any]] = json.loads(STORED.read_text(encoding="utf-8")) if STORED.exists() else {}
    stored = every.setdefault(mesh, {})
    lacking = [name for name in names if again or name not in stored]
    columns = (*Progress.get_default_columns(), TimeElapsedColumn(), TextColumn("{task.fields[now]}"))
    with Progress(*columns, console=Console(stderr=True), disable=not lacking) as progress:
        bar = progress.add_task("states", total=len(lacking), now="")

        def say(name: str, text: str) -> None:
            progress.update(bar, now=f"{name}: {text}")

        for name in lacking:
            stored[name] = solved(name, mesh, partial(say, name))
            progress.advance(bar)
            STORED.write_text(json.dumps(every) + "\n", encoding="utf-8")
    return stored


def _setting(text: str) -> tuple[str, Any]:
    name, value = text.split("=")
    return name, json.loads(value)


def main() -> int:
    """Print a table; the exit code is 1 when a signal deviates by more than 1 % of its peak."""
    bench = Bench(
        __doc__,
        states=[*list(CASES)],
        mesh=Choice(MESHES, "usual"),
        again=False,
        resolution=Several(),
        beside=Choice(MESHES),
    )
    stored = completed(bench.states, bench.mesh, again=bench.again)
    beside = completed(bench.states, bench.beside, again=False) if bench.beside else {}
    finer = FiniteResolution(**dict(map(_setting, bench.resolution))) if bench.resolution else None
    rows, worst = [], 0.0
    for name in bench.states:
        ours = beside[name] if beside else own(name, finer)
        for one, other in zip(ours, stored[name], strict=True):
            rows.append(row(name, one, other))
            fields = ("pressure_kpa", "displacement_mm")
            worst = max(worst, *(deviation(one, other, field).largest for field in fields))
            print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    bench.table("deviations of the signals, of their peak", HEADINGS, rows)
    return bench.end([Goal(name="largest deviation, % of the peak signal", value=100 * worst, most=1.0, form="{:.2f}")])


if __name__ == "__main__":
    sys.exit(main())
