"""The phantoms of a plan in batches, and one batch as one Parquet file that proves its own integrity.

Phantoms are the same on every run and never all in memory. The file's bytes follow from the plan alone. It contains
its own SHA-256, computed with zeros in its position. A damaged, cut or foreign file is therefore
recognised before any parser reads it, without a second file that could be lost.
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

from tsis.errors import FileInputError, SweepError, TsisError, import_extra
from tsis.files import one_line, read_bytes
from tsis.sweep._plan import PROFILES, Range

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.model import Phantom, PressField, Probe
    from tsis.sweep._plan import Plan


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
                document = _output_values(plan, values, press)
            except REFUSALS as reason:
                error[row] = f"{type(reason).__name__}: {reason}"[:LONGEST_ERROR]
                continue
            for name, value in document.items():
                outputs[name][row] = value
    sample = np.repeat(np.arange(batch.first, batch.first + batch.samples), forces)
    return Rows(sample=sample, numbers=numbers | outputs, error=error)


def _output_values(
    plan: Plan, values: Mapping[str, float], press: PressFunction
) -> dict[str, float | NDArray[np.float64]]:
    phantom, force = plan.phantom(values), values["force_n"]
    field = press(plan.probe, phantom, force_n=force, strain=plan.strain)
    document: dict[str, float | NDArray[np.float64]] = {}
    for name in plan.columns:
        if name == "change_by_inclusion_mm":
            reference = press(plan.probe, phantom.without_inclusion(), force_n=force, strain=plan.strain)
            value = field.face_displacement_mm - reference.face_displacement_mm
        else:
            value = getattr(field, name)
        document[name] = np.interp(plan.radii_mm, field.radius_mm, value) if name in PROFILES else value
    return document


NAME = re.compile(r"part-\d{6}\.parquet")
DATA_SET, SHARD, REFUSED, DIGEST = "tsis.data_set", "tsis.shard", "tsis.refused", "tsis.sha256"
LARGEST_SHARD_BYTES = 96 * 2**20  # a file of the most presses and profiles takes 60 million bytes
_ZEROS = b"0" * 64
# In a Parquet footer an entry is its key, the byte 0x18 (a text follows), the text's length and the text.
_BEFORE_DIGEST = DIGEST.encode() + b"\x18" + bytes([len(_ZEROS)])
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
        store_schema=True,
    ) as writer:
        writer.write_table(table, row_group_size=max(1, table.num_rows))
        # Not part of the schema, where they would be stored a second time in another encoding.
        writer.add_key_value_metadata(
            {DATA_SET: data_set, SHARD: str(shard), REFUSED: str(rows.refused), DIGEST: _ZEROS.decode()}
        )
    return sign_shard(sink.getvalue().to_pybytes())


def receipt_of(content: bytes, *, shard: int, data_set: str) -> Receipt | None:
    """Receipt of a file of this data set; None when it is damaged or foreign."""
    if not is_whole(content):
        return None
    try:
        footer = _footer(content)
        metadata = footer.metadata or {}
        if (metadata[DATA_SET.encode()].decode(), int(metadata[SHARD.encode()])) != (data_set, shard):
            return None
        refused = int(metadata[REFUSED.encode()])
        return Receipt(shard=shard, sha256=sha256(content), rows=footer.num_rows, refused=refused)
    except (KeyError, ValueError):
        return None


def data_set_of(path: Path) -> str | None:
    """The data set of a complete file; None when it is damaged or no file of a sweep."""
    content = read_bytes(path, most=LARGEST_SHARD_BYTES)
    if not is_whole(content):
        return None
    try:
        name = (_footer(content).metadata or {}).get(DATA_SET.encode())
        return None if name is None else str(name.decode())
    except ValueError:
        return None


def is_whole(content: bytes) -> bool:
    """True when the SHA-256 inside the file matches its bytes."""
    position = digest_position(content)
    if position is None:
        return False
    return content[position : position + len(_ZEROS)] == rows_sha256(content, position)


def decode_shard(content: bytes) -> Any:
    """The Arrow table of a verified file.

    `FileInputError` when it is no Parquet file, or unpacks to more than a sweep writes.
    """
    pa, parquet = _arrow()
    try:
        footer = _footer(content)
        unpacked = sum(abs(footer.row_group(group).total_byte_size) for group in range(footer.num_row_groups))
        table = (
            parquet.read_table(pa.BufferReader(content), use_threads=False) if unpacked <= LARGEST_SHARD_BYTES else None
        )
    except Exception as error:  # hostile bytes make Arrow raise nearly anything
        raise FileInputError(f"a file of a sweep must be a whole Parquet file; got: {one_line(error)}") from error
    if table is None:
        raise FileInputError(f"a file of a sweep must unpack to at most {LARGEST_SHARD_BYTES} bytes; got {unpacked}")
    return table


def sha256(content: bytes) -> str:
    """SHA-256 in hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def _arrow() -> tuple[Any, Any]:
    pa, parquet = (import_extra(name, feature=FEATURE, extra="cluster") for name in ("pyarrow", "pyarrow.parquet"))
    return pa, parquet


def _footer(content: bytes) -> Any:
    pa, parquet = _arrow()
    try:
        return parquet.read_metadata(pa.BufferReader(content))
    except Exception as error:  # hostile bytes make Arrow raise nearly anything
        raise FileInputError("a file of a sweep must be a whole Parquet file; its footer is damaged") from error


def sign_shard(content: bytes) -> bytes:
    position = digest_position(content)
    if position is None or content[position : position + len(_ZEROS)] != _ZEROS:
        raise SweepError("this version of pyarrow writes Parquet footers in an unknown form; install an older one")
    return content[:position] + rows_sha256(content, position) + content[position + len(_ZEROS) :]


def digest_position(content: bytes) -> int | None:
    start = content.rfind(_BEFORE_DIGEST)
    position = start + len(_BEFORE_DIGEST)
    return None if start < 0 or position + len(_ZEROS) > len(content) else position


def rows_sha256(content: bytes, index: int) -> bytes:
    digest = hashlib.sha256(content[:index])
    digest.update(_ZEROS)
    digest.update(content[index + len(_ZEROS) :])
    return digest.hexdigest().encode()
