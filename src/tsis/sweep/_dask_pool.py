"""Worker pool of an existing Dask cluster."""

from __future__ import annotations

import asyncio
import logging
import re
import time
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import suppress
from itertools import count
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from tsis.errors import InputError, SweepError, import_extra
from tsis.sweep._work import Lost, finish_batch

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Self

    from tsis.sweep._shards import SweepBatch
    from tsis.sweep._work import Outcome, SweepJob


AHEAD = 2  # batches per thread of a worker
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
                self._window = AHEAD * max(1, sum(self._client.nthreads().values()))
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
