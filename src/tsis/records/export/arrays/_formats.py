"""The array layout in HDF5 and Zarr."""

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
    """A new file that buffers failed writes in memory, for HDF5.

    After a failed write HDF5 cannot close its file, prints tracebacks, and crashes at exit. This file hides it;
    the caller checks `require_written` after each step.
    """

    def __init__(self, path: Path) -> None:
        self._file = path.open("x+b", buffering=0)
        self._refused: OSError | None = None
        self._spilt: list[tuple[int, bytes]] = []
        self._at = 0

    def require_written(self) -> None:
        """Raise the first error of the disk, if any."""
        if self._refused is not None:
            raise self._refused

    def readable(self) -> bool:
        """True: HDF5 reads its own metadata."""
        return True

    def writable(self) -> bool:
        """True."""
        return True

    def seekable(self) -> bool:
        """True."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a position, which may lie beyond the end."""
        start = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._end()}[whence]
        self._at = start + offset
        return self._at

    def tell(self) -> int:
        """The position of the next read or write."""
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read the file, overlaid with the buffered writes."""
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
        """Write all bytes to the disk, or from the first failure on to memory."""
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
        """Set the size of the file, padded with zeros."""
        size = self._at if size is None else size
        try:
            if self._refused is None:
                self._file.truncate(size)
        except OSError as error:
            self._refused = error
        return size

    def close(self) -> None:
        """Close the file."""
        if not self.closed:
            self._file.close()
        super().close()

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        """Close the file; without another exception raise the error of the disk."""
        self.close()
        if error is None:
            self.require_written()

    def _end(self) -> int:
        return max([self._file.seek(0, io.SEEK_END), *(start + len(content) for start, content in self._spilt)])


def write_hdf5(record: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write a target record as a new HDF5 file, frame by frame and atomically.

    Raises
    ------
    MissingExtraError
        When h5py is not installed.
    FileInputError
        When the file exists, or cannot be written.
    RecordsError
        When a frame does not match its press.
    """
    h5py = import_extra("h5py", feature="HDF5 export", extra="exchange")
    with export_file(path) as draft, SpillingFile(draft) as out:
        try:
            with h5py.File(out, "w", track_order=True) as file:
                write_layout(record, _Hdf5Tree(file, out))
        except RuntimeError as error:  # HDF5's error for unsupported content
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
        return _CheckedDataset(dataset, self.out)


class _CheckedDataset:
    """A dataset that checks after each write whether the disk accepted it."""

    def __init__(self, dataset: Any, out: SpillingFile) -> None:
        self.dataset, self.out = dataset, out

    def __setitem__(self, at: Any, values: Any) -> None:
        self.dataset[at] = values
        self.out.require_written()


def write_zarr(record: TargetRecord, path: str | os.PathLike[str]) -> None:
    """Write a target record as a new folder of Zarr format 3, frame by frame and atomically.

    Raises
    ------
    MissingExtraError
        When zarr is not installed.
    FileInputError
        When the folder exists, or cannot be written.
    RecordsError
        When a frame does not match its press.
    """
    zarr = import_extra("zarr", feature="Zarr export", extra="exchange")
    codecs = import_extra("zarr.codecs", feature="Zarr export", extra="exchange")
    with export_folder(path) as draft:
        write_layout(record, _ZarrTree(zarr.create_group(str(draft), zarr_format=3), codecs))


class _ZarrTree:
    def __init__(self, root: Any, codecs: Any) -> None:
        self.root = root
        # Gzip, unlike Zstandard, is in the specification; a checksum detects damage.
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
            config={"write_empty_chunks": True},  # else a lost chunk would read as black
        )
