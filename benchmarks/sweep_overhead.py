"""What a sweep costs a worker beside its presses, when a press takes 10 ms: the gaps between one press and the next.

    python -m benchmarks.sweep_overhead [--presses 1500] [--empty 100000]

One worker each, so that every gap counts: encoding, hashing, flushing to the disk, pipes. Presses tell when they began
and ended, so that the start of the worker and whatever else slows a press are left out. Beside it, in the same run:
`concurrent.futures` with the same batches, which writes nothing and survives nothing, and the bare loop. With
``--empty`` so many presses take no time: the processor time of all processes, over that of presses of 10 ms, is what a
sweep and Dask alone (a map over the same batches, nothing written) cost.
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
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.busy_press import PRESS_S, busy
from benchmarks.harness import Bench

from tsis.catalog.probes import load_probe
from tsis.sweep.data_set import read_data_set
from tsis.sweep.plan import Plan, Range
from tsis.sweep.run import run_sweep
from tsis.sweep.shards import sweep_batches

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from tsis.model.press import PressField
    from tsis.sweep.shards import SweepBatch


MOST_OVERHEAD, EMPTY_OVERHEAD = 0.03, 0.02


def let_workers_import() -> None:
    """Let processes that are started from now on find the presses of this folder."""
    root, found = str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "").split(os.pathsep)
    if root not in found:
        os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (root, *found)))


def _plan(count: int, batch: int = 100) -> Plan:
    tissue = Range(low=3.0, high=10.0)
    return Plan(
        probe=load_probe(),
        quantities={"tissue_young_kpa": tissue, "thickness_mm": 40.0},
        count=count,
        seed=1,
        batch=batch,
    )


def swept(count: int, batch: int) -> NDArray[np.float64]:
    """Beginning and end of each press, s."""
    with tempfile.TemporaryDirectory() as folder:
        run_sweep(_plan(count, batch), folder, workers=1, press=busy)
        found = read_data_set(folder)
    return np.column_stack([found["approach_mm"], found["pressure_kpa"][:, 0]])


def _press_batch(
    plan: Plan, batch: SweepBatch, *, press: Callable[..., PressField] = busy
) -> list[tuple[float, float]]:
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


def emptied(count: int) -> dict[str, tuple[float, float]]:
    """Processor and wall seconds of all processes for presses that take no time, a hundred a batch."""
    from benchmarks.sweep_costs import pressed_at_once

    dask: Any = import_module("distributed")
    plan, found = _plan(count), {}

    def by_dask() -> None:
        with (
            dask.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster,
            dask.Client(cluster) as client,
        ):
            work = partial(_press_batch, plan, press=pressed_at_once)
            client.gather(client.map(work, list(sweep_batches(plan)), pure=False))

    def by_tsis() -> None:
        with tempfile.TemporaryDirectory() as folder:
            run_sweep(plan, folder, workers=1, press=pressed_at_once)

    for name, work in {"tsis sweep": by_tsis, "Dask alone": by_dask}.items():
        before, began = _spent(), time.perf_counter()
        work()
        found[name] = (_spent() - before, time.perf_counter() - began)
    return found


def _spent() -> float:
    """Processor time of this process and of its children that have ended, s."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(part.ru_utime + part.ru_stime for part in both)


def main() -> int:
    """Print a table; 1 when the sweep costs more than it may."""
    bench = Bench(__doc__, presses=1500, empty=int)
    count = bench.presses
    let_workers_import()
    if bench.empty:
        costs = emptied(bench.empty)
        for name, (spent, wall) in costs.items():
            share = 100 * spent / (PRESS_S * bench.empty)
            print(f"{name:12s} {spent:7.1f} s of processors, {share:.2f} % of the presses; {wall:.1f} s")
        return int(costs["tsis sweep"][0] > EMPTY_OVERHEAD * PRESS_S * bench.empty)
    ways: dict[str, Callable[[int], NDArray[np.float64]]] = {
        "tsis sweep, 100 a file": partial(swept, batch=100),
        "tsis sweep, 20 a file": partial(swept, batch=20),
        "concurrent.futures, 100 a task": partial(_futures, batch=100),
        "concurrent.futures, 1 a task": partial(_futures, batch=1),
        "bare loop": _loop,
    }
    overhead = {}
    for name, work in ways.items():
        times = work(count)
        gaps = times[1:, 0] - times[:-1, 1]
        overhead[name] = gaps.sum() / (PRESS_S * len(gaps))
        longest = 1000 * gaps.max()
        print(f"{name:32s} {100 * overhead[name]:6.2f} % of the presses, longest gap {longest:6.1f} ms", flush=True)
    return int(overhead["tsis sweep, 100 a file"] > MOST_OVERHEAD)


if __name__ == "__main__":
    sys.exit(main())
