"""Verification of a store: the schema, the audit chain, rows against their entries, files against their hashes.

A manipulated database may contain any type anywhere. That is a fault to report, not an error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from tsis.errors import RecordsError
from tsis.files import FIRST_HASH, digest_or_none, link_faults, one_line
from tsis.records.schema import (
    RECORDED,
    audit_head_table,
    audit_table,
    calibration_table,
    estimate_table,
    frame_table,
    schema_faults,
)
from tsis.records.store._audit import BEFORE, LOST, AuditHead, has_entry, read_anchor
from tsis.records.store._audit import KIND as ANCHOR

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sqlalchemy import Connection, Row, Select, Table

    from tsis.records.store._store import Store


_AT_ONCE = 1000  # rows
GONE = digest_or_none({})  # in the last entry of a row that was erased


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreVerification:
    """Result of a verification.

    Attributes
    ----------
    faults
        A message for each difference from the stored state; empty for a sound store.
    notes
        A message for each other event.
    head
        Last entry of the audit. A copy of it elsewhere shows later whether the whole store was replaced.
    rows, files
        Number of checked rows and files.
    unnamed
        Number of files without a row, of interrupted saves. No fault.
    unanchored
        Number of audit entries after the anchor, of saves that were interrupted before the anchor was written. No
        fault; the next save writes it.
    """

    faults: tuple[str, ...]
    notes: tuple[str, ...]
    head: AuditHead
    rows: int
    files: int
    unnamed: int
    unanchored: int

    @property
    def sound(self) -> bool:
        """Whether there are no faults."""
        return not self.faults


def verify_store(store: Store, *, progress: Callable[[int, int], None] | None = None) -> StoreVerification:
    """Compare a store with its audit, read-only.

    ``progress`` is called with (done, all) files. `RecordsError` when the database is unreadable.
    """
    faults, anchored = _anchor(store)  # before the database, which others may extend meanwhile
    with store.database.reading() as connection:
        faults += schema_faults(connection)
        faults += _chain_faults(connection)
        head = last_entry(connection)
        if anchored is not None and anchored != BEFORE and not has_entry(connection, anchored):
            faults.append(
                f"audit entry {anchored.number} must be the one that the anchor tells; it is another, or was cut off"
            )
        row_faults, count = _row_faults(connection)
        notes = tuple(_notes(connection))
        requested = dict(cited_files(connection))
    faults += row_faults
    for done, ((name, ending), of) in enumerate(requested.items(), start=1):
        try:
            store.blobs.get(name, ending)
        except RecordsError as error:
            faults.append(f"{of}: {error}")
        if progress is not None:
            progress(done, len(requested))
    return StoreVerification(
        faults=tuple(faults),
        notes=notes,
        head=head,
        rows=count,
        files=len(requested),
        unnamed=sum(1 for name in store.blobs.names() if name not in requested),
        unanchored=max(0, head.number - (0 if anchored is None else anchored.number)),
    )


def _anchor(store: Store) -> tuple[list[str], AuditHead | None]:
    try:
        identity, anchored = read_anchor(store.folder)
    except RecordsError as error:
        return [str(error)], None
    if identity != store.identity:
        return [f"the anchor must be that of this store, {store.identity}; it is that of {identity!r:.60}"], anchored
    return [], anchored


def _notes(connection: Connection) -> Iterator[str]:
    """Notes on lost anchors."""
    for row in _all(connection, select(audit_table).where(audit_table.c.action == LOST).order_by(audit_table.c.number)):
        number, moment, actor = (one_line(item, 80) for item in (row.number, row.moment, row.actor))
        yield (
            f"audit entry {number} tells that the anchor was missing when {actor} went on at {moment}: whether the "
            "entries before it were cut short or written anew until then, only a backup or a head that was written "
            "down can tell"
        )


def last_entry(connection: Connection) -> AuditHead:
    """The last entry according to the database; `BEFORE` where that is invalid."""
    results = [tuple(row) for row in connection.execute(select(audit_head_table).limit(2))]
    if len(results) != 1 or results[0][0] != 1 or type(results[0][1]) is not int or not isinstance(results[0][2], str):
        return BEFORE
    return AuditHead(number=results[0][1], hash=results[0][2])


def _all(connection: Connection, query: Select[Any]) -> Iterator[Row[Any]]:
    yield from connection.execute(query, execution_options={"yield_per": _AT_ONCE})


def _chain_faults(connection: Connection) -> Iterator[str]:
    number, before = 0, FIRST_HASH
    for row in _all(connection, select(audit_table).order_by(audit_table.c.number)):
        entry = row._asdict()
        faults, shown = link_faults(entry, number + 1, before), one_line(entry["number"], 40)
        if "number" in faults:
            yield f"audit entry {number + 1} must follow entry {number}; {shown} does (entries were removed or put in)"
        elif "previous" in faults:
            yield f"audit entry {number + 1} must follow the one before it; it follows another"
        if "hash" in faults:
            yield f"audit entry {shown} must be as it was written; it was changed"
        number, before = entry["number"] if type(entry["number"]) is int else number + 1, entry["hash"]
    head = last_entry(connection)
    if (head.number, head.hash) != (number, before):
        yield f"the audit must end at entry {head.number}; it ends at {number}"


def _row_faults(connection: Connection) -> tuple[list[str], int]:
    """Rows that differ from their last entry, lack one, or are missing."""
    entries = _all(
        connection, select(audit_table.c.kind, audit_table.c.row, audit_table.c.content).order_by(audit_table.c.number)
    )
    last = {(entry.kind, entry.row): entry.content for entry in entries if entry.kind != ANCHOR}
    faults, count = [], 0
    for name, table in RECORDED.items():
        primary = next(iter(table.primary_key)).name
        for result in _all(connection, select(table)):
            row = result._asdict()
            count += 1
            key, shown = (name, row[primary]), one_line(row[primary], 80)
            if key not in last:
                faults.append(f"{name} {shown}: this row was put in beside the audit")
            elif last.pop(key) != digest_or_none(row):
                faults.append(f"{name} {shown}: this row is not as it was stored")
    taken_out = [key for key, content in last.items() if content != GONE]
    faults += [f"{one_line(name, 40)} {one_line(key, 80)}: this row was taken out" for name, key in taken_out]
    return faults, count


def cited_files(connection: Connection) -> Iterator[tuple[tuple[str, str], str]]:
    """Name and ending of every file that a row cites, with the row."""
    kinds: tuple[tuple[Table, str, str], ...] = (
        (frame_table, "id", "png"),
        (calibration_table, "file", "json"),
        (estimate_table, "samples", "samples"),
    )
    for table, column, ending in kinds:
        for row in _all(connection, select(table.c.id, table.c[column].label("file"))):
            yield (str(row.file), ending), f"{table.name} {one_line(row.id, 80)}"
