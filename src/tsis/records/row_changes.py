"""Rows put in and changed, each with what the audit is told of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from sqlalchemy import insert, select, update

from tsis.model.errors import RecordsError, StaleRecordError
from tsis.records import tables
from tsis.records.audit import Change

if TYPE_CHECKING:
    from sqlalchemy import Connection, Table

    from tsis.records.rows import Row


def inserted(connection: Connection, table: Table, row: Row, *, action: str = "add") -> Change:
    """Enter a row."""
    connection.execute(insert(table).values(row))
    return Change(action=action, kind=table.name, row=row["id"], values=row)


def inserted_once(connection: Connection, table: Table, row: Row | None, *, action: str = "add") -> list[Change]:
    """Enter what many records share, where it is not there yet."""
    if row is None or connection.execute(select(table.c.id).where(table.c.id == row["id"])).first() is not None:
        return []
    return [inserted(connection, table, row, action=action)]


def updated(connection: Connection, table: Table, before: Any, row: Row) -> Change:
    """Change the row of the record ``before``; `StaleRecordError` when it is not as that says any more."""
    what = "target" if table is tables.targets else "press"
    unchanged = (table.c.id == before.id) & (table.c.version == before.version)
    if connection.execute(update(table).where(unchanged).values(row)).rowcount != 1:
        raise StaleRecordError(
            f"the {what} must be as it was read to be changed; somebody else has changed it since version "
            f"{before.version} (read it again)"
        )
    return Change(action="edit", kind=table.name, row=before.id, values=row)


def required(connection: Connection, table: Table, wanted: str, what: str, **of: str) -> None:
    """Refuse, with `RecordsError`, to name a row that is not there, or not ``of`` the values given."""
    query = select(table.c.id).where(table.c.id == wanted)
    for name, value in of.items():
        query = query.where(table.c[name] == value)
    if connection.execute(query).first() is None:
        raise RecordsError(f"a {what} must be stored before another record names it; {wanted!r:.40} is not")
