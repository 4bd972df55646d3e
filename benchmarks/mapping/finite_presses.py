"""Judge the map at finite strain on neo-Hookean presses over a lump, and on plain tissue far from it.

    python -m benchmarks.mapping.finite_presses --lines FILE --seeds 501 502 503 504 --probe tsis-2011

The presses are `tsis.mechanics.finite_strain`'s own, axisymmetric: two forces over the lump's axis, and two on plain
tissue at places that no lump reaches. Presses beside a lump are not judged here. Tissue, thickness and forces err, with
noise. Each scan is mapped at small and at finite strain; the table compares them. Intervals have a probability of
90 %.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.harness import Bench, Choice, Several, append_line, read_lines
from benchmarks.mapping.reading import RINGS, SECTORS

import tsis
from tsis.inclusion.frames import OUTER_FRACTION
from tsis.inclusion.posterior.rings import ring_means
from tsis.mapping import estimate_map
from tsis.mapping.scan import Scan, ScanPress
from tsis.mechanics.finite_strain.neo_hookean_press import PressSeries

FORCES_N = {"tsis-2011": (0.5, 0.75), "tsis-domed": (0.6, 0.95)}
FAR_MM = 45.0
NOISE_KPA, FORCE_SD = 0.005, 0.01
STEPS = 6000
NAMES = ("centre_depth_mm", "diameter_mm", "contrast")
STRAINS = ("small", "finite")
WITHHELD = "map_does_not_fit"


def judged(seed: int, probe_name: str) -> dict[str, Any]:
    """One world at both strains."""
    rng, probe = np.random.default_rng([52, seed]), tsis.load_probe(probe_name)
    diameter, top = float(rng.uniform(6.0, 12.0)), float(rng.uniform(3.0, 9.0))
    contrast = float(np.exp(rng.uniform(np.log(3.0), np.log(20.0))))
    plain = tsis.Phantom(
        young_kpa=float(5.0 * np.exp(rng.normal(0.0, 0.05))),
        thickness_mm=float(30.0 * np.exp(rng.normal(0.0, 0.02))),
        poisson=0.49,
    )
    lump = tsis.Inclusion(diameter_mm=diameter, depth_mm=top, young_kpa=contrast * plain.young_kpa, poisson=0.49)
    series, edges = PressSeries(probe), np.linspace(0.0, OUTER_FRACTION * probe.radius_mm, RINGS + 1)
    presses = []
    for number, force in enumerate(FORCES_N[probe_name]):
        for phantom, place in ((replace(plain, inclusion=lump), (0.0, 0.0)), (plain, (FAR_MM, FAR_MM * number))):
            field = series.press(phantom, force_n=force)
            means = np.repeat((ring_means(field.radius_mm, edges) @ field.pressure_kpa)[:, None], SECTORS, axis=1)
            presses.append(
                ScanPress(
                    place_mm=place,
                    force_n=float(force * np.exp(rng.normal(0.0, FORCE_SD))),
                    pressure_kpa=means + rng.normal(0.0, NOISE_KPA, means.shape),
                    noise_kpa=NOISE_KPA,
                )
            )
    truth = (top + diameter / 2, diameter, contrast)
    scan = Scan(presses=tuple(presses), name=f"seed {seed}")
    found = {strain: _answer(scan, probe, strain, seed, truth) for strain in STRAINS}
    return {"key": f"{probe_name}-{seed}", "probe": probe_name, "seed": seed, "truth": truth, **found}


def _answer(scan: Scan, probe: tsis.Probe, strain: str, seed: int, truth: tuple[float, ...]) -> dict[str, Any]:
    result = estimate_map(scan, probe=probe, strain=strain, seed=seed, steps=STEPS, voxel_mm=4.0)
    near = [one for one in result.untrusted.lumps if np.hypot(*_place(one)) < 5.0]
    answer: dict[str, Any] = {
        "lumps": len(result.untrusted.lumps),
        "found": bool(near),
        "withheld": WITHHELD in result.flags,
    }
    if near:
        estimate = near[0].estimate.untrusted
        interval = estimate.interval(0.9)
        answer |= {"mean": [estimate.mean[name] for name in NAMES]}
        answer |= {"inside": [bool(interval[n][0] <= t <= interval[n][1]) for n, t in zip(NAMES, truth, strict=True)]}
        answer |= {"wide": [interval[name][1] - interval[name][0] for name in NAMES]}
    return answer


def _place(lump: Any) -> tuple[float, float]:
    mean = lump.estimate.untrusted.mean
    return mean["x_mm"], mean["y_mm"]


def rows(lines: list[dict[str, Any]]) -> list[tuple[object, ...]]:
    """A row a probe and strain."""
    result: list[tuple[object, ...]] = []
    for probe in FORCES_N:
        own = [line for line in lines if line["probe"] == probe]
        for strain in STRAINS if own else ():
            found = [line for line in own if line[strain]["found"]]
            error = np.array([np.subtract(line[strain]["mean"], line["truth"])[:2] for line in found]).reshape(-1, 2)
            inside = np.array([line[strain]["inside"] for line in found]).reshape(-1, 3).sum(axis=0)
            result.append(
                (
                    *(probe, strain, f"{len(found)} of {len(own)}", sum(line[strain]["withheld"] for line in own)),
                    sum(line[strain]["lumps"] - line[strain]["found"] for line in own),
                    *(f"{value:.2f}" for value in np.median(np.abs(error), axis=0).tolist()),
                    *(f"{value} of {len(found)}" for value in inside.tolist()),
                )
            )
    return result


HEADS = (
    *("probe", "strain", "found", "withheld", "false lumps", "depth, median error, mm", "diameter, median error, mm"),
    *("interval of depth holds", "of diameter", "of contrast"),
)

if __name__ == "__main__":
    bench = Bench(
        __doc__,
        lines=Path("finite-presses.jsonl"),
        seeds=Several(kind=int),
        probe=Choice(tuple(FORCES_N), "tsis-2011"),
    )
    done = read_lines(bench.lines, "key")
    for one in bench.seeds:
        if f"{bench.probe}-{one}" not in done:
            append_line(bench.lines, judged(one, bench.probe))
    bench.table(
        "A lump under the axis, neo-Hookean presses", HEADS, rows(list(read_lines(bench.lines, "key").values()))
    )
    raise SystemExit(bench.end([]))
