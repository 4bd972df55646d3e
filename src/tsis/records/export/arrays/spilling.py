"""A file that refuses no write, for libraries that break where one is refused."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path
    from types import TracebackType


class SpillingFile(io.RawIOBase):
    """A new file that holds in memory what the disk does not take, and says so when it is asked.

    HDF5 that could not write its last bytes cannot close its file either, prints tracebacks, and breaks the program as
    that ends. So it is never told: who writes asks `require_written` after each step, and drops the file.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("x+b", buffering=0)
        self._refused: OSError | None = None
        self._spilt: list[tuple[int, bytes]] = []
        self._at = 0

    def require_written(self) -> None:
        """Raise what the disk said when it first refused, where it did."""
        if self._refused is not None:
            raise self._refused

    def readable(self) -> bool:
        """Yes: HDF5 reads its own metadata."""
        return True

    def writable(self) -> bool:
        """Yes, always."""
        return True

    def seekable(self) -> bool:
        """Yes."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place, which may lie beyond the end."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._end()}[whence]
        self._at = start + offset
        return self._at

    def tell(self) -> int:
        """The place of the next read or write."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read what the disk has, and over it what it did not take."""
        wanted = max(0, min(len(buffer), self._end() - self._at))
        found = bytearray(wanted)
        self._file.seek(self._at)
        on_disk = self._file.read(wanted)
        found[: len(on_disk)] = on_disk
        for start, content in self._spilt:
            low, high = max(start, self._at), min(start + len(content), self._at + wanted)
            if low < high:
                found[low - self._at : high - self._at] = content[low - start : high - start]
        buffer[:wanted] = found
        self._at += wanted
        return wanted

    def write(self, content: memoryview) -> int:  # type: ignore[override]
        """Write all of it: on the disk, or in memory from the first refusal on."""
        rest = bytes(content)
        try:
            while self._refused is None and rest:
                self._file.seek(self._at)
                taken = self._file.write(rest)
                self._at, rest = self._at + taken, rest[taken:]
        except OSError as error:
            self._refused = error
        if rest:
            self._spilt.append((self._at, rest))
            self._at += len(rest)
        return len(content)

    def truncate(self, size: int | None = None) -> int:
        """Give the file that many bytes, zeros at its end where it is longer than what was written."""
        size = self._at if size is None else size
        try:
            if self._refused is None:
                self._file.truncate(size)
        except OSError as error:
            self._refused = error
        return size

    def close(self) -> None:
        """Close it, once."""
        if not self.closed:
            self._file.close()
        super().close()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Close it; where all else went well, raise what the disk said."""
        self.close()
        if error is None:
            self.require_written()

    def _end(self) -> int:
        return max([self._file.seek(0, io.SEEK_END), *(start + len(content) for start, content in self._spilt)])
