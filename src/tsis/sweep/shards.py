"""The phantoms of a plan in batches, and a batch as a Parquet file.

Phantoms are the same on every run and never all in memory. The file's bytes follow from its rows alone, so that a file
is whole when its rows, written again, give the same bytes: Parquet's checksums stand for the rows, and the comparison
for all the rest.
"""

from __future__ import annotations

import hashlib
import re
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from tsis.errors import FileInputError, TsisError, import_extra
from tsis.files.reading import one_line, read_bytes
from tsis.sweep.plan import PROFILES, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.model.phantom import Phantom
    from tsis.model.press import PressField
    from tsis.model.probe import Probe
    from tsis.sweep.plan import Plan


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweepBatch:
    """The phantoms of a file, numbered from 0: the number of the first, and by quantity one value per phantom."""

    shard: int
    first: int
    values: dict[str, NDArray[np.float64]]

    @property
    def samples(self) -> int:
        """Number of phantoms."""
        return len(next(iter(self.values.values())))


def sweep_batches(plan: Plan) -> Iterator[SweepBatch]:
    """Every batch of ``plan`` in the order of its files."""
    values = _grid(plan) if plan.sample == "grid" else _sampled(plan)
    for shard in range(plan.shards):
        first = shard * plan.batch
        size = min(plan.batch, plan.samples - first)
        yield SweepBatch(shard=shard, first=first, values=values(first, size))


def _sampled(plan: Plan) -> Callable[[int, int], dict[str, NDArray[np.float64]]]:
    names = plan.sampled
    draw = _unit_points(plan.sample, len(names), plan.samples, plan.seed or 0)

    def values(_: int, size: int) -> dict[str, NDArray[np.float64]]:
        unit = dict(zip(names, draw(size).T, strict=True))
        return {
            name: value.at(unit[name]) if isinstance(value, Range) else np.full(size, value, dtype=float)
            for name, value in plan.quantities.items()
        }

    return values


def _unit_points(sample: str, dimensions: int, count: int, seed: int) -> Callable[[int], NDArray[np.float64]]:
    """Draws the next points of the unit cube, shape (size, dimensions); ``count`` in all."""
    if sample == "random":
        rng = np.random.default_rng(seed)
        return lambda size: rng.random((size, dimensions))
    if sample == "latin-hypercube":
        left = iter(scipy.stats.qmc.LatinHypercube(dimensions, rng=seed).random(count))
        return lambda size: np.array([next(left) for _ in range(size)])
    sequence = scipy.stats.qmc.Sobol(dimensions, rng=seed)

    def draw(size: int) -> NDArray[np.float64]:
        with warnings.catch_warnings():
            # SciPy warns of a first piece that is no power of two; only the whole count matters.
            warnings.filterwarnings("ignore", message="The balance properties", category=UserWarning)
            return sequence.random(size)

    return draw


def _grid(plan: Plan) -> Callable[[int, int], dict[str, NDArray[np.float64]]]:
    lists = {
        name: np.array(value if isinstance(value, tuple) else (value,), dtype=float)
        for name, value in plan.quantities.items()
        if not isinstance(value, Range)
    }
    shape = tuple(len(values) for values in lists.values())

    def values(first: int, size: int) -> dict[str, NDArray[np.float64]]:
        positions = np.unravel_index(np.arange(first, first + size), shape)  # the last quantity runs fastest
        return {name: lists[name][position] for name, position in zip(lists, positions, strict=True)}

    return values


LONGEST_ERROR = 300
# Singular matrices; any other failure is a fault of the program and stops the sweep.
REFUSALS = (TsisError, np.linalg.LinAlgError, ArithmeticError)


class PressFunction(Protocol):
    """Function for a press: `tsis.mechanics.press`, or a stand-in."""

    def __call__(self, probe: Probe, phantom: Phantom, /, *, force_n: float, strain: str) -> PressField:
        """Press ``phantom`` with ``probe``."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rows:
    """Presses as columns, ordered by phantom, then by force.

    Attributes
    ----------
    sample
        Number of the phantom in the sweep, shape (n,).
    numbers
        By name: ``force_n`` and the plan's quantities, shape (n,); then the plan's columns, shape (n,), profiles
        (n, number of radii). NaN where the press was refused.
    error
        Reason where a press was refused, empty elsewhere.
    """

    sample: NDArray[np.int64]
    numbers: dict[str, NDArray[np.float64]]
    error: list[str]

    @property
    def refused(self) -> int:
        """Number of refused presses."""
        return sum(map(bool, self.error))


def press_all(plan: Plan, batch: SweepBatch, press: PressFunction) -> Rows:
    """Press every phantom of ``batch`` with every force of ``plan``."""
    forces, count = len(plan.forces_n), batch.samples * len(plan.forces_n)
    numbers = {"force_n": np.tile(np.array(plan.forces_n), batch.samples)}
    numbers |= {name: np.repeat(values, forces) for name, values in batch.values.items()}
    outputs = {
        name: np.full((count, len(plan.radii_mm)) if name in PROFILES else count, np.nan) for name in plan.columns
    }
    error = [""] * count
    with threadpool_limits(limits=1):  # results of several threads depend on their number
        for row in range(count):
            values = {name: float(column[row]) for name, column in numbers.items()}
            try:
                found = _output_values(plan, values, press)
            except REFUSALS as reason:
                error[row] = f"{type(reason).__name__}: {reason}"[:LONGEST_ERROR]
                continue
            for name, value in found.items():
                outputs[name][row] = value
    sample = np.repeat(np.arange(batch.first, batch.first + batch.samples), forces)
    return Rows(sample=sample, numbers=numbers | outputs, error=error)


def _output_values(
    plan: Plan, values: Mapping[str, float], press: PressFunction
) -> dict[str, float | NDArray[np.float64]]:
    phantom, force = plan.phantom(values), values["force_n"]
    field = press(plan.probe, phantom, force_n=force, strain=plan.strain)
    found: dict[str, float | NDArray[np.float64]] = {}
    for name in plan.columns:
        if name == "change_by_inclusion_mm":
            reference = press(plan.probe, phantom.without_inclusion(), force_n=force, strain=plan.strain)
            value = field.face_displacement_mm - reference.face_displacement_mm
        else:
            value = getattr(field, name)
        found[name] = np.interp(plan.radii_mm, field.radius_mm, value) if name in PROFILES else value
    return found


NAME = re.compile(r"part-\d{6}\.parquet")
DATA_SET, SHARD = b"tsis.data_set", b"tsis.shard"
LARGEST_SHARD_BYTES = 96 * 2**20  # a file of the most presses and profiles takes 60 million bytes
FEATURE = "a sweep's Parquet files"


@dataclass(frozen=True, slots=True, kw_only=True)
class Receipt:
    """Number of a file of the data set, from 0, its SHA-256, and its presses and refused presses."""

    shard: int
    sha256: str
    rows: int
    refused: int


def shard_name(shard: int) -> str:
    """The file's name.

    Examples
    --------
    >>> shard_name(12)
    'part-000012.parquet'
    """
    return f"part-{shard:06d}.parquet"


def encode_shard(rows: Rows, *, shard: int, data_set: str) -> bytes:
    """The bytes of a file."""
    pa, parquet = _arrow()
    columns = {"sample": pa.array(rows.sample, pa.int64())}
    for name, values in rows.numbers.items():
        flat = pa.array(values.ravel(), pa.float64())
        columns[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1]) if name in PROFILES else flat
    columns["error"] = pa.array(rows.error, pa.string())
    table = pa.table(columns)
    sink = pa.BufferOutputStream()
    # Every option that shapes the bytes is explicit: a default may change with the library.
    with parquet.ParquetWriter(
        sink,
        table.schema,
        version="2.6",
        data_page_version="1.0",
        compression="zstd",
        compression_level=3,
        use_dictionary=False,
        write_statistics=False,
        write_page_checksum=True,
        store_schema=True,
    ) as writer:
        writer.write_table(table, row_group_size=max(1, table.num_rows))
        # Not part of the schema, where they would be stored a second time in another encoding.
        writer.add_key_value_metadata({DATA_SET: data_set, SHARD: str(shard)})
    return bytes(sink.getvalue().to_pybytes())


def receipt_of(content: bytes, *, shard: int, data_set: str) -> Receipt | None:
    """Receipt of a file of this data set; None when it is damaged or foreign."""
    try:
        stated, rows = _read(content)
        whole = _place(stated) == (data_set, shard) and encode_shard(rows, shard=shard, data_set=data_set) == content
    except FileInputError:
        return None
    if not whole:
        return None
    return Receipt(shard=shard, sha256=sha256(content), rows=len(rows.error), refused=rows.refused)


def data_set_of(path: Path) -> str | None:
    """The data set of a whole file; None when it is damaged or no file of a sweep."""
    content = read_bytes(path, most=LARGEST_SHARD_BYTES)
    try:
        data_set, shard = _place(_read(content)[0])
    except FileInputError:
        return None
    return None if receipt_of(content, shard=shard, data_set=data_set) is None else data_set


def decode_shard(content: bytes) -> Rows:
    """The rows of a file.

    `FileInputError` when it is no Parquet file of a sweep, or unpacks to more than a sweep writes.
    """
    return _read(content)[1]


def sha256(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def _arrow() -> tuple[Any, Any]:
    pa, parquet = (import_extra(name, feature=FEATURE, extra="cluster") for name in ("pyarrow", "pyarrow.parquet"))
    return pa, parquet


def _read(content: bytes) -> tuple[dict[bytes, bytes], Rows]:
    """What a file states in its footer, and its rows, whose checksums are verified."""
    pa, parquet = _arrow()
    try:
        footer = parquet.read_metadata(pa.BufferReader(content))
        unpacked = sum(abs(footer.row_group(group).total_byte_size) for group in range(footer.num_row_groups))
        if unpacked <= LARGEST_SHARD_BYTES:
            source = pa.BufferReader(content)
            table = parquet.read_table(source, use_threads=False, page_checksum_verification=True)
            return dict(footer.metadata or {}), _rows(table)
    except Exception as error:  # hostile bytes make Arrow raise nearly anything
        raise FileInputError(f"a file of a sweep must be a whole Parquet file; got: {one_line(error)}") from error
    raise FileInputError(f"a file of a sweep must unpack to at most {LARGEST_SHARD_BYTES} bytes; got {unpacked}")


def _rows(table: Any) -> Rows:
    columns = {name: table.column(name).combine_chunks() for name in table.column_names}
    error, sample = columns.pop("error").to_pylist(), _numbers(columns.pop("sample"))
    numbers = {
        name: _numbers(column.flatten()).reshape(-1, column.type.list_size) if name in PROFILES else _numbers(column)
        for name, column in columns.items()
    }
    if {len(values) for values in (error, *numbers.values())} != {len(sample)}:
        raise ValueError("its columns differ in length")
    return Rows(sample=sample, numbers=numbers, error=[str(text) for text in error])


def _numbers(column: Any) -> NDArray[Any]:
    values = np.asarray(column.to_numpy(zero_copy_only=False))
    if values.dtype.kind not in "if":
        raise TypeError("its columns are not numbers")
    return values


def _place(stated: dict[bytes, bytes]) -> tuple[str, int]:
    """The data set and the number that a file states."""
    try:
        return stated[DATA_SET].decode(), int(stated[SHARD])
    except (KeyError, ValueError) as error:
        raise FileInputError("a file of a sweep must state its data set and number; got neither") from error
