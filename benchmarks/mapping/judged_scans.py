"""Judge the map on solved scans: a line of JSON a scan, then the table of the goals.

    python -m benchmarks.mapping.judged_scans --folder FOLDER --lines FILE --seeds 107 108 --place-sd 0.1

Lumps count as found where the map has one nearer than 5 mm; others of the map are false. Intervals have a
probability of 90 %. Lumps are counted towards the first goal where their diameter is at least 8 mm,
the top at most 10 mm deep, the contrast at least 3, the tissue uneven by at most 15 % and the centre within the
presses.
"""

from __future__ import annotations

import resource
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.harness import Bench, Goal, Several, append_line, read_lines
from benchmarks.mapping.reading import read_solved, truth_of

import tsis
from tsis.mapping import estimate_map

NEAR_MM = 5.0
BLIND_MM = 99.0  # where no size would be seen
PRESSES_NEAR = 4.5  # of a lump: within the radius of the face, at 10 mm
LEAST_CELLS = 20  # of the map of areas from which a frequency is told
NAMES = ("x_mm", "y_mm", "centre_depth_mm", "diameter_mm", "contrast")


def judged(path: Path, place_sd_mm: float) -> dict[str, Any]:
    """One scan: what was found, what was not, what was false."""
    truth = truth_of(path)
    scan = read_solved(path, place_sd_mm=place_sd_mm, seed=truth.seed)
    began = time.perf_counter(), time.process_time()
    result = estimate_map(scan, probe=tsis.load_probe(truth.probe), seed=truth.seed)
    seconds, processor = time.perf_counter() - began[0], time.process_time() - began[1]
    numbers = result.untrusted
    left = list(numbers.lumps)
    lumps = []
    for lump in truth.lumps:
        near = sorted(left, key=lambda one: _distance(one, lump))
        at = (lump[2] - lump[3] / 2, lump[1], lump[0])  # the top, as the blind zone tells it
        axes = (numbers.depth_mm, numbers.y_mm, numbers.x_mm)
        voxel = tuple(int(np.abs(axis - value).argmin()) for axis, value in zip(axes, at, strict=True))
        entry: dict[str, Any] = {
            "truth": lump,
            "found": bool(near) and _distance(near[0], lump) < NEAR_MM,
            "blind_mm": min(float(numbers.blind_diameter_mm[voxel]), BLIND_MM),
        }
        if entry["found"]:
            left.remove(near[0])
            posterior = near[0].estimate.untrusted
            interval = posterior.interval(0.9)
            entry["mean"] = [posterior.mean[name] for name in NAMES]
            entry["low"] = [interval[name][0] for name in NAMES]
            entry["high"] = [interval[name][1] for name in NAMES]
            entry["above"] = near[0].contrast_above
            entry["probability"] = near[0].probability
        lumps.append(entry)
    # reliability of the map of areas: predicted probability and whether a lump's centre lies there
    area = []
    for j, y in enumerate(numbers.y_mm.tolist()):
        for i, x in enumerate(numbers.x_mm.tolist()):
            if i % 5 == 2 and j % 5 == 2:
                inside = any(max(abs(lump[0] - x), abs(lump[1] - y)) <= numbers.area_mm / 2 for lump in truth.lumps)
                area.append([round(float(numbers.area_probability[j, i]), 4), int(inside)])
    return {
        "key": f"{truth.seed}-{place_sd_mm:g}",
        "seed": truth.seed,
        "place_sd_mm": place_sd_mm,
        "uneven": [truth.uneven_sd, truth.uneven_mm],
        "uneven_interval": list(numbers.unevenness.interval(0.9)["sd"]),
        "lumps": lumps,
        "false": [[*[one.estimate.untrusted.mean[name] for name in NAMES], one.probability] for one in left],
        "count_probability": numbers.count_probability.tolist(),
        "area": area,
        "flags": list(result.flags),
        "trusted": result.trusted,
        "seconds": seconds,
        "processor_s": processor,
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def _distance(found: Any, lump: tuple[float, ...]) -> float:
    mean = found.estimate.untrusted.mean
    return float(np.linalg.norm([mean[name] - value for name, value in zip(NAMES[:3], lump[:3], strict=True)]))


def goals(lines: list[dict[str, Any]]) -> list[Goal]:
    """The table of the goals from judged scans, those whose places err apart."""
    exact = [line for line in lines if line["place_sd_mm"] <= 0.2]
    result = [*(_exact_goals(exact) if exact else ()), *_erring_goals([line for line in lines if line not in exact])]
    return [replace(each, form="{:.2f}") for each in result]


def _exact_goals(exact: list[dict[str, Any]]) -> list[Goal]:
    lumps = [(line, lump) for line in exact for lump in line["lumps"]]
    easy = [
        lump["found"]
        for line, lump in lumps
        if lump["truth"][3] >= 8
        and lump["truth"][2] - lump["truth"][3] / 2 <= 10
        and lump["truth"][4] >= 3
        and line["uneven"][0] <= 0.15
        and max(map(abs, lump["truth"][:2])) <= 20
    ]
    found = [lump for _, lump in lumps if lump["found"]]
    truth = np.array([lump["truth"] for lump in found])
    mean, low, high = (np.array([lump[name] for lump in found]) for name in ("mean", "low", "high"))
    inside = (truth >= low) & (truth <= high)
    unnamed = [lump["blind_mm"] < lump["truth"][3] for _, lump in lumps if not lump["found"] and "blind_mm" in lump]
    pairs = [all(lump["found"] for lump in line["lumps"]) for line in exact if 900 <= line["seed"] < 1000]
    result = [
        Goal(name="lumps of d >= 8, top <= 10, contrast >= 3 found", value=float(np.mean(easy)), least=0.95),
        Goal(name="false lumps a scan", value=float(np.mean([len(line["false"]) for line in exact])), most=0.1),
        Goal(
            name="false lumps a blank scan",
            value=float(np.mean([len(line["false"]) for line in exact if not line["lumps"]])),
            most=0.1,
        ),
        Goal(
            name="place, median error, mm",
            value=float(np.median(np.hypot(*(mean - truth)[:, :2].T))),
            most=0.7,
        ),
        Goal(
            name="depth of the centre, median error, mm", value=float(np.median(np.abs((mean - truth)[:, 2]))), most=0.7
        ),
    ]
    for number, name in enumerate(NAMES):
        result.append(
            Goal(name=f"90 % intervals of {name} hold", value=float(inside[:, number].mean()), least=0.85, most=0.95)
        )
    if unnamed:
        result.append(Goal(name="share of missed lumps outside the drawn blind zone", value=float(np.mean(unnamed))))
    if pairs:
        result.append(Goal(name="pairs of 8 mm told apart", value=float(np.mean(pairs)), least=0.95))
    area = np.array([cell for line in exact for cell in line["area"]])
    for low_end, high_end in zip((0.0, 0.1, 0.5, 0.9), (0.1, 0.5, 0.9, 1.01), strict=True):
        some = area[(area[:, 0] >= low_end) & (area[:, 0] < high_end)]
        if len(some) >= LEAST_CELLS:
            gap = float(some[:, 1].mean() - some[:, 0].mean())
            name = f"areas of probability {low_end:g} to {min(high_end, 1.0):g}: frequency less probability"
            result.append(Goal(name=name, value=gap, least=-0.05, most=0.05))
    result.append(Goal(name="seconds a scan", value=float(np.median([line["seconds"] for line in exact])), most=60.0))
    result.append(Goal(name="memory, MB", value=float(max(line["memory_mb"] for line in exact)), most=1024.0))
    return result


def _erring_goals(lines: list[dict[str, Any]]) -> list[Goal]:
    result = []
    for sd in sorted({line["place_sd_mm"] for line in lines}):
        erring = [line for line in lines if line["place_sd_mm"] == sd]
        hits = [lump for line in erring for lump in line["lumps"] if lump["found"]]
        error = [np.hypot(lump["mean"][0] - lump["truth"][0], lump["mean"][1] - lump["truth"][1]) for lump in hits]
        result.append(
            Goal(
                name=f"false lumps a scan, places err by {sd:g} mm",
                value=float(np.mean([len(line["false"]) for line in erring])),
                most=0.1,
            )
        )
        result.append(
            Goal(
                name=f"place, rms error, places err by {sd:g} mm",
                value=float(np.sqrt(np.mean(np.square(error)))),
                most=1.5 * sd / np.sqrt(PRESSES_NEAR),
            )
        )
    return result


if __name__ == "__main__":
    bench = Bench(__doc__, folder=Path("scans"), lines=Path("judged.jsonl"), seeds=Several(kind=int), place_sd=0.1)
    done = read_lines(bench.lines, "key")
    for seed in bench.seeds:
        file = bench.folder / f"scan-{seed:04d}.npz"
        if f"{seed}-{bench.place_sd:g}" not in done and file.exists():
            append_line(bench.lines, judged(file, bench.place_sd))
    every = list(read_lines(bench.lines, "key").values())
    raise SystemExit(bench.end(goals(every)))
