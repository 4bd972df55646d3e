"""Rows put in and changed, each with what the audit is told of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sqlalchemy import insert, select, update

from tsis.model.errors import RecordsError, StaleRecordError
from tsis.records import tables
from tsis.records.audit import AuditChange, last_content
from tsis.records.canonical import digest_of_any

if TYPE_CHECKING:
    from sqlalchemy import Connection, Table

    from tsis.records.rows import Row


def insert_row(connection: Connection, table: Table, row: Row, *, action: str = "add") -> AuditChange:
    """Enter a row."""
    connection.execute(insert(table).values(row))
    return AuditChange(action=action, kind=table.name, row=row["id"], values=row)


def insert_row_once(connection: Connection, table: Table, row: Row | None, *, action: str = "add") -> list[AuditChange]:
    """Enter what many records share, where it is not there yet."""
    if row is None or connection.execute(select(table.c.id).where(table.c.id == row["id"])).first() is not None:
        return []
    return [insert_row(connection, table, row, action=action)]


def update_row(connection: Connection, table: Table, before: Any, changed: Row) -> AuditChange:
    """Change columns of the row of the record ``before``.

    Raises
    ------
    StaleRecordError
        When somebody has changed it since it was read.
    RecordsError
        When it is not as its last audit entry says: the next would vouch for what was done to it.
    """
    what = "target" if table is tables.targets else "press"
    unchanged = (table.c.id == before.id) & (table.c.version == before.version)
    found = connection.execute(select(table).where(unchanged)).first()
    if found is None:
        raise StaleRecordError(
            f"the {what} must be as it was read to be changed; somebody else has changed it since version "
            f"{before.version} (read it again)"
        )
    if digest_of_any(found._asdict()) != last_content(connection, table.name, before.id):
        raise RecordsError(
            f"the {what} must be as it was stored to be changed; it was changed behind the program's back "
            "(tsis records verify tells more; take the store from a backup)"
        )
    connection.execute(update(table).where(table.c.id == before.id).values(changed))
    row = connection.execute(select(table).where(table.c.id == before.id)).one()._asdict()
    return AuditChange(action="edit", kind=table.name, row=before.id, values=row)


def require_row(connection: Connection, table: Table, wanted: str, what: str, **of: str) -> None:
    """Refuse, with `RecordsError`, to name a row that is not there, or not ``of`` the values given."""
    query = select(table.c.id).where(table.c.id == wanted)
    for name, value in of.items():
        query = query.where(table.c[name] == value)
    if connection.execute(query).first() is None:
        raise RecordsError(f"a {what} must be stored before another record names it; {wanted!r:.40} is not")
