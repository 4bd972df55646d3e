"""A sweep from its plan to its data set: whatever dies on the way, the same bytes come out."""

from __future__ import annotations

import os
import time
from collections import Counter, deque
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.errors import MechanicsError, SweepError
from tsis.files import remove_unfinished
from tsis.mechanics import press as press_by_elements
from tsis.model import Phantom, require_number
from tsis.sweep._dask_pool import DaskPool
from tsis.sweep._data_set import as_folder, begun, data_set_key, head, write_manifest
from tsis.sweep._plan import TISSUE, extremes
from tsis.sweep._pools import LocalPool
from tsis.sweep._samples import SweepBatch, press_all, sweep_batches
from tsis.sweep._shards import Receipt, shard_name
from tsis.sweep._work import Failed, Lost, SweepJob

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.sweep._plan import Plan
    from tsis.sweep._pools import WorkerPool
    from tsis.sweep._samples import PressFunction


MOST_WORKERS = 1024
# So many times its window may a crew lose batches in a row: then no worker lives long enough to finish one.
MOST_LOST = 10
TRIED, TRIED_S = 8, 3.0
GENTLE_N = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepSummary:
    """What a sweep did.

    Attributes
    ----------
    folder
        Absolute path of the data set.
    presses, refused
        Presses in it, and how many of them the model refused.
    shards
        Number of files.
    computed, kept
        Files computed now, and files found whole.
    repaired
        Names of files that were damaged or foreign and were computed again; they count as computed.
    lost
        Batches whose worker died, which were given to another.
    seconds
        Time that the run took.
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
    """Press all phantoms of a plan and write the data set, or finish the one that an earlier run began.

    The bytes of the data set depend on the plan, the versions of the libraries and the kind of processor, and on
    nothing else: not on the workers, their number or their deaths, nor on how often the run was interrupted.

    Parameters
    ----------
    plan
        What to press.
    folder
        The data set: a new folder, or one that the same plan began.
    workers
        Number of processes on this machine; None for one a processor.
    scheduler
        Address of a Dask scheduler whose workers are used instead, ``tcp://host:port``; they must see ``folder`` under
        the same path.
    progress
        Called with the number of finished and of all files.
    press
        What computes a press; a function that workers can import.

    Raises
    ------
    FileInputError
        When the folder holds something else or another sweep writes into it.
    SweepError
        When the sweep cannot go on; the same call goes on from there later.
    """
    started = time.monotonic()
    count = worker_count(workers)
    start = head(plan)
    require_working_model(plan, press)
    position = as_folder(folder)
    job = SweepJob(folder=str(position), plan=plan, data_set=data_set_key(start), press=press)
    crew: WorkerPool = LocalPool(job, count) if scheduler is None else DaskPool(job, scheduler)
    with begun(position, start):
        with crew:
            done, lost = _finish_all(plan, crew, progress or (lambda *_: None))
        write_manifest(position, start, [receipt for receipt, _ in done.values()])
        remove_unfinished(position)
    states = Counter(state for _, state in done.values())
    return SweepSummary(
        folder=str(position),
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
    """Number of processes: as given, or one a processor that this process may use.

    Raises
    ------
    InputError
        When it is no number of processes that a machine may have.
    """
    if workers is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return int(require_number("workers", workers, 1, MOST_WORKERS))


def require_working_model(plan: Plan, press: PressFunction = press_by_elements) -> None:
    """Refuse a plan whose model takes no press of this probe at all, before a million rows say so.

    A press of almost no force is quick in every model. What a model cannot solve becomes a row, here as in the sweep.

    Raises
    ------
    TsisError
        What the model says of such a press.
    """
    tissue = {name: extremes(plan.quantities[name])[1] for name in TISSUE}
    slab = Phantom(young_kpa=tissue["tissue_young_kpa"], thickness_mm=tissue["thickness_mm"], poisson=tissue["poisson"])
    with suppress(MechanicsError):
        press(plan.probe, slab, force_n=GENTLE_N, strain=plan.strain)


def seconds_per_press(plan: Plan, press: PressFunction = press_by_elements) -> float:
    """Mean time of the plan's first presses on this machine, after one that warms up, s.

    Raises
    ------
    TsisError
        When the model takes no press of this probe.
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
    """Keep the crew busy until every file is there; receipts and states by file, and how many batches were lost."""
    left, again = sweep_batches(plan), deque[SweepBatch]()
    done: dict[int, tuple[Receipt, str]] = {}
    under_way = lost = in_a_row = 0
    progress(0, plan.shards)
    while len(done) < plan.shards:
        while under_way < workers.window and (batch := _next(left, again, workers.window)) is not None:
            workers.submit(batch)
            under_way += 1
        response = workers.collect()
        under_way -= 1
        if isinstance(response, Lost):
            again.append(response.batch)
            lost, in_a_row = lost + 1, in_a_row + 1
            if in_a_row >= MOST_LOST * workers.window:
                raise SweepError(_hopeless(in_a_row, response.batch))
        elif isinstance(response, Failed):
            raise SweepError(f"{response.reason} (the files that are done are kept)")
        else:
            done[response.receipt.shard] = (response.receipt, response.state)
            in_a_row = 0
            progress(len(done), plan.shards)
    return done, lost


def _next(left: Iterator[SweepBatch], again: deque[SweepBatch], most: int) -> SweepBatch | None:
    """The next batch; one that lost its worker waits for the others, because it may end every worker that it meets."""
    batch = None if len(again) > most else next(left, None)
    return again.popleft() if batch is None and again else batch


def _hopeless(lost: int, batch: SweepBatch) -> str:
    return (
        f"{lost} batches in a row lost their worker, the last one that of {shard_name(batch.shard)}, phantoms "
        f"{batch.first} to {batch.first + batch.samples - 1}; try a smaller batch, or fewer workers if memory is short "
        "(the files that are done are kept)"
    )
