"""An exclusive lock on a folder or file of several processes, which the system releases however they end."""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def exclusive_lock(path: Path, *, wait: bool) -> Iterator[None]:
    """Lock an existing folder or file, which nothing replaces; a lock file would outlive a killed process.

    Windows and some network file systems have no such locks: nothing is locked there.

    Raises
    ------
    BlockingIOError
        When another process has the lock and ``wait`` is false.
    OSError
        When the path cannot be opened.
    """
    if sys.platform == "win32":
        yield
        return
    import fcntl

    handle = os.open(path, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:  # no locks on this file system
            pass
        yield
    finally:
        os.close(handle)
