"""How the memory of a server that runs for days is kept small."""

from __future__ import annotations

import ctypes
import gc
import threading
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

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
def tidied(every_s: float = EVERY_S) -> Iterator[None]:
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
