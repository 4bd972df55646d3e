"""What of a record may be changed, and how: only what was named, on a row that is as the audit says."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tsis.model.check import require_one_of
from tsis.model.errors import InputError
from tsis.records import tables
from tsis.records.contents import press_query
from tsis.records.row_changes import update_row
from tsis.records.rows import Row, press_of_row, press_row, target_of_row, target_row
from tsis.records.values import entered

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from sqlalchemy import Connection

    from tsis.records.audit import AuditChange
    from tsis.records.values import StoredPress, Target

EDITABLE = {"target": ("name", "note", "truth"), "press": ("role", "force_n", "flags", "note")}


def target_edit(target: Target, changes: Mapping[str, Any]) -> Callable[[Connection], tuple[Target, list[AuditChange]]]:
    """What enters changes of a target; `InputError` when a value is not accepted, or may not be changed."""
    changed = _columns(target_row(entered(_edited(target, "target", changes), changes)), changes)

    def enter(connection: Connection) -> tuple[Target, list[AuditChange]]:
        change = update_row(connection, tables.targets, target, changed)
        return target_of_row(change.values), [change]

    return enter


def press_edit(
    press: StoredPress, changes: Mapping[str, Any]
) -> Callable[[Connection], tuple[StoredPress, list[AuditChange]]]:
    """What enters changes of a press; errors as `target_edit`."""
    changed = _columns(press_row(_edited(press, "press", changes)), changes)

    def enter(connection: Connection) -> tuple[StoredPress, list[AuditChange]]:
        change = update_row(connection, tables.presses, press, changed)
        found = connection.execute(press_query().where(tables.presses.c.id == press.id)).one()
        return press_of_row(found._asdict()), [change]

    return enter


def _edited(record: Any, kind: str, changes: Mapping[str, Any]) -> Any:
    if not changes:
        raise InputError(f"an edit of a {kind} must change something; got nothing (name {', '.join(EDITABLE[kind])})")
    for name in changes:
        require_one_of(f"field of a {kind} that may be changed", name, EDITABLE[kind])
    return replace(record, **changes, version=record.version + 1)


def _columns(row: Row, changes: Mapping[str, Any]) -> Row:
    """What is changed in the row: all else of the record that was read may have been made up."""
    return {name: row[name] for name in (*changes, "version")}
