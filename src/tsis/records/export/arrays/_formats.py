"""A file that refuses no write, for libraries that break where one is refused."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

from tsis.errors import FileInputError, import_extra
from tsis.records.export._whole import export_file, export_folder
from tsis.records.export.arrays._layout import GZIP_LEVEL, write_layout

if TYPE_CHECKING:
    import os
    from collections.abc import Mapping
    from pathlib import Path
    from types import TracebackType

    from tsis.records._target_record import TargetRecord
    from tsis.records.export.arrays._layout import Attribute, Shape


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
        requested = max(0, min(len(buffer), self._end() - self._at))
        result = bytearray(requested)
        self._file.seek(self._at)
        on_disk = self._file.read(requested)
        result[: len(on_disk)] = on_disk
        for start, content in self._spilt:
            low, high = max(start, self._at), min(start + len(content), self._at + requested)
            if low < high:
                result[low - self._at : high - self._at] = content[low - start : high - start]
        buffer[:requested] = result
        self._at += requested
        return requested

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


def write_hdf5(record: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write a dossier as one new HDF5 file, frame by frame; it appears whole or not at all.

    Raises
    ------
    MissingExtraError
        When h5py is not installed.
    FileInputError
        When there is such a file, or it cannot be written.
    RecordsError
        When a frame is not what its press says.
    """
    h5py = import_extra("h5py", feature="HDF5 export", extra="exchange")
    with export_file(path) as draft, SpillingFile(draft) as out:
        try:
            with h5py.File(out, "w", track_order=True) as file:
                write_layout(record, _Hdf5Tree(file, out))
        except RuntimeError as error:  # as HDF5 says what it cannot hold
            raise FileInputError(f"the file of HDF5 must be one that can be written; got: {error}") from error


class _Hdf5Tree:
    def __init__(self, file: Any, out: SpillingFile) -> None:
        self.file, self.out = file, out

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        self.file.require_group(path or "/").attrs.update(attributes)

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        filters = {"compression": "gzip", "compression_opts": GZIP_LEVEL, "shuffle": True, "fletcher32": True}
        dataset = self.file.create_dataset(path, shape=shape, dtype=dtype, chunks=chunks, **filters)
        dataset.attrs.update(attributes)
        return _Asking(dataset, self.out)


class _Asking:
    """A dataset that asks after each part whether the disk took it."""

    def __init__(self, dataset: Any, out: SpillingFile) -> None:
        self.dataset, self.out = dataset, out

    def __setitem__(self, at: Any, values: Any) -> None:
        self.dataset[at] = values
        self.out.require_written()


def write_zarr(record: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write a dossier as one new folder of Zarr format 3, frame by frame; it appears whole or not at all.

    Raises
    ------
    MissingExtraError
        When zarr is not installed.
    FileInputError
        When there is such a folder, or it cannot be written.
    RecordsError
        When a frame is not what its press says.
    """
    zarr = import_extra("zarr", feature="Zarr export", extra="exchange")
    codecs = import_extra("zarr.codecs", feature="Zarr export", extra="exchange")
    with export_folder(path) as draft:
        write_layout(record, _ZarrTree(zarr.create_group(str(draft), zarr_format=3), codecs))


class _ZarrTree:
    def __init__(self, root: Any, codecs: Any) -> None:
        self.root = root
        # Gzip is in the specification, which Zstandard is not; a check sum finds what a disk has changed.
        self.codecs = (codecs.GzipCodec(level=GZIP_LEVEL), codecs.Crc32cCodec())

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        (self.root.require_group(path) if path else self.root).attrs.update(attributes)

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        return self.root.create_array(
            path,
            shape=shape,
            dtype=dtype,
            chunks=chunks,
            compressors=self.codecs,
            fill_value=0,
            attributes=dict(attributes),
            config={"write_empty_chunks": True},  # a lost chunk would else read as black
        )
