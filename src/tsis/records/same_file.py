"""Whether the file that was opened still lies where it was: who goes on in one that is gone writes into nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.instrument import printable_path
from tsis.model.errors import RecordsError

if TYPE_CHECKING:
    from pathlib import Path


class SameFile:
    """A database's file as it is when this is made, told from another one that takes its place.

    Parameters
    ----------
    file
        Where it lies; it is there.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._opened = _identity(file)

    def moved(self) -> bool:
        """Whether it is gone from its place, or another one lies there; one look at the disk."""
        return _identity(self.file) != self._opened

    def require(self) -> None:
        """Refuse, with `RecordsError`, to write into a file that is gone: nobody would ever find it again."""
        if self.moved():
            raise RecordsError(
                f"the store in {printable_path(self.file.parent)} was moved or replaced since it was opened; nothing was "
                "stored (put it back, or start anew)"
            )


def _identity(file: Path) -> tuple[int, int] | None:
    """What tells a file from another of its name; None where there is none to be seen."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_dev, found.st_ino  # the latter is 0 on some systems: then only a missing file is noticed
