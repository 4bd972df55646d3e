"""Heavy work in a worker process."""

from __future__ import annotations

import ctypes
import gc
import logging
import threading
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from functools import partial
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tsis.errors import ControlError, TsisError
from tsis.processes import SpawnedProcess

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Future

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

    ``loads`` names modules that it imports as it begins, and ``nice`` how far its priority lies below the console's.
    """

    def __init__(self, *, most: int = MOST, nice: int = NICE, loads: str = __name__) -> None:
        self._new = partial(SpawnedProcess, most=most, nice=nice, loads=loads)
        self._process: SpawnedProcess | None = None
        self._closed = False
        self._lock = threading.Lock()

    def call(self, work: Callable[Arguments, Result], *given: Arguments.args, **named: Arguments.kwargs) -> Result:
        """Call a module's function there; its arguments and result can be pickled.

        Raises `TsisError` as the work did, `ControlError` when the console is closing, and `RuntimeError` when the work
        failed for another reason, which is logged.
        """
        with self._lock:
            future = self._submitted(work, *given, **named)
            try:
                return future.result()
            except TsisError:
                raise
            except (BrokenProcessPool, CancelledError) as error:
                raise self._ended(error) from error
            except Exception as error:
                _log.error("work in a process of its own failed: %s", error.__cause__)
                raise RuntimeError("work in a process of its own failed") from error

    def begin(self) -> None:
        """Start the process now, so that the first call need not wait for it."""
        with self._lock:
            self._submitted(int)

    def close(self) -> None:
        """End the process, and start no other one."""
        self._closed = True
        self._end()

    def _submitted(
        self, work: Callable[Arguments, Result], *given: Arguments.args, **named: Arguments.kwargs
    ) -> Future[Result]:
        self._require_open()
        process = self._process = self._process or self._new()
        try:
            return process.submit(work, *given, **named)
        except RuntimeError as error:  # a process that is closed, or was killed while it waited, takes no work
            raise self._ended(error) from error

    def _ended(self, error: BaseException) -> RuntimeError:
        """The error of work whose process ended; `ControlError` when that was the console's doing."""
        self._end()
        self._require_open(error)
        return RuntimeError("a process ended before its work was done")

    def _require_open(self, error: BaseException | None = None) -> None:
        if self._closed:
            raise ControlError("the console is shutting down and starts no work") from error

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.end()


def solving_process() -> WorkerProcess:
    """A process, not yet begun, that solves presses of the virtual probe at the console's priority."""
    return WorkerProcess(most=MOST_PRESSES, nice=0, loads="tsis.virtual.direct_contact")


def light_of(rig: Rig, lies: Any, force_n: float) -> tuple[NDArray[np.float64], Rig]:
    """Light of a press, and the rig with its generator as it is afterwards, which another process must send back.

    It is here, where a process that solves presses need load nothing else of the console for it.
    """
    return rig.light(lies, force_n=force_n), rig


ARENA_MAX = -8  # M_ARENA_MAX of the GNU C library
ARENAS = 2
EVERY_S = 20.0


def share_memory_among_threads() -> None:
    """Let threads share two heaps; to be called before they are started.

    The GNU C library gives each thread its own heap, which never shrinks below its largest estimate or figure: memory
    would grow for hours. Other libraries have no such setting and no such behaviour.
    """
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).mallopt(ARENA_MAX, ARENAS)


def give_memory_back() -> None:
    """Return freed memory to the system, where the C library is GNU's."""
    with suppress(AttributeError, OSError, TypeError):
        ctypes.CDLL(None).malloc_trim(0)


@contextmanager
def collecting_garbage(every_s: float = EVERY_S) -> Iterator[None]:
    """Collect garbage at intervals; to be entered once everything is loaded, which is excluded from collection.

    Python collects by the number of objects, not by their size, so pictures of several reports could accumulate. The
    GNU C library keeps what was freed between pieces in use, and gives it back when asked.
    A collection over all loaded modules would stop every thread.
    """
    ended = threading.Event()

    def tidy() -> None:
        while not ended.wait(every_s):
            gc.collect()
            give_memory_back()

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
