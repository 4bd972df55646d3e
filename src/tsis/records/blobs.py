"""Files under the hash of their content: frames, calibrations, samples. Nothing in them is ever changed."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

from tsis.instrument import printable_path, read_bytes
from tsis.model.durable import DISK, Disk, write_durably
from tsis.model.errors import FileInputError, RecordsError
from tsis.records.canonical import SHA256

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

ENDINGS = ("png", "json", "samples")


class Blobs:
    """A folder of files named by the SHA-256 of their content.

    Parameters
    ----------
    folder
        Where they lie; it is there. Were it made anew, what belongs into a folder that was moved would be lost.
    disk
        By which steps they get there.
    allowed
        Asked before each is written; raises where nothing may be.
    """

    def __init__(self, folder: Path, *, disk: Disk = DISK, allowed: Callable[[], None] = lambda: None) -> None:
        self.folder = folder
        self._disk, self._allowed = disk, allowed
        self._lasting: set[str] = set()  # folders whose names this program has synced

    def put(self, content: bytes, ending: str) -> str:
        """Keep ``content``, and return its name; then it is on the disk, whatever happens next.

        A file that is there already and whole is not written again, since a file that is replaced can be lost on the
        way; but it is synced again: whether it and its name ever reached the disk, nobody knows.

        Raises
        ------
        RecordsError
            When it cannot be written, or nobody knows whether it would last; never a part of it is left then.
        """
        name = hashlib.sha256(content).hexdigest()
        path = self.path(name, ending)
        self._allowed()
        try:
            self._make_folder(path)
            if not self._holds(path, content):
                self._write(path, content)
        except OSError as error:
            raise RecordsError(
                f"a file of {len(content)} bytes must be written into {printable_path(self.folder)}; got: "
                f"{error.strerror or error} (what was stored before is as it was; "
                "free some space, or have the store where it can be written)"
            ) from error
        return name

    def _make_folder(self, path: Path) -> None:
        folder = path.parent
        if folder.name not in self._lasting or not folder.is_dir():
            self._disk.make_folder(folder, private=True)
            self._disk.sync_folder(self.folder)  # also for one that is there: who made it may have been killed
            self._lasting.add(folder.name)

    def _holds(self, path: Path, content: bytes) -> bool:
        """Whether the file is there and whole; then it is on the disk."""
        try:
            if not path.exists() or read_bytes(path) != content:
                return False
        except FileInputError:
            return False
        self._disk.sync_again(path)
        self._disk.sync_folder(path.parent)
        return True

    def _write(self, path: Path, content: bytes) -> None:
        damaged = path.exists()
        try:
            write_durably(path, content, disk=self._disk, drafts=self.folder, replace=damaged, private=True)
        except FileExistsError:
            if not self._holds(path, content):  # as it was written by another program meanwhile
                raise

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
            state = "be readable" if path.exists() else "be there, and is missing"
            raise RecordsError(f"a stored file must {state}; {error}") from error
        if hashlib.sha256(content).hexdigest() != name:
            raise RecordsError(
                f"{printable_path(path)} must be as it was stored; its content does not match its name, so it was changed or "
                "damaged (take it from a backup)"
            )
        return content

    def path(self, name: str, ending: str) -> Path:
        """Where a file lies; names are hashes, so that none leads out of the folder."""
        if not SHA256.fullmatch(name) or ending not in ENDINGS:
            raise RecordsError(f"a stored file must be named by a SHA-256 and end in {ENDINGS}; got {name!r:.80}")
        return self.folder / name[:2] / f"{name}.{ending}"

    def names(self) -> Iterator[tuple[str, str]]:
        """Name and ending of every file that is there."""
        for path in sorted(self.folder.glob("[0-9a-f][0-9a-f]/*")):
            name, _, ending = path.name.partition(".")
            if SHA256.fullmatch(name) and ending in ENDINGS:
                yield name, ending
