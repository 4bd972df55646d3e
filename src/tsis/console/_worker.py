"""Heavy work in a worker process, so that it does not block the live views."""

from __future__ import annotations

import ctypes
import gc
import logging
import multiprocessing
import os
import pickle
import threading
from concurrent.futures import CancelledError, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tsis.errors import ControlError, TsisError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy as np
    from numpy.typing import NDArray

    from tsis.virtual.direct_contact import DirectContactRig
    from tsis.virtual.probe import VirtualProbe

    Rig = VirtualProbe | DirectContactRig


MOST = 20  # pieces of work after which the process is replaced, with all the memory that it has gathered
MOST_PRESSES = 1000  # the same, of presses, which reuse the condensed bodies of those before
NICE = 10  # priority below that of the console, where a system has priorities
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
_log = logging.getLogger(__name__)


class WorkerProcess:
    """One call after the other, from several threads, in a process that is replaced after ``most`` calls.

    ``loads`` is a module that it imports as it begins, and ``nice`` how far its priority lies below the console's.
    """

    def __init__(self, *, most: int = MOST, nice: int = NICE, loads: str = __name__) -> None:
        self._most, self._nice, self._loads, self._closed = most, nice, loads, False
        self._pool: ProcessPoolExecutor | None = None
        self._lock = threading.Lock()

    def call(self, work: Callable[Arguments, Result], *given: Arguments.args, **named: Arguments.kwargs) -> Result:
        """Call a module's function there; its arguments and result can be pickled.

        Raises `TsisError` as the work did, `ControlError` when the console is closing, and `RuntimeError` when the work
        failed for another reason, which is logged.
        """
        requested = pickle.dumps((work, given, named))
        with self._lock:
            try:
                return self._ready().submit(_answer, requested).result()  # type: ignore[no-any-return]
            except TsisError:
                raise
            except (BrokenProcessPool, CancelledError) as error:
                self._end()
                self._require_open(error)
                raise RuntimeError("a process ended before its work was done") from error
            except Exception as error:
                self._require_open(error)  # a pool that is shut down takes no work
                _log.error("work in a process of its own failed: %s", error.__cause__)
                raise RuntimeError("work in a process of its own failed") from error

    def begin(self) -> None:
        """Start the process now, so that the first call need not wait for it."""
        with self._lock:
            self._ready().submit(int)

    def close(self) -> None:
        """End the process, and start no other one."""
        self._closed = True
        self._end()

    def _require_open(self, error: BaseException | None = None) -> None:
        if self._closed:
            raise ControlError("the console is shutting down and starts no work") from error

    def _ready(self) -> ProcessPoolExecutor:
        self._require_open()
        if self._pool is None:
            context = multiprocessing.get_context("spawn")
            begin: dict[str, Any] = {"initializer": _begin, "initargs": (self._nice, self._loads)}
            self._pool = ProcessPoolExecutor(1, context, max_tasks_per_child=self._most, **begin)
        return self._pool

    def _end(self) -> None:
        pool, self._pool = self._pool, None
        if pool is None:
            return
        processes = pool._processes  # Python 3.14 has kill_workers for these lines
        pool.shutdown(wait=False, cancel_futures=True)
        for process in list(processes.values()):
            process.kill()


def solving_process() -> WorkerProcess:
    """A process, not yet begun, that solves presses of the virtual probe at the console's priority."""
    return WorkerProcess(most=MOST_PRESSES, nice=0, loads="tsis.virtual.direct_contact")


def light_of(rig: Rig, lies: Any, force_n: float) -> tuple[NDArray[np.float64], Rig]:
    """Light of a press, and the rig with its generator as it is afterwards, which another process must send back.

    It is here, where a process that solves presses need load nothing else of the console for it.
    """
    return rig.light(lies, force_n=force_n), rig


def _answer(requested: bytes) -> Any:
    """Result of a call."""
    work, given, named = pickle.loads(requested)
    return work(*given, **named)


def _begin(nice: int, loads: str) -> None:
    """Prepare the process: lower priority, no output, and an end together with the console.

    It has its own session, so that an interruption of the console at a terminal does not interrupt it.
    """
    with suppress(AttributeError, OSError):
        os.setsid()
        os.nice(nice)
    os.dup2(2, 1)  # standard output is for the console's own messages
    threading.Thread(target=_end_with_console, daemon=True).start()
    gc.disable()  # a collection while libraries load takes a fifth of the time
    import_module(loads)
    gc.freeze()
    gc.enable()


def _end_with_console() -> None:
    console = multiprocessing.parent_process()
    assert console is not None
    console.join()
    os._exit(1)


ARENA_MAX = -8  # M_ARENA_MAX of the GNU C library
ARENAS = 2
EVERY_S = 20.0


def share_memory_among_threads() -> None:
    """Let threads share two heaps; to be called before they are started.

    The GNU C library gives each thread its own heap, which never shrinks below its largest estimate or figure: memory
    would grow for hours. Other libraries have no such setting and no such behaviour.
    """
    try:
        ctypes.CDLL(None).mallopt(ARENA_MAX, ARENAS)
    except (AttributeError, OSError, TypeError):
        return


@contextmanager
def collecting_garbage(every_s: float = EVERY_S) -> Iterator[None]:
    """Collect garbage at intervals; to be entered once everything is loaded, which is excluded from collection.

    Python collects by the number of objects, not by their size, so pictures of several reports could accumulate.
    A collection over all loaded modules would stop every thread.
    """
    ended = threading.Event()

    def tidy() -> None:
        while not ended.wait(every_s):
            gc.collect()

    gc.collect()
    gc.freeze()
    thread = threading.Thread(target=tidy, name="garbage", daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        gc.unfreeze()
