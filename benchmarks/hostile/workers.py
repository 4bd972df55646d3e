"""Batches of hostile files in processes of their own, so that a crash, a hang or a full memory is counted and survived.

A worker is a fork: it inherits the loaded libraries, and its peak memory above the start is that of its files. File
number `n` of a loader depends on seed, loader and `n` alone.
"""

from __future__ import annotations

import json
import mmap
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from benchmarks.hostile.verdict import Outcome, Tally, Verdict, judged

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from benchmarks.hostile.loader import Loader

LONGEST_S = 20.0  # of one file; what takes longer counts as a crash
MOST_MEMORY = 6 * 2**30  # address space of a worker: no file may take the machine with it
BATCH = 2000


def scratch() -> Path:
    """A new folder in memory where there is such a place."""
    return Path(tempfile.mkdtemp(prefix="hostile-", dir="/dev/shm" if Path("/dev/shm").is_dir() else None))


def count(
    loader: Loader, place: int, numbers: Iterable[int], *, seed: int, at: Callable[[int], None] = lambda n: None
) -> Tally:
    """Judge the files of these numbers in this process; ``at`` is told each number before it is loaded."""
    tally, folder = Tally(), scratch()
    try:
        path = loader.laid(folder)
        originals = []
        for original in loader.originals:
            path.write_bytes(original)
            originals.append(loader.load(path))
        for number in numbers:
            at(number)
            which, content, forged = loader.mutated(np.random.default_rng([seed, place, number]))
            path.write_bytes(content)
            if loader.settle is not None and forged:
                loader.settle(folder)
            began = time.perf_counter()
            outcome = judged(loader, path, originals[which], forged=forged)
            tally = tally.with_one(
                replace(outcome, said=f"#{number}: {outcome.said}" if outcome.said else ""),
                1e3 * (time.perf_counter() - began),
            )
            if loader.settle is not None and forged:
                loader.laid(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return tally


@dataclass(slots=True)
class _Worker:
    """A forked process with its batch."""

    process: int
    answers: int
    progress: mmap.mmap
    place: int
    numbers: range
    said: bytes = b""

    def current(self) -> tuple[int, float]:
        """Number of the file in work, and since when."""
        number, since_ns = memoryview(self.progress).cast("q")
        return number, since_ns / 1e9


def run(
    loaders: Sequence[Loader], files: Sequence[int], *, seed: int, processes: int, progress: Callable[[int], None]
) -> list[Tally]:
    """Judge so many files for each loader; ``progress`` is told how many are done."""
    batches = [
        (place, range(start, min(start + BATCH, total)))
        for place, total in enumerate(files)
        for start in range(0, total, BATCH)
    ]
    batches.sort(key=lambda batch: batch[1].start / max(1, files[batch[0]]))
    tallies, working = [Tally() for _ in loaders], list[_Worker]()
    while batches or working:
        while batches and len(working) < processes:
            working.append(_started(loaders, *batches.pop(0), seed=seed))
        ready, _, _ = select.select([worker.answers for worker in working], [], [], 1.0)
        for worker in list(working):
            if worker.answers in ready:
                piece = os.read(worker.answers, 65536)
                worker.said += piece
                if not piece:
                    working.remove(worker)
                    tally, left = _ended(worker)
                    tallies[worker.place] = tallies[worker.place].with_all(tally)
                    progress(tally.files)
                    batches[:0] = [(worker.place, numbers) for numbers in left if numbers]
            elif time.monotonic() - worker.current()[1] > LONGEST_S:
                os.kill(worker.process, signal.SIGKILL)
    return tallies


def _started(loaders: Sequence[Loader], place: int, numbers: range, *, seed: int) -> _Worker:
    progress = mmap.mmap(-1, 16)
    _tell(progress, numbers.start)
    reading, writing = os.pipe()
    sys.stdout.flush()
    process = os.fork()
    if process == 0:
        os.close(reading)
        _work(loaders[place], place, numbers, seed, progress, writing)
    os.close(writing)
    return _Worker(process, reading, progress, place, numbers)


def _tell(progress: mmap.mmap, number: int) -> None:
    """Which file is in work from now on; each number is stored at once, for the parent reads them at any time."""
    slots = memoryview(progress).cast("q")
    slots[1] = time.monotonic_ns()
    slots[0] = number


def _work(loader: Loader, place: int, numbers: range, seed: int, progress: mmap.mmap, writing: int) -> None:
    """In the fork: judge, answer, end; nothing of the parent may run afterwards."""
    status = 1
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        before = peak_mb()

        def at(number: int) -> None:
            _tell(progress, number)

        tally = count(loader, place, numbers, seed=seed, at=at)
        answer: dict[str, Any] = {
            "counts": tally.counts,
            "slowest_ms": tally.slowest_ms,
            "memory_mb": peak_mb() - before,
            "said": tally.said,
        }
        os.write(writing, json.dumps(answer).encode()[:60_000])
        status = 0
    except BaseException:  # a fork must not run on as its parent
        traceback.print_exc()
    finally:
        os._exit(status)


def _ended(worker: _Worker) -> tuple[Tally, tuple[range, ...]]:
    """What a worker found, and what it left undone because a file killed it."""
    os.close(worker.answers)
    _, status = os.waitpid(worker.process, 0)
    if status == 0:
        found = json.loads(worker.said)
        return Tally(**{**found, "said": tuple(found["said"])}), ()
    number, _ = worker.current()
    how = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"exit {os.WEXITSTATUS(status)}"
    crash = Tally().with_one(Outcome(Verdict.CRASHED, f"#{number}: {how}"))
    # the tally of those before it died with the worker: they are judged again
    return crash, (range(worker.numbers.start, number), range(number + 1, worker.numbers.stop))


def peak_mb() -> float:
    """Largest memory of this process so far, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
