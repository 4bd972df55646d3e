"""A sweep from its plan to its data set."""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.errors import MechanicsError, SweepError
from tsis.files.atomic import remove_unfinished
from tsis.mechanics import press as press_by_elements
from tsis.model.phantom import Phantom
from tsis.model.require import require_number
from tsis.sweep.data_set import as_folder, begun, data_set_key, head, write_manifest
from tsis.sweep.plan import TISSUE, extremes
from tsis.sweep.shards import Receipt, SweepBatch, press_all, shard_name, sweep_batches
from tsis.sweep.workers import DaskPool, Failed, LocalPool, Lost, SweepJob

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.sweep.plan import Plan
    from tsis.sweep.shards import PressFunction
    from tsis.sweep.workers import WorkerPool


MOST_WORKERS = 1024
# Lost batches in a row over the window: beyond it no worker lives long enough to finish one.
MOST_LOST = 10
TRIED, TRIED_S = 8, 3.0
GENTLE_N = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepSummary:
    """Summary of a run.

    Attributes
    ----------
    folder
        Absolute path of the data set.
    presses, refused
        Presses in it, and those that the model refused.
    shards
        Number of files.
    computed, kept
        Files computed in this run, and complete files of earlier runs.
    repaired
        Names of files that were damaged or foreign and were computed again; they count as computed.
    lost
        Batches whose worker died; another worker computed them.
    seconds
        Duration of the run.
    """

    folder: str
    presses: int
    refused: int
    shards: int
    computed: int
    kept: int
    repaired: tuple[str, ...]
    lost: int
    seconds: float


def run_sweep(
    plan: Plan,
    folder: str | os.PathLike[str],
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
    press: PressFunction = press_by_elements,
) -> SweepSummary:
    """Press all phantoms of a plan and write the data set, or finish that of an earlier run.

    The bytes of the data set depend on the plan, the versions of the libraries and the kind of processor only: not on
    the number of workers, their deaths, or interruptions of the run.

    Parameters
    ----------
    plan
        The plan.
    folder
        The data set: a new folder, or that of an earlier run of the same plan.
    workers
        Number of processes on this machine; None for one per processor.
    scheduler
        Address of a Dask scheduler whose workers are used instead, ``tcp://host:port``; they must see ``folder`` under
        the same path.
    progress
        Called with the number of finished and of all files.
    press
        Function for a press, importable by the workers.

    Raises
    ------
    FileInputError
        When the folder contains something else or another sweep writes into it.
    SweepError
        When the sweep cannot continue; a later call with the same arguments resumes it.
    """
    started = time.monotonic()
    count = worker_count(workers)
    start = head(plan)
    require_working_model(plan, press)
    root = as_folder(folder)
    job = SweepJob(folder=str(root), plan=plan, data_set=data_set_key(start), press=press)
    pool: WorkerPool = LocalPool(job, count) if scheduler is None else DaskPool(job, scheduler)
    with begun(root, start):
        with pool:
            done, lost = _finish_all(plan, pool, progress or (lambda *_: None))
        write_manifest(root, start, [receipt for receipt, _ in done.values()])
        remove_unfinished(root)
    states = Counter(state for _, state in done.values())
    return SweepSummary(
        folder=str(root),
        presses=sum(receipt.rows for receipt, _ in done.values()),
        refused=sum(receipt.refused for receipt, _ in done.values()),
        shards=len(done),
        computed=states["computed"] + states["repaired"],
        kept=states["kept"],
        repaired=tuple(shard_name(shard) for shard, (_, state) in sorted(done.items()) if state == "repaired"),
        lost=lost,
        seconds=time.monotonic() - started,
    )


def worker_count(workers: int | None) -> int:
    """Number of processes: ``workers``, or one per available processor.

    Raises
    ------
    InputError
        When it lies outside [1, 1024].
    """
    if workers is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return int(require_number("workers", workers, 1, MOST_WORKERS))


def require_working_model(plan: Plan, press: PressFunction = press_by_elements) -> None:
    """Refuse a plan whose model supports no press of this probe, before a million rows show it.

    A press of almost no force is quick in every model. What the model cannot solve is a row, here as in the sweep.

    Raises
    ------
    TsisError
        The model's error for such a press.
    """
    tissue = {name: extremes(plan.quantities[name])[1] for name in TISSUE}
    slab = Phantom(young_kpa=tissue["tissue_young_kpa"], thickness_mm=tissue["thickness_mm"], poisson=tissue["poisson"])
    with suppress(MechanicsError):
        press(plan.probe, slab, force_n=GENTLE_N, strain=plan.strain)


def seconds_per_press(plan: Plan, press: PressFunction = press_by_elements) -> float:
    """Mean time of the plan's first presses on this machine without the very first, s.

    Raises
    ------
    TsisError
        When the model supports no press of this probe.
    """
    require_working_model(plan, press)
    batch = next(sweep_batches(plan))
    started, done = time.perf_counter(), 0
    for k in range(min(TRIED, batch.samples)):
        sweep_batch = SweepBatch(
            shard=0, first=k, values={name: values[k : k + 1] for name, values in batch.values.items()}
        )
        press_all(plan, sweep_batch, press)
        done += len(plan.forces_n)
        if k == 0 and batch.samples > 1:
            started, done = time.perf_counter(), 0
        elif time.perf_counter() - started > TRIED_S:
            break
    return (time.perf_counter() - started) / done


def _finish_all(
    plan: Plan, workers: WorkerPool, progress: Callable[[int, int], None]
) -> tuple[dict[int, tuple[Receipt, str]], int]:
    """Compute every file; return receipts and states by file, and the number of lost batches."""
    left, again = sweep_batches(plan), deque[SweepBatch]()
    done: dict[int, tuple[Receipt, str]] = {}
    under_way = lost = in_a_row = 0
    progress(0, plan.shards)
    while len(done) < plan.shards:
        while under_way < workers.window and (batch := _next(left, again, workers.window)) is not None:
            workers.submit(batch)
            under_way += 1
        outcome = workers.collect()
        under_way -= 1
        if isinstance(outcome, Lost):
            again.append(outcome.batch)
            lost, in_a_row = lost + 1, in_a_row + 1
            if in_a_row >= MOST_LOST * workers.window:
                raise SweepError(_hopeless(in_a_row, outcome.batch))
        elif isinstance(outcome, Failed):
            raise SweepError(f"{outcome.reason} (finished files are saved)")
        else:
            done[outcome.receipt.shard] = (outcome.receipt, outcome.state)
            in_a_row = 0
            progress(len(done), plan.shards)
    return done, lost


def _next(left: Iterator[SweepBatch], again: deque[SweepBatch], most: int) -> SweepBatch | None:
    """The next batch; one that lost its worker comes last, because it may end every worker."""
    batch = None if len(again) > most else next(left, None)
    return again.popleft() if batch is None and again else batch


def _hopeless(lost: int, batch: SweepBatch) -> str:
    return (
        f"{lost} batches in a row lost their worker, the last one that of {shard_name(batch.shard)}, phantoms "
        f"{batch.first} to {batch.first + batch.samples - 1}; try a smaller batch, or fewer workers if memory is short "
        "(finished files are saved)"
    )
