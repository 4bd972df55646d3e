"""Whether a store is what was stored: the audit's chain, rows against their last entries, files against their names."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from tsis.model.errors import RecordsError
from tsis.records.anchor import read_anchor
from tsis.records.audit import FIRST, Head, read_head
from tsis.records.canonical import digest
from tsis.records.tables import RECORDED, audit, calibrations, estimates, frames

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from sqlalchemy import Connection, Table

    from tsis.records.store import Store


@dataclass(frozen=True, slots=True, kw_only=True)
class Verification:
    """What was found.

    Attributes
    ----------
    faults
        One sentence for each thing that is not as it was stored; none when the store can be believed.
    head
        Last entry of the audit. Written down elsewhere, it shows later whether the whole store was put back.
    rows, files
        How many were compared.
    unnamed
        Files that no row names: of saves that were cut short before they were acknowledged. No fault.
    unanchored
        How many of the last entries of the audit its anchor does not vouch for: of saves that were killed between row
        and anchor, or found no room for it. No fault; the next record brings it up to date.
    """

    faults: tuple[str, ...]
    head: Head
    rows: int
    files: int
    unnamed: int
    unanchored: int

    @property
    def sound(self) -> bool:
        """Whether all is as it was stored."""
        return not self.faults


def verify(store: Store, *, progress: Callable[[int, int], None] | None = None) -> Verification:
    """Compare all of a store with what its audit says was stored.

    Parameters
    ----------
    store
        What to verify; it is only read.
    progress
        Told how many of how many files were read.

    Raises
    ------
    RecordsError
        When the database cannot be read at all.
    """
    with store.database.reading() as connection:
        faults, head = [*_chain_faults(connection)], read_head(connection)
        anchor_faults, unanchored = _anchor_faults(connection, store, head)
        row_faults, count = _row_faults(connection)
        wanted = dict(_files(connection))
    faults += [*anchor_faults, *row_faults]
    for done, ((name, ending), of) in enumerate(wanted.items(), start=1):
        try:
            store.blobs.get(name, ending)
        except RecordsError as error:
            faults.append(f"{of}: {error}")
        if progress is not None:
            progress(done, len(wanted))
    unnamed = sum(1 for each in store.blobs.names() if each not in wanted)
    return Verification(
        faults=tuple(faults), head=head, rows=count, files=len(wanted), unnamed=unnamed, unanchored=unanchored
    )


def _entries(connection: Connection) -> Iterator[dict[str, Any]]:
    for entry in connection.execution_options(yield_per=1000).execute(select(audit).order_by(audit.c.number)):
        yield entry._asdict()


def _chain_faults(connection: Connection) -> Iterator[str]:
    last = Head(number=0, hash=FIRST)
    for entry in _entries(connection):
        content = {name: value for name, value in entry.items() if name != "hash"}
        number = entry["number"]
        if number != last.number + 1:
            yield f"audit entry {last.number + 1} must follow entry {last.number}; {number} does (entries were removed)"
        elif entry["previous"] != last.hash:
            yield f"audit entry {number} must follow the one before it; it follows another"
        if digest(content) != entry["hash"]:
            yield f"audit entry {number} must be as it was written; it was changed"
        last = Head(number=number, hash=entry["hash"])
    if read_head(connection) != last:
        yield f"the audit must end at entry {read_head(connection).number}; it ends at {last.number}"


def _anchor_faults(connection: Connection, store: Store, head: Head) -> tuple[list[str], int]:
    """What is wrong with the anchor, and by how many entries it lags."""
    faults = []
    try:
        identity, anchored = read_anchor(store.folder)
    except RecordsError as error:
        return [str(error)], head.number
    if identity != store.identity:
        faults.append(f"the anchor must be that of this store, {store.identity}; it is that of {identity!r:.60}")
    found = connection.execute(select(audit.c.hash).where(audit.c.number == anchored.number)).scalar()
    if found != anchored.hash and anchored != Head(number=0, hash=FIRST):
        faults.append(
            f"audit entry {anchored.number} must be the one that the anchor tells; it is another, or was cut off"
        )
    return faults, max(0, head.number - anchored.number)


def _row_faults(connection: Connection) -> tuple[list[str], int]:
    """Rows that differ from their last entry, were put in beside the audit, or taken out."""
    last = {(entry["kind"], entry["row"]): entry["content"] for entry in _entries(connection)}
    faults, count = [], 0
    for name, table in RECORDED.items():
        primary = next(iter(table.primary_key)).name
        for found in connection.execution_options(yield_per=1000).execute(select(table)):
            row = found._asdict()
            count += 1
            key = (name, row[primary])
            content = last.pop(key, None)
            if content is None:
                faults.append(f"{name} {key[1]}: this row was put in beside the audit")
            elif content != digest(row):
                faults.append(f"{name} {key[1]}: this row is not as it was stored")
    faults += [f"{name} {key}: this row was taken out" for name, key in last]
    return faults, count


def _files(connection: Connection) -> Iterator[tuple[tuple[str, str], str]]:
    """Name and ending of every file that rows name, and which row that is."""
    kinds: tuple[tuple[Table, str, str], ...] = (
        (frames, "id", "png"),
        (calibrations, "file", "json"),
        (estimates, "samples", "samples"),
    )
    for table, column, ending in kinds:
        for key, name in connection.execute(select(table.c.id, table.c[column])):
            yield (str(name), ending), f"{table.name} {key}"
