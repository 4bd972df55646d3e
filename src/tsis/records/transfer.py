"""Import of target records from other stores, and free target numbers."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from sqlalchemy import func, select

from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.file import calibration_bytes
from tsis.errors import InputError, RecordsError
from tsis.records import rows
from tsis.records import schema as tables
from tsis.records.blobs import frame_bytes, frame_levels, samples_bytes
from tsis.records.reader import MOST_AT_ONCE, in_lineage
from tsis.records.rows import insert_row, insert_row_once
from tsis.records.schema import target_table
from tsis.records.values import map_bytes

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence

    from sqlalchemy import Connection, Table

    from tsis.records.audit import AuditChange
    from tsis.records.blobs import Blobs
    from tsis.records.values import StoredPress, Target, TargetRecord


_number = target_table.c.number


def is_taken(connection: Connection, number: int) -> bool:
    """Whether a target has this number."""
    return connection.execute(select(_number).where(_number == number)).first() is not None


def next_number(connection: Connection) -> int:
    """The number after the last; `InputError` when the last is the largest."""
    last = _last(connection)
    if last >= LARGEST_TARGET:
        raise InputError(
            f"number must be given in a store that holds target {LARGEST_TARGET}, after which there is none; got none "
            f"(give one that is free, as {_lowest(connection)})"
        )
    return last + 1


def free_number(connection: Connection, requested: int) -> int:
    """The requested number, else the one after the last, else the lowest free one."""
    if not is_taken(connection, requested):
        return requested
    last = _last(connection)
    return last + 1 if last < LARGEST_TARGET else _lowest(connection)


def _last(connection: Connection) -> int:
    return int(connection.execute(select(func.max(_number))).scalar_one() or 0)


def _lowest(connection: Connection) -> int:
    taken = set(connection.execute(select(_number)).scalars())
    for number in range(1, LARGEST_TARGET + 1):
        if number not in taken:
            return number
    raise RecordsError(f"a store must hold at most {LARGEST_TARGET} targets; it has as many (begin another)")


ACTION = "import"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportedTarget:
    """Result of the import of a target record.

    Attributes
    ----------
    target
        The target in this store, with another number where its own was taken.
    new
        Whether the target is new here.
    presses, estimates
        Number of added presses, and of added estimates and maps.
    present
        Number of presses, estimates and maps that were here before.
    differing
        Number of presses that differ from their version here.
    """

    target: Target
    new: bool
    presses: int
    estimates: int
    present: int
    differing: int


class TargetImport:
    """A target record whose files are stored; `enter` then adds its rows.

    ``present`` is the result of `stored_frames`; ``progress`` is called with (done, all) frames. `RecordsError` when
    the record lacks something that it cites, or a file cannot be stored.
    """

    def __init__(
        self,
        record: TargetRecord,
        blobs: Blobs,
        present: Mapping[str, str],
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        self.target = record.target
        self.frames: dict[str, rows.Row] = {}
        self.presses: list[rows.Row] = []
        for done, press in enumerate(record.presses, start=1):
            # Another library may compress equal levels to other bytes; stored levels are not stored twice.
            content = _content(record, press, blobs, present) or frame_bytes(record.image(press))
            frame = blobs.put(content, "png")
            sizes = {"rows": press.rows, "columns": press.columns, "bytes": len(content)}
            self.frames[frame] = {"id": frame, **sizes}
            self.presses.append(rows.press_row(replace(press, frame=frame)))
            if progress is not None:
                progress(done, len(record.presses))
        self.calibrations = [
            rows.calibration_row(calibration, blobs.put(calibration_bytes(calibration), "json"))
            for calibration in record.calibrations.values()
        ]
        self.estimates = [
            rows.estimate_row(stored, blobs.put(samples_bytes(stored.estimate), "samples"))
            for stored in in_lineage(record.estimates)  # a row can cite only earlier rows
        ]
        self.maps = [
            rows.map_row(stored, blobs.put(map_bytes(stored.estimate), "json")) for stored in in_lineage(record.maps)
        ]

    def enter(self, connection: Connection) -> tuple[ImportedTarget, list[AuditChange]]:
        """Add the missing rows; `RecordsError` when an identity is taken by another row."""
        stored = connection.execute(
            select(tables.target_table).where(tables.target_table.c.id == self.target.id)
        ).first()
        changes: list[AuditChange] = []
        if stored is None:
            target = replace(self.target, number=free_number(connection, self.target.number), version=1)
            changes.append(insert_row(connection, tables.target_table, rows.target_row(target), action=ACTION))
        else:
            target = rows.target_of_row(stored._asdict())
        for table, shared in (
            (tables.calibration_table, self.calibrations),
            (tables.frame_table, list(self.frames.values())),
        ):
            for row in shared:
                changes += insert_row_once(connection, table, row, action=ACTION)
        added, differing = dict.fromkeys((table.name for table, _ in self._own()), 0), 0
        for table, row in self._own():
            there = _stored_row(connection, table, row)
            if there is None:
                changes.append(insert_row(connection, table, row, action=ACTION))
                added[table.name] += 1
            elif there["target"] != row["target"]:
                raise RecordsError(f"{table.name} {row['id']!r:.40} must be of this target; here it is of another")
            else:
                differing += there != row
        presses = added.pop(tables.press_table.name, 0)
        results = sum(added.values())
        return ImportedTarget(
            target=target,
            new=stored is None,
            presses=presses,
            estimates=results,
            present=len(list(self._own())) - presses - results,
            differing=differing,
        ), changes

    def _own(self) -> Iterator[tuple[Table, rows.Row]]:
        yield from ((tables.press_table, row) for row in self.presses)
        yield from ((tables.estimate_table, row) for row in self.estimates)
        yield from ((tables.map_table, row) for row in self.maps)


def require_kind(target: Target, kind: str) -> None:
    """Raise `RecordsError` for a target of the other kind: their data must never mix."""
    if target.kind != kind:
        raise RecordsError(
            f"a store of {kind}s must hold nothing else; this target is a {target.kind} "
            f"(open another store with --kind {target.kind})"
        )


def stored_frames(connection: Connection, presses: Sequence[StoredPress]) -> dict[str, str]:
    """Frames of the presses that are in the store, by the identity of the press."""
    table, ids = tables.press_table.c, [press.id for press in presses]
    frames: dict[str, str] = {}
    for at in range(0, len(ids), MOST_AT_ONCE):
        query = select(table.id, table.frame).where(table.id.in_(ids[at : at + MOST_AT_ONCE]))
        frames |= {row.id: row.frame for row in connection.execute(query)}
    return frames


def _content(record: TargetRecord, press: StoredPress, blobs: Blobs, stored: Mapping[str, str]) -> bytes | None:
    """The stored file with the grey levels of a press, or None."""
    levels = record.levels(press)
    for name in (stored.get(press.id, ""), press.frame):
        with suppress(RecordsError):  # missing or damaged
            content = blobs.get(name, "png")
            if np.array_equal(frame_levels(content, name), levels):
                return content
    return None


def _stored_row(connection: Connection, table: Table, row: rows.Row) -> dict[str, Any] | None:
    result = connection.execute(select(table).where(table.c.id == row["id"])).first()
    return None if result is None else result._asdict()
