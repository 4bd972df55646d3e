"""Cost of a map as presses, lumps and voxels grow, on virtual scans; each map in a process of its own.

    python -m benchmarks.mapping.growth --lines FILE --places 5 10 20 --lumps 3 12 48 --voxel-mm 2 2 2

``places`` along x and along y at 10 mm, so many lumps at random under them, voxels so wide: a case each. The scans come
from the map's own kernel: they tell cost, and that nothing is lost between blocks, not truth.
"""

from __future__ import annotations

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.harness import Bench, Several, append_line, read_lines

import tsis
from tsis.mapping import estimate_map
from tsis.virtual.scan import VirtualLump, grid_places, virtual_scan

PROBE = "tsis-2011"
APART_MM = 18.0  # of lumps, across
NEAR_MM = 5.0  # a lump of the map is the true one
PLACE_SD_MM = 0.3
HEADS = ("presses", "lumps", "voxel, mm", "blocks", "processor, s", "wall, s", "memory, MB", "found", "false")


def drawn_lumps(places: int, count: int, rng: np.random.Generator) -> list[VirtualLump]:
    """Lumps of 7 to 11 mm and 25 to 80 kPa with tops at 4 to 8 mm under the presses."""
    lumps: list[VirtualLump] = []
    half = 5.0 * (places - 1)
    while len(lumps) < count:
        x, y = rng.uniform(-half, half, 2).tolist()
        if all(np.hypot(x - other.x_mm, y - other.y_mm) > APART_MM for other in lumps):
            depth, diameter, young = (float(rng.uniform(*ends)) for ends in ((4.0, 8.0), (7.0, 11.0), (25.0, 80.0)))
            lumps.append(VirtualLump(x_mm=x, y_mm=y, depth_mm=depth, diameter_mm=diameter, young_kpa=young))
    return lumps


def measured(places: int, count: int, voxel_mm: float, seed: int) -> dict[str, Any]:
    """One case: what the map took, less the scan's making."""
    rng = np.random.default_rng([seed, places, count])
    probe, lumps = tsis.load_probe(PROBE), drawn_lumps(places, count, rng)
    scan = virtual_scan(probe, lumps, grid_places(places, 10.0), rng=rng, place_sd_mm=PLACE_SD_MM)
    wall, processor = time.perf_counter(), time.process_time()
    found = estimate_map(scan, probe=probe, voxel_mm=voxel_mm, seed=seed)
    processor, wall = time.process_time() - processor, time.perf_counter() - wall
    means = [lump.estimate.untrusted.mean for lump in found.untrusted.lumps]
    there = np.array([[mean[name] for name in ("x_mm", "y_mm", "depth_mm")] for mean in means]).reshape(-1, 1, 3)
    truth = np.array([[lump.x_mm, lump.y_mm, lump.depth_mm] for lump in lumps]).reshape(1, -1, 3)
    near = np.linalg.norm(there - truth, axis=2) < NEAR_MM
    return {
        "key": f"{places}-{count}-{voxel_mm:g}",
        "presses": places**2,
        "lumps": count,
        "voxel_mm": voxel_mm,
        "blocks": found.provenance["blocks"],
        "processor_s": processor,
        "wall_s": wall,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "found": int(near.any(axis=0).sum()),
        "false": int((~near.any(axis=1)).sum()),
    }


def row(line: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table."""
    values = list(line.values())[1:]
    return tuple(f"{value:.0f}" if isinstance(value, float) and value > 10 else f"{value:g}" for value in values)


if __name__ == "__main__":
    bench = Bench(
        __doc__,
        lines=Path("growth.jsonl"),
        places=Several(kind=int),
        lumps=Several(kind=int),
        voxel_mm=Several(kind=float),
        seed=401,
    )
    for case in zip(bench.places, bench.lumps, bench.voxel_mm, strict=True):
        if "{}-{}-{:g}".format(*case) not in read_lines(bench.lines, "key"):
            with ProcessPoolExecutor(max_workers=1) as alone:
                append_line(bench.lines, alone.submit(measured, *case, bench.seed).result())
    bench.table("Growth", HEADS, [row(line) for line in read_lines(bench.lines, "key").values()])
    raise SystemExit(bench.end())
