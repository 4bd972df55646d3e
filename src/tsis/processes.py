"""Work in a process of its own, which ends together with this program."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import threading
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class SpawnedProcess(ProcessPoolExecutor):
    """A pool of one process, which starts with the first call.

    Its standard output is its standard error, since the standard output is for the messages of this program.

    Parameters
    ----------
    loads
        Modules that the process imports as it begins, with spaces between their names.
    nice
        How far its priority lies below that of this program, where a system has priorities.
    most
        Number of calls after which the process is replaced, with all the memory that it has gathered; None for any.
    environment
        Variables of its environment, set before ``loads`` is imported.
    """

    def __init__(
        self, *, loads: str, nice: int = 0, most: int | None = None, environment: dict[str, str] | None = None
    ) -> None:
        super().__init__(
            1,
            multiprocessing.get_context("spawn"),
            initializer=_begin,
            initargs=(loads, nice, environment or {}),
            max_tasks_per_child=most,
        )

    def submit(
        self, work: Callable[Arguments, Result], /, *given: Arguments.args, **named: Arguments.kwargs
    ) -> Future[Result]:
        """Call a module's function there; its arguments and its result can be pickled.

        A call that cannot be unpickled there fails by itself, and the process lives on.
        """
        payload = pickle.dumps((work, given, named))
        with _uninterrupted():
            return super().submit(_answer, payload)

    @property
    def pid(self) -> int | None:
        """Number of the process; None before the first call and after the end."""
        return next(iter(self._processes or ()), None)

    def end(self) -> None:
        """Kill the process without waiting for its work; calls that wait fail. Another call does nothing."""
        processes = list((self._processes or {}).values())  # Python 3.14 has kill_workers for these lines
        self.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()


def _answer(payload: bytes) -> Any:
    """Result of a call."""
    work, given, named = pickle.loads(payload)
    return work(*given, **named)


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Block interruptions in this thread: what starts meanwhile keeps them blocked; this program gets them later."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin(loads: str, nice: int, environment: dict[str, str]) -> None:
    """Prepare the process: its own session, lower priority, no output, an end together with this program."""
    os.environ.update(environment)
    with suppress(AttributeError, OSError):
        os.setsid()
        os.nice(nice)
    os.dup2(2, 1)
    threading.Thread(target=_end_with_program, daemon=True).start()
    gc.disable()  # a collection while libraries load takes a fifth of the time
    for name in loads.split():
        import_module(name)
    gc.freeze()
    gc.enable()


def _end_with_program() -> None:
    program = multiprocessing.parent_process()
    assert program is not None
    program.join()
    os._exit(1)
