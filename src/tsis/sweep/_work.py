"""The task of a worker: ensure that one file of the data set exists and is complete."""

from __future__ import annotations

import stat
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from tsis.errors import SweepError
from tsis.files import write_durably
from tsis.sweep._data_set import MANIFEST_FILE
from tsis.sweep._shards import LARGEST_SHARD_BYTES, Receipt, encode_shard, press_all, receipt_of, shard_name

if TYPE_CHECKING:
    from tsis.sweep._plan import Plan
    from tsis.sweep._shards import PressFunction, SweepBatch


# Threads of one process have one setting of the threads of linear algebra, which determines the last digits.
_LOCK = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepJob:
    """Common data of all batches of a sweep: absolute path and key of the data set, plan, and press function."""

    folder: str
    plan: Plan
    data_set: str
    press: PressFunction


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished:
    """A complete file: computed now, kept from an earlier run, or repaired because it was damaged or foreign."""

    receipt: Receipt
    state: Literal["computed", "kept", "repaired"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lost:
    """The worker of this batch died."""

    batch: SweepBatch


@dataclass(frozen=True, slots=True, kw_only=True)
class Failed:
    """The batch fails on every repetition, with the reason."""

    reason: str


Outcome: TypeAlias = Finished | Lost | Failed


def finish_batch(job: SweepJob, batch: SweepBatch) -> Finished | Failed:
    """Compute and write the batch's file unless it is complete; failures are outcomes, too."""
    try:
        with _LOCK:
            return _finish(job, batch)
    except SweepError as error:
        return Failed(reason=str(error))
    except OSError as error:
        reason = error.strerror or str(error)
        return Failed(reason=f"{shard_name(batch.shard)} must be readable and writable in the folder; got: {reason}")
    except Exception as error:  # without an answer the batch would be tried again and again
        return Failed(reason=f"{shard_name(batch.shard)} could not be computed: {type(error).__name__}: {error}")


def _finish(job: SweepJob, batch: SweepBatch) -> Finished:
    folder = Path(job.folder)
    if not (folder / MANIFEST_FILE).is_file():
        raise SweepError(f"the folder {job.folder!r} must be seen by every worker; one of them does not find it")
    path = folder / shard_name(batch.shard)
    present = _present(path)
    if present is not None:
        receipt = receipt_of(present, shard=batch.shard, data_set=job.data_set)
        if receipt is not None:
            return Finished(receipt=receipt, state="kept")
    content = encode_shard(press_all(job.plan, batch, job.press), shard=batch.shard, data_set=job.data_set)
    write_durably(path, content)
    receipt = receipt_of(content, shard=batch.shard, data_set=job.data_set)
    if receipt is None:
        raise SweepError(f"{path.name} does not carry what was written into it; the pyarrow at hand is not supported")
    return Finished(receipt=receipt, state="computed" if present is None else "repaired")


def _present(path: Path) -> bytes | None:
    """The file's bytes; None when it is missing, empty when no sweep can have written it."""
    try:
        status = path.stat()
    except FileNotFoundError:
        return None
    return path.read_bytes() if stat.S_ISREG(status.st_mode) and status.st_size <= LARGEST_SHARD_BYTES else b""
