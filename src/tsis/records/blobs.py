"""Files under the hash of their content: frames, calibrations, samples. Nothing in them is ever changed."""

from __future__ import annotations

import hashlib
import re
from typing import TYPE_CHECKING

from tsis.instrument import read_bytes, shown
from tsis.model.durable import DISK, Disk, make_folder_durably, write_durably
from tsis.model.errors import FileInputError, RecordsError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

ENDINGS = ("png", "json", "samples")
_NAME = re.compile(r"[0-9a-f]{64}")


class Blobs:
    """A folder of files named by the SHA-256 of their content.

    Parameters
    ----------
    folder
        Where they lie; made when first needed.
    disk
        By which steps they get there.
    """

    def __init__(self, folder: Path, *, disk: Disk = DISK) -> None:
        self.folder = folder
        self._disk = disk

    def put(self, content: bytes, ending: str) -> str:
        """Keep ``content``, and return its name; then it is on the disk, whatever happens next.

        A file that is there already is written again: whether it ever reached the disk, and whole, nobody knows.

        Raises
        ------
        RecordsError
            When it cannot be written; nothing is left of it then.
        """
        name = hashlib.sha256(content).hexdigest()
        path = self.path(name, ending)
        try:
            make_folder_durably(path.parent, disk=self._disk)
            write_durably(path, content, disk=self._disk)
        except OSError as error:
            raise RecordsError(
                f"a file of {len(content)} bytes must be written into {shown(self.folder)}; got: "
                f"{error.strerror or error} (what was stored before is as it was; free some space)"
            ) from error
        return name

    def get(self, name: str, ending: str) -> bytes:
        """The content of that name, found to be what was stored.

        Raises
        ------
        RecordsError
            When there is none, or it was changed or damaged.
        """
        path = self.path(name, ending)
        try:
            content = read_bytes(path)
        except FileInputError as error:
            raise RecordsError(f"a stored file must be there and readable; {error}") from error
        if hashlib.sha256(content).hexdigest() != name:
            raise RecordsError(
                f"{shown(path)} must be as it was stored; its content does not match its name, so it was changed or "
                "damaged (take it from a backup)"
            )
        return content

    def path(self, name: str, ending: str) -> Path:
        """Where a file lies; names are hashes, so that none leads out of the folder."""
        if not _NAME.fullmatch(name) or ending not in ENDINGS:
            raise RecordsError(f"a stored file must be named by a SHA-256 and end in {ENDINGS}; got {name!r:.80}")
        return self.folder / name[:2] / f"{name}.{ending}"

    def names(self) -> Iterator[tuple[str, str]]:
        """Name and ending of every file that is there."""
        for path in sorted(self.folder.glob("[0-9a-f][0-9a-f]/*")):
            name, _, ending = path.name.partition(".")
            if _NAME.fullmatch(name) and ending in ENDINGS:
                yield name, ending
