"""The workers of a sweep: processes here, or a Dask cluster."""

from __future__ import annotations

import asyncio
import logging
import re
import stat
import threading
import time
from collections import Counter
from concurrent.futures import FIRST_COMPLETED, CancelledError, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias
from uuid import uuid4

from tsis.errors import InputError, SweepError, import_extra
from tsis.files.atomic import write_durably
from tsis.processes import SpawnedProcess
from tsis.sweep.data_set import MANIFEST_FILE
from tsis.sweep.shards import LARGEST_SHARD_BYTES, Receipt, encode_shard, press_all, receipt_of, sha256, shard_name

if TYPE_CHECKING:
    from collections.abc import Callable
    from concurrent.futures import Future
    from typing import Self

    from tsis.sweep.plan import Plan
    from tsis.sweep.shards import PressFunction, SweepBatch


# Threads of one process have one setting of the threads of linear algebra, which determines the last digits.
_LOCK = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepJob:
    """Common data of all batches of a sweep: absolute path and key of the data set, plan, and press function."""

    folder: str
    plan: Plan
    data_set: str
    press: PressFunction


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """A complete file: computed now, kept from an earlier run, or repaired because it was damaged or foreign."""

    receipt: Receipt
    state: Literal["computed", "kept", "repaired"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lost:
    """The worker of this batch died."""

    batch: SweepBatch


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """The batch fails on every repetition, with the reason."""

    reason: str


Outcome: TypeAlias = Finished | Lost | Failed


def finish_batch(job: SweepJob, batch: SweepBatch) -> Finished | Failed:
    """Compute and write the batch's file unless it is complete; failures are outcomes, too."""
    try:
        with _LOCK:
            return _finish(job, batch)
    except SweepError as error:
        return Failed(reason=str(error))
    except OSError as error:
        reason = error.strerror or str(error)
        return Failed(reason=f"{shard_name(batch.shard)} must be readable and writable in the folder; got: {reason}")
    except Exception as error:  # without an answer the batch would be tried again and again
        return Failed(reason=f"{shard_name(batch.shard)} could not be computed: {type(error).__name__}: {error}")


def _finish(job: SweepJob, batch: SweepBatch) -> Finished:
    folder = Path(job.folder)
    if not (folder / MANIFEST_FILE).is_file():
        raise SweepError(f"the folder {job.folder!r} must be seen by every worker; one of them does not find it")
    path = folder / shard_name(batch.shard)
    present = _present(path)
    if present is not None:
        receipt = receipt_of(present, shard=batch.shard, data_set=job.data_set)
        if receipt is not None:
            return Finished(receipt=receipt, state="kept")
    rows = press_all(job.plan, batch, job.press)
    content = encode_shard(rows, shard=batch.shard, data_set=job.data_set)
    write_durably(path, content)
    receipt = Receipt(shard=batch.shard, sha256=sha256(content), rows=len(rows.error), refused=rows.refused)
    return Finished(receipt=receipt, state="computed" if present is None else "repaired")


def _present(path: Path) -> bytes | None:
    """The file's bytes; None when it is missing, empty when no sweep can have written it."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return path.read_bytes() if stat.S_ISREG(status.st_mode) and status.st_size <= LARGEST_SHARD_BYTES else b""


class WorkerPool(Protocol):
    """Workers that finish batches in any order."""

    @property
    def window(self) -> int:
        """Number of batches at a time: enough that no worker waits, never all."""
        ...

    def submit(self, batch: SweepBatch) -> None:
        """Submit a batch."""
        ...

    def collect(self) -> Outcome:
        """Wait for the next outcome."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(self, *_: object) -> None: ...


AHEAD = 3  # batches of a worker: one that it works on, one that waits there, and one that waits here
# Set before the libraries load, so that they create no pool of threads.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class LocalPool:
    """``count`` worker processes on this machine, for the batches of a job.

    Each worker is a pool of one process, so that the death of one breaks no other.
    """

    def __init__(self, job: SweepJob, count: int) -> None:
        self.window = AHEAD * count
        self._job = job
        self._workers = [SpawnedProcess(loads=__name__, environment=ONE_THREAD) for _ in range(count)]
        self._under_way: dict[Future[Finished | Failed], tuple[SpawnedProcess, SweepBatch]] = {}

    def submit(self, batch: SweepBatch) -> None:
        """Submit a batch to the worker that has the fewest."""
        busy = Counter(worker for worker, _ in self._under_way.values())
        worker = min(self._workers, key=lambda each: busy[each])
        try:
            future = worker.submit(finish_batch, self._job, batch)
        except BrokenProcessPool:  # it died while it waited
            worker = self._replaced(worker)
            future = worker.submit(finish_batch, self._job, batch)
        self._under_way[future] = worker, batch

    def collect(self) -> Outcome:
        """Wait for the next outcome."""
        future = next(iter(wait(self._under_way, return_when=FIRST_COMPLETED).done))
        worker, batch = self._under_way.pop(future)
        try:
            return future.result()
        except BrokenProcessPool:
            if worker in self._workers:
                self._replaced(worker)
            return Lost(batch=batch)
        except Exception as error:  # a press that a worker does not find
            return Failed(reason=f"a worker could not begin {shard_name(batch.shard)}: {type(error).__name__}: {error}")

    def __enter__(self) -> Self:
        begun = [worker.submit(import_module, "pyarrow.parquet") for worker in self._workers]
        if all(isinstance(future.exception(), BrokenProcessPool) for future in begun):
            self.__exit__()
            raise SweepError(
                "worker processes must start; they ended at once (a script must call run_sweep under "
                'if __name__ == "__main__", since each worker imports it)'
            )
        return self

    def __exit__(self, *_: object) -> None:
        for worker in self._workers:
            worker.end()  # a file is complete or absent, so nothing must be finished

    def _replaced(self, worker: SpawnedProcess) -> SpawnedProcess:
        worker.end()
        new = self._workers[self._workers.index(worker)] = SpawnedProcess(loads=__name__, environment=ONE_THREAD)
        return new


AHEAD_ON_CLUSTER = 2  # batches per thread of a worker
ADDRESS = re.compile(r"(tcp|tls)://[\w.\-\[\]:]+:\d{1,5}")
CONNECT_S = 10.0
WORKERS_S = 60.0
COUNT_EVERY_S = 5.0
LOGGERS = ("distributed", "distributed.client", "distributed.core", "distributed.batched")
CURE = "finished files are saved: start the cluster and run the same command again"


class DaskPool:
    """The workers of a Dask scheduler, which must all see the folder of the job.

    ``address`` is ``tcp://host:port`` or ``tls://host:port``, else `InputError`; ``work`` computes a batch on a worker.
    """

    def __init__(
        self, job: SweepJob, address: str, *, work: Callable[[SweepJob, SweepBatch], Outcome] = finish_batch
    ) -> None:
        if not ADDRESS.fullmatch(address):
            raise InputError(f"scheduler must be an address such as tcp://127.0.0.1:8786; got {address!r:.80}")
        self._distributed = import_extra("distributed", feature="a sweep on a cluster", extra="cluster")
        self._job, self._address, self._work = job, address, work
        self._run = uuid4().hex  # separates the results of an earlier client
        self._number = count()
        self._batches: dict[str, SweepBatch] = {}
        self._window, self._counted = 1, float("-inf")
        self._loggers = {logger: logger.level for logger in map(logging.getLogger, LOGGERS)}

    @property
    def window(self) -> int:
        """Number of batches at a time; follows the size of the cluster."""
        if time.monotonic() - self._counted > COUNT_EVERY_S:
            with suppress(OSError, TimeoutError, RuntimeError):
                self._window = AHEAD_ON_CLUSTER * max(1, sum(self._client.nthreads().values()))
            self._counted = time.monotonic()
        return self._window

    def submit(self, batch: SweepBatch) -> None:
        """Submit a batch."""
        key = f"tsis-sweep-{self._run}-{next(self._number)}"
        self._batches[key] = batch
        self._results.add(self._client.submit(self._work, self._job, batch, key=key, pure=False))

    def collect(self) -> Outcome:
        """Wait for the next outcome; `SweepError` when the scheduler is gone."""
        future = next(self._results)
        batch = self._batches.pop(future.key)
        try:
            outcome: Outcome = future.result(timeout=WORKERS_S)
        except (OSError, CancelledError, self._distributed.KilledWorker) as error:
            # A worker died more often than the scheduler allows, or a result was lost: try again.
            if self._client.status not in ("running", "connecting"):
                raise SweepError(f"the scheduler at {self._address} is gone; {CURE}") from error
            outcome = Lost(batch=batch)
        except Exception as error:
            # Faults of a batch are outcomes, so this is a fault of the cluster, e.g. workers without tsis.
            reason = f"{type(error).__name__}: {error!s:.200}"
            raise SweepError(f"the workers at {self._address} must have this version of tsis; got {reason}") from error
        finally:
            future.release()  # a scheduler that remembers every batch grows with the sweep
        return outcome

    def __enter__(self) -> Self:
        for logger in self._loggers:  # they would print tracebacks of connections that the sweep handles
            logger.setLevel(logging.CRITICAL)
        try:
            with ThreadPoolExecutor(1) as thread:  # a notebook's own thread runs a loop already
                thread.submit(asyncio.run, self._greet()).result()
            self._client: Any = self._distributed.Client(self._address, timeout=CONNECT_S, set_as_default=False)
        except Exception as error:  # another program may answer there, or TLS may lack its configuration
            self._restore_loggers()
            got = f"{type(error).__name__}: {error!s:.200}"
            raise SweepError(f"a Dask scheduler must answer at {self._address}; got {got} ({CURE})") from error
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_S)
        except (OSError, TimeoutError) as error:
            self.__exit__()
            raise SweepError(
                f"the scheduler at {self._address} must have a worker; got none in {WORKERS_S:g} s"
            ) from error
        self._results = self._distributed.as_completed(loop=self._client.loop)
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(Exception):  # a lost cluster cannot be closed
            self._client.close(timeout=CONNECT_S)
        self._restore_loggers()

    async def _greet(self) -> None:
        """Connect once and close: a client that meets another program leaves threads and messages behind."""
        security = self._distributed.Security().get_connection_args("client")
        connection = await self._distributed.comm.connect(self._address, timeout=CONNECT_S, **security)
        await connection.close()

    def _restore_loggers(self) -> None:
        for logger, level in self._loggers.items():
            logger.setLevel(level)
