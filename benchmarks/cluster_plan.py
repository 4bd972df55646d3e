"""What a sweep costs on more machines than one, computed from what was measured on this one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

PRESSES, BATCH, WORKERS = 1_000_000, 100, (8, 64, 512)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressCost:
    """One model of the press on one core.

    Attributes
    ----------
    model
        In words.
    seconds
        Mean processor time of a press of a new phantom.
    memory_mb
        Most that a process held while it pressed, MB.
    file_bytes
        Of a press in a data set with 25 radii a profile.
    """

    model: str
    seconds: float
    memory_mb: float
    file_bytes: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Overheads:
    """What is needed beside the presses.

    Attributes
    ----------
    press_s, shard_s
        Time of a worker for each press and each file: encoding, hashing, writing, flushing.
    start_s
        Until a new worker presses: starting Python, importing, compiled code read.
    task_rate
        Batches a second that scheduler and sweep hand out and take back with everything on this machine's cores.
    scheduler_s, client_s
        Processor time of the scheduler, and of the sweep that hands out, for each batch.
    task_bytes
        That cross the network for each batch, there and back.
    write_mb_s
        Rate at which one process writes files of a data set durably.
    """

    press_s: float
    shard_s: float
    start_s: float
    task_rate: float
    scheduler_s: float
    client_s: float
    task_bytes: float
    write_mb_s: float

    @property
    def most_tasks(self) -> float:
        """Batches a second where scheduler and sweep have a core each: the slower of the two rules."""
        return 1.0 / max(self.scheduler_s, self.client_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Planned:
    """A sweep by one model on so many workers.

    Attributes
    ----------
    model, workers
        What, and on how many.
    hours, core_hours
        Until it is done, and what the workers' cores cost; those of scheduler and sweep are not counted.
    efficiency
        Share of the workers' time that is spent in presses.
    tasks_s, files_mb_s, network_kb_s
        Batches a second, and what storage and network must take.
    limit
        What rules the time: ``"workers"`` or ``"scheduler"``.
    most_workers
        Workers at which the scheduler is as busy as can be.
    """

    model: str
    workers: int
    hours: float
    core_hours: float
    efficiency: float
    tasks_s: float
    files_mb_s: float
    network_kb_s: float
    limit: str
    most_workers: float


def planned(
    cost: PressCost, overheads: Overheads, workers: int, *, presses: int = PRESSES, batch: int = BATCH
) -> Planned:
    """The sweep's time: whole batches go round the workers, unless the scheduler cannot hand them out as fast.

    Examples
    --------
    >>> cost = PressCost(model="m", seconds=0.9, memory_mb=300.0, file_bytes=500.0)
    >>> free = Overheads(press_s=0.1, shard_s=0.0, start_s=0.0, task_rate=1.0, scheduler_s=0.01, client_s=0.005,
    ...                  task_bytes=1e3, write_mb_s=1.0)
    >>> one = planned(cost, free, 10, presses=36_000, batch=100)
    >>> one.hours, one.core_hours, round(one.efficiency, 3), one.limit, one.most_workers
    (1.0, 10.0, 0.9, 'workers', 10000.0)
    """
    shards = math.ceil(presses / batch)
    shard_s = batch * (cost.seconds + overheads.press_s) + overheads.shard_s
    by_workers = math.ceil(shards / workers) * shard_s
    by_scheduler = shards / overheads.most_tasks
    seconds = overheads.start_s + max(by_workers, by_scheduler)
    return Planned(
        model=cost.model,
        workers=workers,
        hours=seconds / 3600,
        core_hours=seconds * workers / 3600,
        efficiency=presses * cost.seconds / (seconds * workers),
        tasks_s=shards / seconds,
        files_mb_s=presses * cost.file_bytes / seconds / 1e6,
        network_kb_s=shards * overheads.task_bytes / seconds / 1e3,
        limit="workers" if by_workers >= by_scheduler else "scheduler",
        most_workers=overheads.most_tasks * shard_s,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ClusterPlan:
    """What was measured, and what follows for the million."""

    costs: tuple[PressCost, ...]
    overheads: Overheads
    presses: int = PRESSES
    batch: int = BATCH

    def rows(self, workers: Sequence[int] = WORKERS) -> Iterator[Planned]:
        """Every model on every number of workers."""
        for cost in self.costs:
            for count in workers:
                yield planned(cost, self.overheads, count, presses=self.presses, batch=self.batch)


def cost_cells(cost: PressCost) -> list[str]:
    """A line of the table of models."""
    return [
        cost.model,
        f"{1e3 * cost.seconds:,.1f} ms",
        f"{1 / cost.seconds:,.3g}",
        f"{cost.memory_mb:,.0f} MB",
        f"{cost.file_bytes:,.0f}",
    ]


def overhead_cells(found: Overheads) -> list[list[str]]:
    """The table of what is needed beside the presses."""
    return [
        ["a worker's time for each press beside it", f"{1e3 * found.press_s:.3f} ms"],
        ["a worker's time for each file", f"{1e3 * found.shard_s:.1f} ms"],
        ["start of a worker, until its first press", f"{found.start_s:.1f} s"],
        ["batches through scheduler and sweep, all on these cores", f"{found.task_rate:,.0f} a second"],
        ["processor time of the scheduler for each batch", f"{1e3 * found.scheduler_s:.2f} ms"],
        ["processor time of the sweep for each batch", f"{1e3 * found.client_s:.2f} ms"],
        ["so at most, with a core each", f"{found.most_tasks:,.0f} batches a second"],
        ["bytes over the network for each batch", f"{found.task_bytes:,.0f}"],
        ["durable writing by one process", f"{found.write_mb_s:.1f} MB/s"],
    ]


def plan_cells(row: Planned) -> list[str]:
    """A line of the table of hours."""
    return [
        row.model,
        str(row.workers),
        _short(row.hours),
        _short(row.core_hours),
        f"{row.efficiency:.1%}",
        _short(row.tasks_s),
        _short(row.files_mb_s),
        _short(row.network_kb_s),
        f"{row.limit} ({_short(row.most_workers)})",
    ]


def _short(value: float) -> str:
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
