"""The protocol of worker pools, and a pool of processes on this machine."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import threading
from collections import deque
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Protocol

from tsis.sweep._work import Lost

if TYPE_CHECKING:
    from typing import Self

    from tsis.sweep._shards import SweepBatch
    from tsis.sweep._work import Outcome, SweepJob


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


QUEUED_BATCHES = 2  # batches of one worker, so that it need not wait for the next
AHEAD = QUEUED_BATCHES + 1  # and one per worker that waits here
# -P: the working directory may contain a random.py or numpy.py of its own.
COMMAND = (sys.executable, "-P", "-m", "tsis.sweep._worker")
# Set before the libraries load, so that they create no pool of threads.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class LocalPool:
    """``count`` worker processes on this machine, for the batches of a job."""

    def __init__(self, job: SweepJob, count: int) -> None:
        self.window = AHEAD * count
        self._job = pickle.dumps(job)
        self._todo: SimpleQueue[SweepBatch | None] = SimpleQueue()
        self._results: SimpleQueue[Outcome] = SimpleQueue()
        self._stopping = False
        self._lock = threading.RLock()
        self._processes: set[subprocess.Popen[bytes]] = set()
        # After a death a spare worker is ready: workers that die sooner than they start would finish nothing.
        self._has_lost = False
        self._spare: subprocess.Popen[bytes] | None = None
        self._threads = [threading.Thread(target=self._supervise, daemon=True) for _ in range(count)]

    def submit(self, batch: SweepBatch) -> None:
        """Submit a batch."""
        self._todo.put(batch)

    def collect(self) -> Outcome:
        """Wait for the next outcome."""
        return self._results.get()

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(self, *_error: object) -> None:
        with self._lock:
            self._stopping = True
            for process in self._processes:
                process.kill()  # a file is complete or absent, so nothing must be finished
        for _ in self._threads:
            self._todo.put(None)
        for thread in self._threads:
            thread.join()
        for process in tuple(self._processes):
            self._end(process)

    def _supervise(self) -> None:
        """Run one process, and replace it when it dies."""
        process: subprocess.Popen[bytes] | None = None
        queued: deque[SweepBatch] = deque()  # batches of the process; it works on the first
        while not self._stopping:
            batch = self._next(wait=not queued)
            try:
                if batch is not None:
                    queued.append(batch)
                    process = process or self._started()
                    _hand_over(process, batch)
                    if len(queued) < QUEUED_BATCHES:
                        continue
                if process is not None and queued:
                    outcome = _outcome_of(process)
                    queued.popleft()
                    self._results.put(outcome)
            except Exception:  # an incomplete answer may raise anything; its worker is lost
                self._end(process)
                process, self._has_lost = None, True
                for lost in queued:
                    self._results.put(Lost(batch=lost))
                queued.clear()
        self._end(process)

    def _next(self, *, wait: bool) -> SweepBatch | None:
        try:
            return self._todo.get(block=wait)
        except Empty:
            return None

    def _started(self) -> subprocess.Popen[bytes]:
        """A process with the job: the spare one, or a new one."""
        with self._lock:
            if self._stopping:
                raise EOFError
            spare, self._spare = self._spare, None
            if spare is not None and spare.poll() is not None:  # a spare process may die, too
                self._end(spare)
                spare = None
            process = spare or self._launched()
            if self._has_lost:
                self._spare = self._launched()
        assert process.stdin is not None
        process.stdin.write(self._job)
        return process

    def _launched(self) -> subprocess.Popen[bytes]:
        process = subprocess.Popen(
            COMMAND,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | ONE_THREAD,
            # Ctrl-C on the terminal reaches the sweep only, which then ends its workers.
            process_group=0 if os.name == "posix" else None,
        )
        self._processes.add(process)
        return process

    def _end(self, process: subprocess.Popen[bytes] | None) -> None:
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                with suppress(OSError):  # unsent data has no reader any more
                    stream.close()
        with self._lock:
            self._processes.discard(process)


def _hand_over(process: subprocess.Popen[bytes], batch: SweepBatch) -> None:
    assert process.stdin is not None
    pickle.dump(batch, process.stdin)
    process.stdin.flush()


def _outcome_of(process: subprocess.Popen[bytes]) -> Outcome:
    assert process.stdout is not None
    outcome: Outcome = pickle.load(process.stdout)
    return outcome
