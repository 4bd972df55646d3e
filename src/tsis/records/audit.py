"""The audit: who stored or changed what and when, each entry bound to the one before it by its hash.

An entry holds the digest of the row as it is from then on. So a changed, added or removed row shows against its last
entry, and a changed, added or removed entry breaks the chain. That the chain was not cut short, or written anew as a
whole, is what the anchor outside the database tells (`tsis.records.anchor`).
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import insert, select, update

from tsis.model.errors import RecordsError
from tsis.records.canonical import digest
from tsis.records.tables import audit, audit_head

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from sqlalchemy import Connection

FIRST = "0" * 64  # what stands before the first entry


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditChange:
    """A row as it is from now on: what was done, in which table, to which key."""

    action: str
    kind: str
    row: str
    values: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditHead:
    """Number and hash of the last entry."""

    number: int
    hash: str


def begin_audit(connection: Connection) -> None:
    """Start the chain of a new store."""
    connection.execute(insert(audit_head).values(id=1, number=0, hash=FIRST))


def locked_head(connection: Connection) -> AuditHead:
    """The last entry; from here to the end of the transaction nobody else appends.

    Raises
    ------
    RecordsError
        When the database does not say which that is.
    """
    row = connection.execute(select(audit_head).where(audit_head.c.id == 1).with_for_update()).first()
    if row is None:
        raise RecordsError(
            "the database must say which entry of the audit is the last; that row was taken out (tsis records verify "
            "tells more; take the database from a backup)"
        )
    return AuditHead(number=row.number, hash=row.hash)


def has_entry(connection: Connection, head: AuditHead) -> bool:
    """Whether the audit holds the entry of that number with that hash."""
    found = connection.execute(select(audit.c.hash).where(audit.c.number == head.number)).scalar()
    return bool(found == head.hash)


def last_content(connection: Connection, kind: str, row: str) -> str | None:
    """Digest of a row as its last entry has it; None where it has none."""
    of_the_row = (audit.c.kind == kind) & (audit.c.row == row)
    return connection.execute(select(audit.c.content).where(of_the_row).order_by(audit.c.number.desc())).scalar()


def append_audit(connection: Connection, head: AuditHead, changes: Iterable[AuditChange], *, actor: str) -> AuditHead:
    """Enter changes after ``head``, which `locked_head` gave, and return the new one."""
    moment = datetime.now(UTC).isoformat()
    entries = []
    for change in changes:
        entry: dict[str, Any] = {
            "number": head.number + 1,
            "moment": moment,
            "actor": actor,
            "action": change.action,
            "kind": change.kind,
            "row": change.row,
            "content": digest(change.values),
            "previous": head.hash,
        }
        entries.append({**entry, "hash": digest(entry)})
        head = AuditHead(number=head.number + 1, hash=str(entries[-1]["hash"]))
    if entries:
        connection.execute(insert(audit), entries)
        connection.execute(update(audit_head).where(audit_head.c.id == 1).values(number=head.number, hash=head.hash))
    return head
