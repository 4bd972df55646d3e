"""The audit: a hash-chained log of who stored or changed what and when.

An entry has the digest of the new row: a changed, added or removed row contradicts its last entry, such an entry breaks
the chain, and the anchor, a file outside the database, detects a chain that was truncated or rewritten as a whole.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import insert, select, update

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import RecordsError, TsisError
from tsis.files.atomic import DISK, Disk, write_durably
from tsis.files.canonical_json import digest, json_bytes
from tsis.files.hash_chain import FIRST_HASH, linked_entry
from tsis.files.reading import printable_path, read_object
from tsis.model.require import require_integer, require_type
from tsis.records.schema import audit_head_table, audit_table

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping
    from pathlib import Path

    from sqlalchemy import Connection


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditChange:
    """A change of a row: the action, the table, the key and the new values."""

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
    connection.execute(insert(audit_head_table).values(id=1, number=0, hash=FIRST_HASH))


def locked_head(connection: Connection) -> AuditHead:
    """The last entry, locked until the end of the transaction; `RecordsError` when the database does not name it."""
    row = connection.execute(select(audit_head_table).where(audit_head_table.c.id == 1).with_for_update()).first()
    if row is None:
        raise RecordsError(
            "the database must say which entry of the audit is the last; that row was taken out (tsis records verify "
            "tells more; take the database from a backup)"
        )
    return AuditHead(number=row.number, hash=row.hash)


def has_entry(connection: Connection, head: AuditHead) -> bool:
    """Whether the audit has this entry."""
    stored = connection.execute(select(audit_table.c.hash).where(audit_table.c.number == head.number)).scalar()
    return bool(stored == head.hash)


def last_content(connection: Connection, kind: str, row: str) -> str | None:
    """Digest of a row in its last entry, or None."""
    entries = select(audit_table.c.content).where((audit_table.c.kind == kind) & (audit_table.c.row == row))
    return connection.execute(entries.order_by(audit_table.c.number.desc())).scalar()


def append_audit(connection: Connection, head: AuditHead, changes: Iterable[AuditChange], *, actor: str) -> AuditHead:
    """Append entries after ``head``, the result of `locked_head`, and return the new head."""
    moment = datetime.now(UTC).isoformat()
    entries = []
    for change in changes:
        entry: dict[str, Any] = {"moment": moment, "actor": actor, "action": change.action, "kind": change.kind}
        entry |= {"row": change.row, "content": digest(change.values)}
        entries.append(linked_entry(entry, head.number + 1, head.hash))
        head = AuditHead(number=head.number + 1, hash=entries[-1]["hash"])
    if entries:
        connection.execute(insert(audit_table), entries)
        connection.execute(
            update(audit_head_table).where(audit_head_table.c.id == 1).values(number=head.number, hash=head.hash)
        )
    return head


ANCHOR_FILE = "audit-anchor.json"
BEFORE = AuditHead(number=0, hash=FIRST_HASH)  # before the first entry
LOST, KIND = "anchor missing", "anchor"  # action and kind of the entry that reports a lost anchor


def write_anchor(folder: Path, store: str, head: AuditHead, *, disk: Disk = DISK) -> None:
    """Write the anchor of the store with this identity; OSError when it cannot be written."""
    document = {"notice": RESEARCH_USE_ONLY, "store": store, **asdict(head)}
    write_durably(folder / ANCHOR_FILE, json_bytes(document, indent=1), disk=disk, private=True)


def read_anchor(folder: Path) -> tuple[str, AuditHead]:
    """Identity of the store and the anchored entry; `RecordsError` when the anchor is missing or damaged."""
    path = folder / ANCHOR_FILE
    try:
        document = read_object(path)
        store, number, seal = document.get("store"), document.get("number"), document.get("hash")
        for name, value in (("store", store), ("hash", seal)):
            require_type(name, value, str)
        return str(store), AuditHead(number=require_integer("number", number, 0, 2**62), hash=str(seal))
    except TsisError as error:
        raise RecordsError(
            f"the anchor of the audit, {printable_path(path)}, must be there and whole; {error}"
        ) from error


def require_anchored(connection: Connection, folder: Path) -> bool:
    """Refuse to extend an audit that contradicts its anchor, since the next anchor would hide that.

    Returns whether there is an anchor; a user may have removed it to continue without. `RecordsError` when the audit
    lacks the anchored entry, or the anchor is damaged.
    """
    if not (folder / ANCHOR_FILE).exists():
        return False
    try:
        head = read_anchor(folder)[1]
    except RecordsError as error:
        raise RecordsError(f"{error} (to go on without it, of which the audit will tell, move it away)") from error
    if head != BEFORE and not has_entry(connection, head):
        raise RecordsError(
            f"the audit must hold entry {head.number} as {printable_path(folder / ANCHOR_FILE)} tells; it was cut "
            "off or rewritten, or the database is an older copy (tsis records verify tells more; to go on with what "
            "there is, move that file away)"
        )
    return True


def lost_after(head: AuditHead) -> AuditChange:
    """The entry on a missing anchor: earlier entries are unprotected, which the next anchor would hide."""
    return AuditChange(action=LOST, kind=KIND, row=ANCHOR_FILE, values={"number": head.number, "hash": head.hash})
