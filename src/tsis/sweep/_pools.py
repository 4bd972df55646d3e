"""What a sweep needs of its workers, be they processes of this machine or of a cluster."""

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
    from types import TracebackType
    from typing import Self

    from tsis.sweep._samples import SweepBatch
    from tsis.sweep._work import Outcome, SweepJob


class WorkerPool(Protocol):
    """Workers that finish batches in any order."""

    @property
    def window(self) -> int:
        """How many batches it should hold at a time: enough that no worker waits, never all."""
        ...

    def submit(self, batch: SweepBatch) -> None:
        """Hand over a batch."""
        ...

    def collect(self) -> Outcome:
        """Wait for the next answer."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


QUEUED_BATCHES = 2  # batches that a worker has: it need not wait for the next one
AHEAD = QUEUED_BATCHES + 1  # and one a worker that waits here
# -P: the folder that the user stands in may hold a random.py or numpy.py of its own.
COMMAND = (sys.executable, "-P", "-m", "tsis.sweep._worker")
# Set before the libraries load: a pool of threads that is never made costs nothing.
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


class LocalPool:
    """Worker processes on this machine.

    Parameters
    ----------
    job
        What all batches share.
    count
        Number of processes.
    """

    def __init__(self, job: SweepJob, count: int) -> None:
        self.window = AHEAD * count
        self._job = pickle.dumps(job)
        self._todo: SimpleQueue[SweepBatch | None] = SimpleQueue()
        self._results: SimpleQueue[Outcome] = SimpleQueue()
        self._stopping = False
        self._lock = threading.RLock()
        self._processes: set[subprocess.Popen[bytes]] = set()
        # Once a worker has died, another is kept ready: workers that die sooner than they start would finish nothing.
        self._has_lost = False
        self._spare: subprocess.Popen[bytes] | None = None
        self._threads = [threading.Thread(target=self._supervise, daemon=True) for _ in range(count)]

    def submit(self, batch: SweepBatch) -> None:
        """Hand over a batch."""
        self._todo.put(batch)

    def collect(self) -> Outcome:
        """Wait for the next answer."""
        return self._results.get()

    def __enter__(self) -> Self:
        for thread in self._threads:
            thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._lock:
            self._stopping = True
            for process in self._processes:
                process.kill()  # a file is whole or absent, so nothing has to be finished
        for _ in self._threads:
            self._todo.put(None)
        for thread in self._threads:
            thread.join()
        for process in tuple(self._processes):
            self._end(process)

    def _supervise(self) -> None:
        """Keep one process busy, and replace it when it dies."""
        process: subprocess.Popen[bytes] | None = None
        given: deque[SweepBatch] = deque()  # what the process has; it works on the first
        while not self._stopping:
            batch = self._next(wait=not given)
            try:
                if batch is not None:
                    given.append(batch)
                    process = process or self._started()
                    _hand_over(process, batch)
                    if len(given) < QUEUED_BATCHES:
                        continue
                if process is not None and given:
                    response = _outcome_of(process)
                    given.popleft()
                    self._results.put(response)
            except Exception:  # whatever half an answer looks like, its worker is gone
                self._end(process)
                process, self._has_lost = None, True
                for lost in given:
                    self._results.put(Lost(batch=lost))
                given.clear()
        self._end(process)

    def _next(self, *, wait: bool) -> SweepBatch | None:
        try:
            return self._todo.get(block=wait)
        except Empty:
            return None

    def _started(self) -> subprocess.Popen[bytes]:
        """A process that knows the job: the spare one, or a new one."""
        with self._lock:
            if self._stopping:
                raise EOFError
            spare, self._spare = self._spare, None
            if spare is not None and spare.poll() is not None:  # spare ones die, too
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
            # Ctrl-C on the terminal is for the sweep, which then ends its workers.
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
                with suppress(OSError):  # what was not sent has no reader any more
                    stream.close()
        with self._lock:
            self._processes.discard(process)


def _hand_over(process: subprocess.Popen[bytes], batch: SweepBatch) -> None:
    assert process.stdin is not None
    pickle.dump(batch, process.stdin)
    process.stdin.flush()


def _outcome_of(process: subprocess.Popen[bytes]) -> Outcome:
    assert process.stdout is not None
    response: Outcome = pickle.load(process.stdout)
    return response
