"""Heavy work in a process of its own: in that of the console it would make every live view stand still meanwhile."""

from __future__ import annotations

import ctypes
import gc
import logging
import os
import pickle
import subprocess
import sys
import threading
import traceback
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from tsis.errors import ControlError, TsisError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import BinaryIO


MOST = 20  # pieces of work after which the process is replaced, with all the memory that it has gathered
NICE = 10  # how far it stands back behind the console, where a system knows that
DONE, REFUSED, FAILED = "done", "refused", "failed"
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
_log = logging.getLogger(__name__)


class WorkerProcess:
    """A process that does one piece of work after the other, begun with the first; for several threads.

    Parameters
    ----------
    most
        Pieces of work that one process does.
    """

    def __init__(self, *, most: int = MOST) -> None:
        self._most, self._done, self._closed = most, 0, False
        self._process: subprocess.Popen[bytes] | None = None
        self._one_at_a_time = threading.Lock()

    def ask(self, work: Callable[Arguments, Result], *given: Arguments.args, **named: Arguments.kwargs) -> Result:
        """Have work done there; it is a function of a module, and what it takes and returns can be pickled.

        Raises
        ------
        TsisError
            As the work did.
        ControlError
            When the console is being ended.
        RuntimeError
            When it failed for another reason, which the log tells.
        """
        requested = pickle.dumps((work, given, named))
        with self._one_at_a_time:
            process = self._ready()
            self._done += 1
            try:
                kind, response = _exchanged(process, requested)
            except (OSError, EOFError, pickle.UnpicklingError) as error:
                self._end()
                if self._closed:
                    raise ControlError("the console is being ended; nothing can be begun any more") from error
                raise RuntimeError("a process ended before its work was done") from error
            if self._done >= self._most:
                self._end()
        if kind == REFUSED:
            raise response
        if kind == FAILED:
            _log.error("work in a process of its own failed: %s", response)
            raise RuntimeError("work in a process of its own failed")
        return response  # type: ignore[no-any-return]

    def close(self) -> None:
        """End the process, whatever it does, and begin none any more."""
        self._closed = True
        self._end()

    def _ready(self) -> subprocess.Popen[bytes]:
        process = self._process
        if process is None or process.poll() is not None:
            self._end()
            process = self._process = _begun()
            self._done = 0
        if self._closed:  # also when it was closed while this one began
            self._end()
            raise ControlError("the console is being ended; nothing can be begun any more")
        return process

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        process.kill()
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with suppress(OSError):  # what was to be written is of no use any more
                pipe.close()  # type: ignore[union-attr]


def _begun() -> subprocess.Popen[bytes]:
    """The process; in a session of its own, so that who interrupts the console at a terminal does not interrupt it."""
    command = [sys.executable, "-P", "-m", __name__]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True)


def _exchanged(process: subprocess.Popen[bytes], requested: bytes) -> Any:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(requested)
    process.stdin.flush()
    return pickle.load(process.stdout)


def _answer(binary_io: BinaryIO) -> bytes:
    """What comes of the next piece of work; EOFError when nobody asks any more."""
    work, given, named = pickle.load(binary_io)
    try:
        return pickle.dumps((DONE, work(*given, **named)))
    except TsisError as error:
        return pickle.dumps((REFUSED, error))
    except BaseException:
        return pickle.dumps((FAILED, traceback.format_exc()))


def main() -> None:
    """Do what is asked for on standard input until it is closed."""
    with suppress(AttributeError, OSError):
        os.nice(NICE)
    responses = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    with suppress(EOFError, OSError):  # whoever asked is gone
        while True:
            responses.write(_answer(sys.stdin.buffer))
            responses.flush()


if __name__ == "__main__":
    main()


ARENA_MAX = -8  # M_ARENA_MAX of the GNU C library
ARENAS = 2
EVERY_S = 20.0


def share_memory_among_threads() -> None:
    """Let threads share two heaps; to be called before they are started.

    The GNU C library gives each of a dozen threads a heap of its own, and each keeps the room of the largest estimate
    or figure that was ever made there: memory grows for hours. Other libraries have no such knob and no such habit.
    """
    try:
        ctypes.CDLL(None).mallopt(ARENA_MAX, ARENAS)
    except (AttributeError, OSError, TypeError):
        return


@contextmanager
def collecting_garbage(every_s: float = EVERY_S) -> Iterator[None]:
    """Collect garbage now and then; to be entered once all is loaded, which is set aside as never to be looked at.

    Python looks for garbage when many things were made, however large they are: the pictures of several reports, which
    hold each other, would lie about at once. And as it would look through all that is loaded, every thread would stop.
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
