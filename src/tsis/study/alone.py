"""Who works on a study alone, and how the others are told.

The system drops these locks with the process, however that ends; a file of our own would outlive a kill.
"""

from __future__ import annotations

import os
import sys
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from tsis.instrument.file_bytes import printable_path
from tsis.model.errors import RecordsError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@contextmanager
def log_lock(folder: Path) -> Iterator[None]:
    """Wait until nobody else adds lines to the log in ``folder``: it takes others a moment."""
    with _opened(folder) as handle:
        if sys.platform != "win32":
            import fcntl

            with suppress(OSError):  # some network file systems have no such locks
                fcntl.flock(handle, fcntl.LOCK_EX)
        yield


@contextmanager
def run_lock(plan: Path) -> Iterator[None]:
    """Refuse while another run reads the targets of this ``plan``, which is written once and never replaced."""
    with _opened(plan) as handle:
        if sys.platform != "win32":
            import fcntl

            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise RecordsError(
                    f"{printable_path(plan.parent)} must be read by one run at a time; another one is under way (wait for it, "
                    f"or end it)"
                ) from error
            except OSError:  # as above
                pass
        yield


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    if sys.platform == "win32":  # where folders cannot be opened, and nothing is locked
        yield -1
        return
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise RecordsError(f"{printable_path(path)} must be part of a study; got: {error.strerror}") from error
    try:
        yield handle
    finally:
        os.close(handle)


__all__ = ["log_lock", "run_lock"]
