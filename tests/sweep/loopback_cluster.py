"""A Dask scheduler and its workers as processes on the loopback interface, for tests and benchmarks to kill."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from contextlib import suppress
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Self

READY_S = 60.0
HOST = "127.0.0.1"
SCHEDULER = ("-m", "distributed.cli.dask_scheduler", "--host", HOST, "--port", "0")
WORKER = ("-m", "distributed.cli.dask_worker", "--host", HOST, "--no-nanny")
# Every port is chosen by the system; the statistics page, which can only be moved, gets one of them too.
NO_PAGES = ("--no-dashboard", "--dashboard-address", f"{HOST}:0")


class LoopbackCluster:
    """One scheduler and some workers, each an own process.

    Parameters
    ----------
    folder
        For logs and for what the workers spill.
    workers, threads
        How many to start with, and how many batches each has at a time.
    """

    def __init__(self, folder: Path, workers: int, threads: int = 1) -> None:
        self._folder, self._count, self._threads = folder, workers, threads
        self._file = folder / "scheduler.json"
        self.workers: list[subprocess.Popen[bytes]] = []

    def __enter__(self) -> Self:
        self._folder.mkdir(parents=True, exist_ok=True)
        self._file.unlink(missing_ok=True)
        self.scheduler = self._start(*SCHEDULER, *NO_PAGES, "--scheduler-file", str(self._file))
        self.address = self._address()
        for _ in range(self._count):
            self.add_worker()
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    def add_worker(self) -> None:
        """Start one more worker."""
        self.workers.append(
            self._start(
                *(*WORKER, *NO_PAGES, "--nthreads", str(self._threads)),
                *("--local-directory", str(self._folder / "spill"), self.address),
            )
        )

    def replace_worker(self) -> None:
        """Kill the oldest worker and start another."""
        _kill(self.workers.pop(0))
        self.add_worker()

    def kill(self) -> None:
        """Kill the scheduler and all workers at once."""
        for process in (self.scheduler, *self.workers):
            process.kill()
        for process in (self.scheduler, *self.workers):
            _kill(process)
        self.workers.clear()

    def _start(self, *arguments: str) -> subprocess.Popen[bytes]:
        with (self._folder / "log.txt").open("ab") as log:
            return subprocess.Popen([sys.executable, *arguments], stdout=log, stderr=log)

    def _address(self) -> str:
        until = time.monotonic() + READY_S
        while time.monotonic() < until:
            with suppress(OSError, ValueError):
                return str(json.loads(self._file.read_text())["address"])
            if self.scheduler.poll() is not None:
                break
            time.sleep(0.05)
        log = (self._folder / "log.txt").read_text()
        raise RuntimeError(f"the scheduler did not start: {log[-2000:]}")


def _kill(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
