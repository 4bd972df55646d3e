"""Inserts and updates of rows, each with its audit entry."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sqlalchemy import insert, select, update

from tsis.errors import InputError, RecordsError, StaleRecordError
from tsis.files import digest_or_none
from tsis.model import require_one_of
from tsis.records import schema as tables
from tsis.records._values import validated_entries
from tsis.records.store._audit import AuditChange, last_content
from tsis.records.store._reader import press_query
from tsis.records.store._rows import Row, press_of_row, press_row, target_of_row, target_row

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from sqlalchemy import Connection, Table

    from tsis.records._values import StoredPress, Target


def insert_row(connection: Connection, table: Table, row: Row, *, action: str = "add") -> AuditChange:
    connection.execute(insert(table).values(row))
    return AuditChange(action=action, kind=table.name, row=row["id"], values=row)


def insert_row_once(connection: Connection, table: Table, row: Row | None, *, action: str = "add") -> list[AuditChange]:
    """Insert a shared row unless it exists."""
    if row is None or connection.execute(select(table.c.id).where(table.c.id == row["id"])).first() is not None:
        return []
    return [insert_row(connection, table, row, action=action)]


def update_row(connection: Connection, table: Table, before: Any, changed: Row) -> AuditChange:
    """Update columns of the row of ``before``; `StaleRecordError` when another user has changed it since.

    `RecordsError` when the row contradicts its last audit entry, which a new entry would hide.
    """
    what = "target" if table is tables.target_table else "press"
    unchanged = (table.c.id == before.id) & (table.c.version == before.version)
    result = connection.execute(select(table).where(unchanged)).first()
    if result is None:
        raise StaleRecordError(
            f"the {what} must be as it was read to be changed; somebody else has changed it since version "
            f"{before.version} (read it again)"
        )
    if digest_or_none(result._asdict()) != last_content(connection, table.name, before.id):
        raise RecordsError(
            f"the {what} must be as it was stored to be changed; it was changed behind the program's back "
            "(tsis records verify tells more; take the store from a backup)"
        )
    connection.execute(update(table).where(table.c.id == before.id).values(changed))
    row = connection.execute(select(table).where(table.c.id == before.id)).one()._asdict()
    return AuditChange(action="edit", kind=table.name, row=before.id, values=row)


def require_row(connection: Connection, table: Table, requested: str, what: str, **of: str) -> None:
    """Raise `RecordsError` unless there is a row with this identity and the values ``of``."""
    query = select(table.c.id).where(table.c.id == requested)
    for name, value in of.items():
        query = query.where(table.c[name] == value)
    if connection.execute(query).first() is None:
        raise RecordsError(f"a {what} must be stored before another record names it; {requested!r:.40} is not")


EDITABLE = {"target": ("name", "note", "truth"), "press": ("role", "force_n", "flags", "note")}


def target_edit(target: Target, changes: Mapping[str, Any]) -> Callable[[Connection], tuple[Target, list[AuditChange]]]:
    """A function that applies changes to a target; `InputError` when a value is invalid or cannot be changed."""
    changed = _columns(target_row(validated_entries(_edited(target, "target", changes), changes)), changes)

    def enter(connection: Connection) -> tuple[Target, list[AuditChange]]:
        change = update_row(connection, tables.target_table, target, changed)
        return target_of_row(change.values), [change]

    return enter


def press_edit(
    press: StoredPress, changes: Mapping[str, Any]
) -> Callable[[Connection], tuple[StoredPress, list[AuditChange]]]:
    """A function that applies changes to a press; errors as `target_edit`."""
    changed = _columns(press_row(_edited(press, "press", changes)), changes)

    def enter(connection: Connection) -> tuple[StoredPress, list[AuditChange]]:
        change = update_row(connection, tables.press_table, press, changed)
        result = connection.execute(press_query().where(tables.press_table.c.id == press.id)).one()
        return press_of_row(result._asdict()), [change]

    return enter


def _edited(record: Any, kind: str, changes: Mapping[str, Any]) -> Any:
    if not changes:
        raise InputError(f"an edit of a {kind} must change something; got nothing (name {', '.join(EDITABLE[kind])})")
    for name in changes:
        require_one_of(f"field of a {kind} that may be changed", name, EDITABLE[kind])
    return replace(record, **changes, version=record.version + 1)


def _columns(row: Row, changes: Mapping[str, Any]) -> Row:
    """The changed columns only: the caller may have altered the other fields."""
    return {name: row[name] for name in (*changes, "version")}
