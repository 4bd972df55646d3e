"""A domed probe by another code, at small and at finite strain: does `tsis.mechanics` find the same fields?

    python -m benchmarks.domed_second_code                          # both strains, beside the stored values
    python -m benchmarks.domed_second_code --states soft stiff      # finite strain alone
    python -m benchmarks.domed_second_code --again [--states soft]  # solve with NGSolve again (the extra fem3d)

The other codes are `benchmarks.peers.ngsolve_dome_linear` and `benchmarks.peers.ngsolve_dome`; what they find is kept
beside the tests that read it. A signal is the field with the inclusion less that without, on one mesh; each code has
its own. At small strain deviations are shares of the largest value over the face, at finite strain of the largest
signal within 0.95 of its radius, under the forces of `tsis.inclusion.tissue.protocol_forces`.
"""

from __future__ import annotations

import json
import sys
from dataclasses import asdict, dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Choice, Goal, Several
from benchmarks.peers.ngsolve_dome_mesh import Fineness

import tsis
from tsis.inclusion.tissue import protocol_forces
from tsis.mechanics import press
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries, press_pairs
from tsis.mechanics.finite_strain.patches import FiniteResolution

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.press import PressField

    Floats = NDArray[np.float64]

DATA = Path(__file__).parents[1] / "tests" / "mechanics" / "data"
SMALL_STRAIN, FINITE_STRAIN = DATA / "domed_second_code.json", DATA / "domed_second_code_finite.json"
PROBE = tsis.load_probe("tsis-domed")
# At small strain: tissue, spheres (diameter_mm, depth_mm, young_kpa), forces; at 0.2 N the contact ends inside the face
PLAIN = tsis.Phantom(young_kpa=5.0, thickness_mm=30.0)
SPHERES = ((10.0, 5.0, 100.0), (13.0, 5.0, 40.0))
FORCES_N = (0.2, 0.5, 1.0)
FACE_MM, FACE_HAT_MM = np.arange(0.0, 11.51, 0.5), 0.25
CURVES = ("plain_approach_mm", "approach_mm", "plain_w_mm", "plain_p_kpa", "dw_mm", "dp_kpa")
# At finite strain
RADIUS_MM = np.arange(0.0, 11.41, 0.3)  # to 0.95 of the face's radius
INNER_MM = 9.0  # beyond it pressures and what an inclusion changes about them rise steeply to the rim
INNER = int(np.searchsorted(RADIUS_MM, INNER_MM, side="right"))
HAT_MM = 0.5
MESHES = {
    "usual": Fineness(),
    "coarse": Fineness(skin=0.7, face=0.7, rim=0.16, sphere=2.0, layer=1.4, piece=0.7, rim_piece=0.08),
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


def at_radii(field: PressField, radius_mm: Floats, hat_mm: float) -> tuple[Floats, Floats]:
    """Displacements at radii, and pressures as means with the weight max(0, 1 - |r' - r| / hat_mm) r'."""
    radius = field.radius_mm
    hats = np.maximum(0.0, 1 - np.abs(radius - radius_mm[:, None]) / hat_mm) * radius
    moved = np.interp(radius_mm, radius, field.face_displacement_mm)
    return moved, np.asarray(hats @ field.pressure_kpa / hats.sum(axis=1))


def computed(**fineness: float) -> list[dict[str, Any]]:
    """All presses at small strain by the other code, each with its plain press on the same mesh."""
    from benchmarks.peers import ngsolve_dome_linear as linear

    cases, fine = [], replace(linear.Fineness(), **fineness)  # type: ignore[arg-type]
    for diameter, depth, young in SPHERES:
        code = linear.LinearPress(PROBE, PLAIN, diameter, depth, fine)
        for force in FORCES_N:
            bare = code.press(PLAIN.young_kpa, 1000 * force)
            solved = (bare, code.press(young, 1000 * force, bare))
            plain, full = (code.read(one, FACE_MM, FACE_HAT_MM) for one in solved)
            values = {
                "plain_approach_mm": plain.approach_mm,
                "approach_mm": full.approach_mm,
                "plain_contact_radius_mm": plain.contact_radius_mm,
                "contact_radius_mm": full.contact_radius_mm,
                "plain_w_mm": plain.displacement_mm,
                "plain_p_kpa": plain.pressure_kpa,
                "dw_mm": full.displacement_mm - plain.displacement_mm,
                "dp_kpa": full.pressure_kpa - plain.pressure_kpa,
            }
            sphere = {"diameter_mm": diameter, "depth_mm": depth, "young_kpa": young, "force_n": force}
            cases.append(sphere | _rounded(values, 7) | {"unknowns": code.space.ndof})
            print(f"d {diameter:g} h {depth:g} E {young:g} at {force:g} N: {code.space.ndof} unknowns", flush=True)
    return cases


def kernel(case: dict[str, Any]) -> dict[str, Any]:
    """The same case by `tsis.mechanics.press`."""
    sphere = tsis.Inclusion(**{name: case[name] for name in ("diameter_mm", "depth_mm", "young_kpa")})
    plain, full = (
        press(PROBE, phantom, force_n=case["force_n"]) for phantom in (PLAIN, replace(PLAIN, inclusion=sphere))
    )
    (bare_w, bare_p), (w, p) = (at_radii(field, FACE_MM, FACE_HAT_MM) for field in (plain, full))
    values = (plain.approach_mm, full.approach_mm, bare_w, bare_p, w - bare_w, p - bare_p)
    return dict(zip(CURVES, values, strict=True))


def deviations(found: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Largest deviation of every curve and value as a share of its largest value."""
    pairs = {name: (np.atleast_1d(found[name]), np.atleast_1d(reference[name])) for name in CURVES}
    return {name: float(np.abs(one - other).max() / np.abs(other).max()) for name, (one, other) in pairs.items()}


def small_strain(bench: Bench) -> None:
    """Print deviations at small strain, from values that are solved anew with ``--again``."""
    stored = json.loads(SMALL_STRAIN.read_text(encoding="utf-8"))
    if bench.again:
        cases, coarse = computed(), computed(face=0.25, rim=0.05, sphere=1.0, layer=1.7, softness=2e-4)
        apart = [_rounded(deviations(one, other), 2) for one, other in zip(coarse, cases, strict=True)]
        code = f"NGSolve {metadata.version('ngsolve')}, benchmarks/domed_second_code.py"
        meta = stored["small_strain"]["meta"] | {"code": code, "coarser_mesh_and_softer_contact_differ_by": apart}
        stored["small_strain"] = {"meta": meta, "cases": cases}
        SMALL_STRAIN.write_text(json.dumps(stored) + "\n", encoding="utf-8")
    rows = [
        (
            f"{case['diameter_mm']:g}, {case['depth_mm']:g}, {case['young_kpa']:g}",
            f"{case['force_n']:g}",
            *(f"{100 * value:.3f}" for value in deviations(kernel(case), case).values()),
        )
        for case in stored["small_strain"]["cases"]
    ]
    heads = ("d, h, E", "F (N)", "approach plain", "with", "w plain", "p plain", "dw", "dp")
    bench.table("small strain: largest deviation over the largest value, %", heads, rows)


def solved(name: str, mesh: str, say: Callable[[str], object]) -> list[dict[str, Any]]:
    """A case by the other code, one entry a force."""
    from benchmarks.peers.ngsolve_dome import presses

    case, fine = CASES[name], MESHES[mesh]
    fine = replace(fine, sphere=min(fine.sphere, case.triangle_mm))
    pairs = presses(PROBE, case.phantom, case.forces_n, RADIUS_MM, fine, say)
    return [
        {"force_n": force, "plain": _rounded(asdict(plain), 6), "full": _rounded(asdict(full), 6)}
        for force, (plain, full) in zip(case.forces_n, pairs, strict=True)
    ]


def _rounded(values: dict[str, Any], digits: int) -> dict[str, Any]:
    def short(value: Any) -> Any:
        return [short(one) for one in value] if np.ndim(value) else float(f"{value:.{digits}g}")

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
    moved, pressure = at_radii(field, RADIUS_MM, HAT_MM)
    return {"approach_mm": field.approach_mm, "displacement_mm": moved, "pressure_kpa": pressure}


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
    every: dict[str, dict[str, Any]] = (
        json.loads(FINITE_STRAIN.read_text(encoding="utf-8")) if FINITE_STRAIN.exists() else {}
    )
    stored = every.setdefault(mesh, {})
    lacking = [name for name in names if again or name not in stored]
    for name in lacking:
        stored[name] = solved(name, mesh, lambda text, name=name: print(name, text, file=sys.stderr))  # type: ignore[misc]
        FINITE_STRAIN.write_text(json.dumps(every) + "\n", encoding="utf-8")
    return stored


def _setting(text: str) -> tuple[str, Any]:
    name, value = text.split("=")
    return name, json.loads(value)


def finite_strain(bench: Bench) -> Goal:
    """Print deviations at finite strain, from stored states and those that lack; the largest of a signal."""
    states = bench.states or list(CASES)
    stored = completed(states, bench.mesh, again=bench.again)
    beside = completed(states, bench.beside, again=False) if bench.beside else {}
    finer = FiniteResolution(**dict(map(_setting, bench.resolution))) if bench.resolution else None
    rows, worst = [], 0.0
    for name in states:
        ours = beside[name] if beside else own(name, finer)
        for one, other in zip(ours, stored[name], strict=True):
            rows.append(row(name, one, other))
            fields = ("pressure_kpa", "displacement_mm")
            worst = max(worst, *(deviation(one, other, field).largest for field in fields))
    bench.table("finite strain: deviations of the signals, of their peak", HEADINGS, rows)
    return Goal(name="finite strain: largest deviation, % of a signal", value=100 * worst, most=1.0, form="{:.2f}")


def main() -> int:
    """Print the tables; the exit code is 1 when a signal at finite strain deviates by more than 1 % of its peak."""
    bench = Bench(
        __doc__,
        states=Several(CASES),
        mesh=Choice(MESHES, "usual"),
        again=False,
        resolution=Several(),
        beside=Choice(MESHES),
    )
    if not bench.states:
        small_strain(bench)
    return bench.end([finite_strain(bench)])


if __name__ == "__main__":
    sys.exit(main())
