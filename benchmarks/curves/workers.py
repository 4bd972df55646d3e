"""Presses a second of a sweep over the number of its workers."""

from __future__ import annotations

import tempfile
import time
from statistics import median
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.busy_press import busy
from benchmarks.curves.curve import Curve, Line
from benchmarks.sweep_overhead import let_workers_import

from tsis.catalog.probes import load_probe
from tsis.mechanics import press
from tsis.sweep.plan import Plan, Range
from tsis.sweep.run import run_sweep, worker_count

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.sweep.shards import PressFunction

BATCH, SHARDS_EACH, RUNS = 10, 15, 3
KINDS: dict[str, PressFunction] = {"presses of 10 ms that do nothing": busy, "flat probe, small strain": press}


def over_workers(told: Callable[[str], None]) -> Curve:
    """Once all workers have begun, as many files for each of them; medians of three runs."""
    let_workers_import()
    counts = sorted({1, 2, worker_count(None)})
    rates: dict[str, dict[int, list[float]]] = {name: {count: [] for count in counts} for name in KINDS}
    for run in range(RUNS):
        for name, kind in KINDS.items():
            for count in counts if run % 2 == 0 else reversed(counts):
                told(f"sweep, {count} workers, {name}")
                rates[name][count].append(_rate(kind, count, seed=run + 1))
    lines = tuple(
        Line(name=name, unit="presses/s", size=tuple(found), value=tuple(map(median, found.values())))
        for name, found in rates.items()
    )
    return Curve(title="Sweep", size_name="workers", lines=lines)


def efficiency(line: Line) -> tuple[float, ...]:
    """Rate a worker over the rate of one worker.

    Examples
    --------
    >>> efficiency(Line(name="n", unit="presses/s", size=(1, 2), value=(10.0, 15.0)))
    (1.0, 0.75)
    """
    alone = line.value[0] / line.size[0]
    return tuple(value / size / alone for size, value in zip(line.size, line.value, strict=True))


def sweep_plan(
    presses: int,
    *,
    batch: int = BATCH,
    probe: str = "tsis-2011",
    strain: str = "small",
    force_n: float = 1.0,
    seed: int = 1,
) -> Plan:
    """Inclusions of any size, depth and modulus that fit; what a large data set for training would hold."""
    return Plan(
        probe=load_probe(probe),
        quantities={
            "diameter_mm": Range(low=4.0, high=12.0),
            "depth_mm": Range(low=6.0, high=16.0),
            "young_kpa": Range(low=20.0, high=500.0, logarithmic=True),
            "tissue_young_kpa": 5.0,
            "thickness_mm": 40.0,
        },
        forces_n=(force_n,),
        strain=strain,
        count=presses,
        seed=seed,
        batch=batch,
    )


def _rate(kind: PressFunction, workers: int, seed: int) -> float:
    """Presses a second, from the file by which every worker has begun to the last but one of each."""
    shards, done = SHARDS_EACH * workers, list[tuple[float, int]]()
    with tempfile.TemporaryDirectory() as folder:
        run_sweep(
            sweep_plan(shards * BATCH, seed=seed),
            folder,
            workers=workers,
            press=kind,
            progress=lambda count, _: done.append((time.perf_counter(), count)),
        )
    kept = [each for each in done if 2 * workers <= each[1] <= shards - workers]
    moments, files = np.array(kept).T
    return float(np.polyfit(moments, files * BATCH, 1)[0])
