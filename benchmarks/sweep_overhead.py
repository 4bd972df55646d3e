"""What a sweep costs a worker beside its presses, when a press takes 10 ms: the gaps between one press and the next.

    python -m benchmarks.sweep_overhead [--presses 1500] [--empty 100000] [--runs 3]

One worker each, so that every gap counts: encoding, hashing, flushing to the disk, pipes. Presses tell when they began
and ended, so that the start of the worker and whatever else slows a press are left out. Beside it, in the same run:
`concurrent.futures` with the same batches, which writes nothing and survives nothing, and the bare loop. With
``--empty`` so many presses take no time: the processor time of all processes, over that of presses of 10 ms, is what a
sweep and Dask alone (a map over the same batches, nothing written) cost. With ``--runs`` sweeps run by one worker and
by all cores: how many presses a second they make.
"""

from __future__ import annotations

import os
import resource
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.harness import Bench, Goal

from tsis.catalog.probes import load_probe
from tsis.mechanics import press
from tsis.model.press import PressField
from tsis.sweep.data_set import read_data_set
from tsis.sweep.plan import Plan, Range
from tsis.sweep.run import run_sweep, worker_count
from tsis.sweep.shards import sweep_batches

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe
    from tsis.sweep.shards import PressFunction, SweepBatch


MOST_OVERHEAD, EMPTY_OVERHEAD = 3.0, 2.0  # % of the presses
PRESS_S = 0.01
RADIUS_MM = np.linspace(0.0, 12.0, 241)
NOISE = np.random.default_rng(2).random(len(RADIUS_MM))  # numbers that hardly pack
BATCH, SHARDS_EACH = 10, 15  # presses a file, and files for each worker, where rates are measured
SPHERES = {
    "diameter_mm": Range(low=4.0, high=12.0),
    "depth_mm": Range(low=6.0, high=16.0),
    "young_kpa": Range(low=20.0, high=500.0, logarithmic=True),
    "tissue_young_kpa": 5.0,
    "thickness_mm": 40.0,
}
PLAIN = {"tissue_young_kpa": Range(low=3.0, high=10.0), "thickness_mm": 40.0}


def busy(_probe: Probe, _phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
    """Keep a processor busy for 10 ms; the travel is the time of the beginning, the pressure that of the end, s."""
    began = time.perf_counter()
    until = began + (PRESS_S if force_n > 1e-3 else 0.0)
    while time.perf_counter() < until:
        pass
    return PressField(
        radius_mm=RADIUS_MM,
        face_displacement_mm=RADIUS_MM,
        pressure_kpa=np.full(len(RADIUS_MM), time.perf_counter()),
        approach_mm=began,
        force_n=force_n,
    )


def at_once(_probe: Probe, _phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
    """A press that costs nothing."""
    return PressField(
        radius_mm=RADIUS_MM, face_displacement_mm=NOISE, pressure_kpa=NOISE, approach_mm=1.0, force_n=force_n
    )


def let_workers_import() -> None:
    """Let processes that are started from now on find the presses of this folder."""
    root, found = str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if root not in found:
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (root, *found)))


def _plan(count: int, batch: int = 100, *, quantities: dict[str, Any] = PLAIN, seed: int = 1) -> Plan:
    return Plan(probe=load_probe(), quantities=quantities, count=count, seed=seed, batch=batch)


def swept(count: int, batch: int) -> NDArray[np.float64]:
    """Beginning and end of each press, s."""
    with tempfile.TemporaryDirectory() as folder:
        run_sweep(_plan(count, batch), folder, workers=1, press=busy)
        found = read_data_set(folder)
    return np.column_stack([found["approach_mm"], found["pressure_kpa"][:, 0]])


def _press_batch(plan: Plan, batch: SweepBatch, *, press: PressFunction = busy) -> list[tuple[float, float]]:
    times = []
    for k in range(batch.samples):
        values = {name: float(column[k]) for name, column in batch.values.items()}
        field = press(plan.probe, plan.phantom(values), force_n=1.0, strain="small")
        times.append((field.approach_mm, float(field.pressure_kpa[0])))
    return times


def _loop(count: int) -> NDArray[np.float64]:
    plan = _plan(count)
    return np.concatenate([_press_batch(plan, batch) for batch in sweep_batches(plan)])


def _futures(count: int, batch: int) -> NDArray[np.float64]:
    plan = _plan(count, batch)
    with ProcessPoolExecutor(1) as pool:
        return np.concatenate(list(pool.map(partial(_press_batch, plan), sweep_batches(plan))))


def gaps(bench: Bench, count: int) -> list[Goal]:
    """Time between presses, by the sweep and by others."""
    ways: dict[str, Callable[[int], NDArray[np.float64]]] = {
        "tsis sweep, 100 a file": partial(swept, batch=100),
        "tsis sweep, 20 a file": partial(swept, batch=20),
        "concurrent.futures, 100 a task": partial(_futures, batch=100),
        "concurrent.futures, 1 a task": partial(_futures, batch=1),
        "bare loop": _loop,
    }
    overhead, rows = {}, []
    for name, work in ways.items():
        times = work(count)
        between = times[1:, 0] - times[:-1, 1]
        overhead[name] = 100 * between.sum() / (PRESS_S * len(between))
        rows.append((name, f"{overhead[name]:.2f} %", f"{1000 * between.max():.1f} ms"))
    bench.table(f"{count} presses of 10 ms", ("", "beside the presses", "longest gap"), rows)
    name = "tsis sweep, 100 a file"
    return [Goal(name=f"{name}: % of the presses", value=overhead[name], most=MOST_OVERHEAD, form="{:.2f}")]


def emptied(bench: Bench, count: int) -> list[Goal]:
    """Processor and wall seconds of all processes for presses that take no time, a hundred a batch."""
    dask: Any = import_module("distributed")
    plan, shares, rows = _plan(count), {}, []

    def by_dask() -> None:
        with (
            dask.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
            dask.Client(cluster) as client,
        ):
            work = partial(_press_batch, plan, press=at_once)
            client.gather(client.map(work, list(sweep_batches(plan)), pure=False))

    def by_tsis() -> None:
        with tempfile.TemporaryDirectory() as folder:
            run_sweep(plan, folder, workers=1, press=at_once)

    for name, work in {"tsis sweep": by_tsis, "Dask alone": by_dask}.items():
        before, began = _spent(), time.perf_counter()
        work()
        spent, wall = _spent() - before, time.perf_counter() - began
        shares[name] = 100 * spent / (PRESS_S * count)
        rows.append((name, f"{spent:.1f} s", f"{shares[name]:.2f} %", f"{wall:.1f} s"))
    bench.table(f"{count} presses that take no time", ("", "of processors", "of presses of 10 ms", "it took"), rows)
    dask_alone = f"Dask alone {shares['Dask alone']:.2f}"
    name, value = "empty presses: % of presses of 10 ms", shares["tsis sweep"]
    return [Goal(name=name, value=value, most=EMPTY_OVERHEAD, form="{:.2f}", peer=dask_alone)]


def _spent() -> float:
    """Processor time of this process and of its children that have ended, s."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(part.ru_utime + part.ru_stime for part in both)


def rates(bench: Bench, runs: int) -> None:
    """Presses a second by one worker and by all cores: medians of runs, in turns."""
    counts = sorted({1, worker_count(None)})
    kinds: dict[str, PressFunction] = {"presses of 10 ms that do nothing": busy, "flat probe, small strain": press}
    found: dict[tuple[str, int], list[float]] = {}
    for run in range(runs):
        for name, kind in kinds.items():
            for count in counts if run % 2 == 0 else reversed(counts):
                found.setdefault((name, count), []).append(_rate(kind, count, seed=run + 1))
    rows = [(name, *(f"{median(found[name, count]):.3g}" for count in counts)) for name in kinds]
    bench.table("Presses a second", ("", *(f"{count} workers" for count in counts)), rows)


def _rate(kind: PressFunction, workers: int, seed: int) -> float:
    """Presses a second, from the file by which every worker has begun to the last but one of each."""
    shards, done = SHARDS_EACH * workers, list[tuple[float, int]]()
    with tempfile.TemporaryDirectory() as folder:
        run_sweep(
            _plan(shards * BATCH, BATCH, quantities=SPHERES, seed=seed),
            folder,
            workers=workers,
            press=kind,
            progress=lambda count, _: done.append((time.perf_counter(), count)),
        )
    kept = [each for each in done if 2 * workers <= each[1] <= shards - workers]
    moments, files = np.array(kept).T
    return float(np.polyfit(moments, files * BATCH, 1)[0])


def main() -> int:
    """Print the tables; 1 when the sweep costs more than it may."""
    bench = Bench(__doc__, presses=1500, empty=int, runs=int)
    let_workers_import()
    goals = gaps(bench, bench.presses) if bench.presses else []
    if bench.empty:
        goals += emptied(bench, bench.empty)
    if bench.runs:
        rates(bench, bench.runs)
    return bench.end(goals)


if __name__ == "__main__":
    sys.exit(main())
