"""A target record as groups and arrays: the layout, and its writing as HDF5 and Zarr."""

from __future__ import annotations

import io
import json
import math
import re
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.calibration.file import calibration_bytes
from tsis.errors import FileInputError, RecordsError, import_extra
from tsis.files import to_json_value
from tsis.model import INTERVAL_LEVEL, unit_of
from tsis.records._estimate_json import estimate_to_json
from tsis.records.export._whole import export_file, export_folder

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Mapping
    from pathlib import Path
    from types import TracebackType

    from numpy.typing import NDArray

    from tsis.model import Estimate
    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredEstimate, StoredPress

__all__ = ["write_hdf5", "write_zarr"]


Attribute = str | float | int | bool
Shape = tuple[int, ...]
GZIP_LEVEL = 4  # in every format


class Tree(Protocol):
    """Groups and arrays by path, e.g. ``"frames/target/0/grey"``; attributes are text and numbers."""

    def group(self, path: str, attributes: Mapping[str, Attribute]) -> None:
        """Create a group; ``""`` is the root."""

    def create(self, path: str, shape: Shape, dtype: str, chunks: Shape, attributes: Mapping[str, Attribute]) -> Any:
        """Create an array of at least one axis that is filled by index; each chunk is compressed separately."""


def write_array(tree: Tree, path: str, values: NDArray[Any], attributes: Mapping[str, Attribute]) -> None:
    """Write a small array in one chunk."""
    tree.create(path, values.shape, str(values.dtype), values.shape, attributes)[...] = values


def write_stack(
    tree: Tree, path: str, frames: Iterable[NDArray[Any]], shape: Shape, dtype: str, attributes: Mapping[str, Attribute]
) -> None:
    """Write frames of one size, a chunk each; ``shape`` is (n, rows, columns)."""
    stack = tree.create(path, shape, dtype, (1, *shape[1:]), attributes)
    for at, frame in enumerate(frames):
        stack[at] = frame


FORMAT, VERSION = "tsis-arrays", 1
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def write_layout(record: TargetRecord, tree: Tree) -> None:
    """Write a target record frame by frame; `RecordsError` when a frame does not match its press."""
    tree.group("", {"format": FORMAT, "version": VERSION, "notice": RESEARCH_USE_ONLY, "tsis": __version__})
    document = to_json_value(record.target)
    shown = ("number", "kind", "name", "note", "made", "id", "version")
    tree.group("target", {name: document[name] for name in shown})
    for name, value in record.target.truth.items():
        write_array(tree, f"target/truth/{_link(name)}", np.array([value]), {"units": unit_of(name), "quantity": name})
    _document(tree, "presses", [to_json_value(press) for press in record.presses])
    for position, numbered in _stacks(record).items():
        _write_stack(record, tree, position, numbered)
    for number, stored in enumerate(record.estimates):
        _write_estimate(tree, f"estimates/{number}", stored, in_force=stored in record.active_estimates)
    for name, calibration in record.calibrations.items():
        _bytes(tree, f"calibrations/{_link(name)}", calibration_bytes(calibration))


def _stacks(record: TargetRecord) -> dict[str, list[tuple[int, StoredPress]]]:
    """Numbered presses by the path of their frames: a stack for each role, size and number of bits."""
    stacks: dict[str, dict[tuple[int, int, bool], list[tuple[int, StoredPress]]]] = {}
    for number, press in enumerate(record.presses):
        kind = (press.rows, press.columns, press.full_scale > 255)
        stacks.setdefault(press.role, {}).setdefault(kind, []).append((number, press))
    return {f"frames/{role}/{at}": kind for role, kinds in stacks.items() for at, kind in enumerate(kinds.values())}


def _write_stack(record: TargetRecord, tree: Tree, location: str, numbered: list[tuple[int, StoredPress]]) -> None:
    presses = [press for _, press in numbered]
    first = presses[0]
    dtype = "uint16" if first.full_scale > 255 else "uint8"
    tree.group(location, {"role": first.role})
    write_stack(
        tree,
        f"{location}/grey",
        (_levels(record, press, dtype) for press in presses),
        (len(presses), first.rows, first.columns),
        dtype,
        {"units": "grey level", "axes": "press, row, column"},
    )
    pixels = [press.mm_per_pixel or (math.nan, math.nan) for press in presses]
    columns: dict[str, tuple[Any, str, str]] = {
        "force": ([press.force_n if press.force_n is not None else math.nan for press in presses], "N", "press"),
        "pixel_size": (pixels, "mm", "press, (x, y)"),
        "axis": ([press.axis_px for press in presses], "px", "press, (x, y)"),
        "full_scale": ([press.full_scale for press in presses], "grey level", "press"),
    }
    for name, (values, units, axes) in columns.items():
        write_array(tree, f"{location}/{name}", np.array(values, dtype=float), {"units": units, "axes": axes})
    since = [(press.taken - EPOCH) // timedelta(microseconds=1) for press in presses]
    units = "microseconds since 1970-01-01T00:00:00Z"
    write_array(tree, f"{location}/taken", np.array(since, dtype=np.int64), {"units": units, "axes": "press"})
    order = np.array([number for number, _ in numbered], dtype=np.int64)
    write_array(tree, f"{location}/press", order, {"units": "1", "axes": "press", "index_of": "presses"})


def _levels(record: TargetRecord, press: StoredPress, dtype: str) -> NDArray[Any]:
    result = record.levels(press)
    if int(result.max()) > np.iinfo(dtype).max:  # a file of 8 bits would wrap it round
        raise RecordsError(
            f"frame {press.frame:.12} must hold levels up to its full scale, {press.full_scale:g}; got {result.max()}"
        )
    return result.astype(dtype, copy=False)


def _write_estimate(tree: Tree, location: str, stored: StoredEstimate, *, in_force: bool) -> None:
    result = stored.estimate
    head: dict[str, Attribute] = {
        "kind": stored.kind,
        "made": stored.made.isoformat(),
        "trusted": result.trusted,
        "in_force": in_force,
        "flags": json.dumps(list(result.flags)),
    }
    if result.printed_presence is not None:
        head["presence"] = float(result.printed_presence)
    tree.group(location, head)
    summary = _summary(result) if result.trusted else {}
    group = "samples" if result.trusted else "untrusted"
    for name, values in result.untrusted.samples.items():
        attributes: dict[str, Attribute] = {
            "quantity": name,
            "units": unit_of(name),
            "axes": "sample",
            "prior_sd": float(result.prior_sd[name]),
            "identified": result.identified(name),
            **summary.get(name, {}),
        }
        write_array(tree, f"{location}/{group}/{_link(name)}", values, attributes)
    place = location if result.trusted else f"{location}/{group}"
    _document(tree, f"{place}/document", estimate_to_json(stored))


def _summary(estimate: Estimate) -> dict[str, dict[str, Attribute]]:
    """Summary statistics by parameter."""
    mean, sd, interval = estimate.mean, estimate.sd, estimate.interval(INTERVAL_LEVEL)
    summary: dict[str, dict[str, Attribute]] = {
        name: {
            **({"mean": mean[name], "sd": sd[name]} if estimate.identified(name) else {}),
            "interval_level": INTERVAL_LEVEL,
            "interval_low": interval[name][0],
            "interval_high": interval[name][1],
        }
        for name in estimate.names
    }
    for name, bound in estimate.cramer_rao_sd.items():
        summary[name]["cramer_rao_sd"] = "infinity" if bound == math.inf else float(bound)
    return summary


def _link(name: str) -> str:
    """A name that is valid in any format; the attribute ``quantity`` has the original."""
    link = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:100]
    return link if link == name else f"{link}-{name.encode('utf-8', 'surrogatepass').hex()[:64]}"


def _document(tree: Tree, path: str, content: Any) -> None:
    _bytes(tree, path, json.dumps(content, allow_nan=False).encode())


def _bytes(tree: Tree, path: str, content: bytes) -> None:
    write_array(tree, path, np.frombuffer(content, np.uint8), {"units": "1", "media_type": "application/json"})


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
