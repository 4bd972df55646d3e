"""What a sweep costs, part by part: presses, what a worker does beside them, the scheduler, bytes, memory."""

from __future__ import annotations

import os
import pickle
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from benchmarks.busy_press import RADIUS_MM, busy
from benchmarks.cluster_plan import BATCH, ClusterPlan, Overheads, PressCost
from benchmarks.curves.workers import sweep_plan
from benchmarks.sweep_overhead import let_workers_import
from tests.sweep.loopback_cluster import LoopbackCluster

from tsis.files.atomic import write_durably
from tsis.mechanics import press
from tsis.model.press import PressField
from tsis.sweep.data_set import MANIFEST_FILE
from tsis.sweep.run import run_sweep
from tsis.sweep.shards import Receipt, SweepBatch, encode_shard, press_all, sweep_batches
from tsis.sweep.workers import AHEAD_ON_CLUSTER, DaskPool, Finished, SweepJob, finish_batch

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.model.phantom import Phantom
    from tsis.model.probe import Probe

# By model: probe, strain, force N, and how many presses are timed.
MODELS = {
    "flat, small strain": ("tsis-2011", "small", 1.0, 40),
    "domed, small strain": ("tsis-domed", "small", 1.0, 40),
    "flat, finite strain": ("tsis-2011", "finite", 0.75, 3),
    "domed, finite strain": ("tsis-domed", "finite", 0.75, 3),
}
BATCHES, REPEATS = (10, 50, 100, 200), 9
TASKS, WORKERS, THREADS = 2000, 2, 32
WRITES = 60
CONTENT = np.random.default_rng(1).bytes(50_000)  # as large as a file of a hundred presses
NOISE = np.random.default_rng(2).random(len(RADIUS_MM))


def measured_costs(told: Callable[[str], None]) -> ClusterPlan:
    """Everything that the plan is computed from."""
    let_workers_import()
    costs = []
    for model, (probe, strain, force_n, count) in MODELS.items():
        told(f"presses, {model}")
        with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
            seconds, memory_mb, size = pool.submit(_pressed, probe, strain, force_n, count).result()
        costs.append(PressCost(model=model, seconds=seconds, memory_mb=memory_mb, file_bytes=size))
    told("overhead of a worker")
    press_s, shard_s = worker_overhead()
    told("start of a worker")
    start_s = _start()
    told("scheduler")
    task_rate, scheduler_s, client_s = scheduler_rate()
    return ClusterPlan(
        costs=tuple(costs),
        overheads=Overheads(
            press_s=press_s,
            shard_s=shard_s,
            start_s=start_s,
            task_rate=task_rate,
            scheduler_s=scheduler_s,
            client_s=client_s,
            task_bytes=_task_bytes(),
            write_mb_s=_write_rate(),
        ),
    )


def _pressed(probe: str, strain: str, force_n: float, count: int) -> tuple[float, float, float]:
    """Mean processor seconds of a press after one that warms up, MB of memory, bytes a press in a file of a hundred."""
    plan = sweep_plan(count + 1, batch=count + 1, probe=probe, strain=strain, force_n=force_n)
    batch = next(sweep_batches(plan))
    parts = [
        SweepBatch(shard=0, first=part.start, values={name: values[part] for name, values in batch.values.items()})
        for part in (slice(0, 1), slice(1, count + 1))
    ]
    press_all(plan, parts[0], press)
    began = time.process_time()  # of one thread, and so what a core of one's own would take
    rows = press_all(plan, parts[1], press)
    seconds = (time.process_time() - began) / count
    if rows.refused:
        raise RuntimeError(f"presses of the plan must not be refused; got {rows.error}")
    many = type(rows)(
        sample=np.resize(rows.sample, BATCH),
        numbers={name: _more(values) for name, values in rows.numbers.items()},
        error=[""] * BATCH,
    )
    size = len(encode_shard(many, shard=0, data_set="0" * 64)) / BATCH
    return seconds, _most_memory_mb(), size


def _most_memory_mb() -> float:
    """Most that this process held; `resource` would tell that of its parent where it held more. Linux only."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024 / 1e6


def _more(
    values: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """A hundred rows out of fewer, each scaled a little so that no two can be packed as one."""
    repeated = np.resize(values, (BATCH, *values.shape[1:]))
    shades = 1 + 1e-6 * np.random.default_rng(1).random(BATCH)
    return np.asarray((repeated.T * shades).T)


def worker_overhead() -> tuple[float, float]:
    """Seconds a press and a file that a worker spends beside its presses: processor time, and waiting for the disk.

    A worker's own steps are run here with presses that cost nothing, in batches of several sizes, so that other work on
    the machine hardly changes what is found.
    """
    plans = [sweep_plan(batch * REPEATS, batch=batch) for batch in BATCHES]
    spent = []
    for plan in plans:
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / MANIFEST_FILE).touch()
            job = SweepJob(folder=folder, plan=plan, data_set="0" * 64, press=pressed_at_once)
            spent.append(float(np.median([_processor_time(job, batch) for batch in sweep_batches(plan)])))
    press_s, shard_s = np.polyfit(BATCHES, spent, 1)
    return max(float(press_s), 0.0), max(float(shard_s), 0.0) + _wait_for_disk()


def _processor_time(job: SweepJob, batch: SweepBatch) -> float:
    began = time.process_time()
    answer = finish_batch(job, batch)
    seconds = time.process_time() - began
    if isinstance(answer, Finished):
        return seconds
    raise RuntimeError(f"a batch of presses that cost nothing must be written; got {answer}")


def _wait_for_disk() -> float:
    """Median time to write a file durably, less the processor time of it, s."""
    waited = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(WRITES):
            began, worked = time.perf_counter(), time.process_time()
            write_durably(Path(folder) / str(number), CONTENT)
            waited.append(time.perf_counter() - began - (time.process_time() - worked))
    return float(np.median(waited))


def pressed_at_once(_probe: Probe, _phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
    """A press that costs nothing, whose numbers hardly pack."""
    return PressField(
        radius_mm=RADIUS_MM, face_displacement_mm=NOISE, pressure_kpa=NOISE, approach_mm=1.0, force_n=force_n
    )


def _start() -> float:
    """From the start of a sweep of one worker to its first file, less the presses in it, s."""
    began, heard = time.perf_counter(), list[float]()
    with tempfile.TemporaryDirectory() as folder:
        run_sweep(
            sweep_plan(2, batch=1),
            folder,
            workers=1,
            press=busy,
            progress=lambda count, _: heard.append(time.perf_counter()) if count else None,
        )
    return heard[0] - began


def answered_at_once(_job: SweepJob, batch: SweepBatch) -> Finished:
    """What a worker answers, without any work."""
    return Finished(
        receipt=Receipt(shard=batch.shard, sha256="0" * 64, rows=batch.samples, refused=0), state="computed"
    )


def scheduler_rate() -> tuple[float, float, float]:
    """Batches a second by the sweep's own crew when workers answer at once; processor time of scheduler and client."""
    plan = sweep_plan(TASKS * BATCH)
    job = SweepJob(folder="/", plan=plan, data_set="0" * 64, press=busy)
    with (
        tempfile.TemporaryDirectory() as folder,
        LoopbackCluster(Path(folder), WORKERS, THREADS) as cluster,
        DaskPool(job, cluster.address, work=answered_at_once) as crew,
    ):
        left = iter(list(sweep_batches(sweep_plan(TASKS * BATCH, batch=BATCH))))
        _wait_for(crew)
        for _ in range(crew.window):
            crew.submit(next(left))
        for _ in range(crew.window):  # connections are made, functions are sent
            crew.collect()
            crew.submit(next(left))
        before, began = (_processor_s(cluster.scheduler.pid), time.process_time()), time.perf_counter()
        done = 0
        for batch in left:
            crew.collect()
            crew.submit(batch)
            done += 1
        seconds = time.perf_counter() - began
        after = _processor_s(cluster.scheduler.pid), time.process_time()
        for _ in range(crew.window):
            crew.collect()
    return done / seconds, (after[0] - before[0]) / done, (after[1] - before[1]) / done


def _wait_for(crew: DaskPool) -> None:
    """Until all threads of all workers are known."""
    until = time.monotonic() + 60.0
    while crew.window < AHEAD_ON_CLUSTER * WORKERS * THREADS:
        if time.monotonic() > until:
            raise RuntimeError("the workers of the cluster did not come")
        time.sleep(0.2)


def _processor_s(process: int) -> float:
    """Processor time of another process, s."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _task_bytes() -> float:
    plan = sweep_plan(BATCH, batch=BATCH)
    batch = next(sweep_batches(plan))
    job = SweepJob(folder="/data", plan=plan, data_set="0" * 64, press=press)
    return float(len(pickle.dumps((job, batch))) + len(pickle.dumps(answered_at_once(job, batch))))


def _write_rate() -> float:
    """MB/s of files as large as those of a hundred presses, each flushed and renamed."""
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        for number in range(WRITES):
            write_durably(Path(folder) / str(number), CONTENT)
        return WRITES * len(CONTENT) / (time.perf_counter() - began) / 1e6
