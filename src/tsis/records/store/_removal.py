"""Targets that are archived, deleted, restored and, after some weeks, erased, each with its audit entries."""

from __future__ import annotations

import json
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

from sqlalchemy import delete, insert, select, update

from tsis.errors import RecordsError
from tsis.model import require_one_of
from tsis.records import schema as tables
from tsis.records.store._audit import AuditChange
from tsis.records.store._editing import require_row
from tsis.records.store._reader import ARCHIVED, DELETED, TERM_OF, TargetState, read_states

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from sqlalchemy import Connection

    from tsis.records._values import Target


UNDO_DAYS = 30  # for which a deleted target can be restored
ERASED = "erased"
STATES = ("", ARCHIVED, DELETED)
ACTIONS = {"": "restore", ARCHIVED: "archive", DELETED: "delete"}


def require_present(connection: Connection, target: Target) -> None:
    """Refuse, with `RecordsError`, to add to a target that is not stored, or is deleted."""
    require_row(connection, tables.target_table, target.id, "target")
    state = read_states(connection, target.id).get(target.id)
    if state is not None and state.name == DELETED:
        raise RecordsError(
            f"target {target.number} must not be deleted to be added to; it was deleted on {state.since:%Y-%m-%d} "
            "(restore it on its page in the console, or choose another number)"
        )


def state_edit(target: Target, state: str) -> Callable[[Connection], tuple[TargetState | None, list[AuditChange]]]:
    """A function that archives, deletes or restores a target; its rows and files stay as they are."""
    require_one_of("state of a target", state, STATES)

    def enter(connection: Connection) -> tuple[TargetState | None, list[AuditChange]]:
        require_row(connection, tables.target_table, target.id, "target")
        since = datetime.now(UTC)
        change = _term_change(connection, target.id, ACTIONS[state], {"state": state, "since": since.isoformat()})
        return (TargetState(name=state, since=since) if state else None), [change]

    return enter


def _term_change(connection: Connection, target: str, action: str, value: Mapping[str, Any]) -> AuditChange:
    """Write the state of a target into the terms of the store."""
    table, row = tables.store_table, {"name": TERM_OF + target, "value": json.dumps(value)}
    known = table.c.name == row["name"]
    if connection.execute(select(table.c.name).where(known)).first() is None:
        connection.execute(insert(table).values(row))
    else:
        connection.execute(update(table).where(known).values(value=row["value"]))
    return AuditChange(action=action, kind=table.name, row=row["name"], values=row)


Erased = tuple[int, list[tuple[str, str]]]  # the number of targets, and name and ending of each file without a row


def erase_expired(now: datetime) -> Callable[[Connection], tuple[Erased, list[AuditChange]]]:
    """A function that removes the rows of targets that were deleted more than `UNDO_DAYS` ago.

    A tombstone stays: number, time and count of presses, and in the audit an entry for each removed row.
    """

    def enter(connection: Connection) -> tuple[Erased, list[AuditChange]]:
        changes: list[AuditChange] = []
        files: list[tuple[str, str]] = []
        states = read_states(connection)
        due = [
            target
            for target, state in states.items()
            if state.name == DELETED and state.since < now - timedelta(days=UNDO_DAYS)
        ]
        for target in due:
            erased, unnamed = _erased(connection, target, now)
            changes += erased
            files += unnamed
        return (len(due), files), changes

    return enter


def _erased(connection: Connection, target: str, now: datetime) -> tuple[list[AuditChange], list[tuple[str, str]]]:
    press, estimate, frame = tables.press_table, tables.estimate_table, tables.frame_table
    number = connection.execute(
        select(tables.target_table.c.number).where(tables.target_table.c.id == target)
    ).scalar_one()
    presses = list(connection.execute(select(press.c.id, press.c.frame).where(press.c.target == target)))
    estimates = list(connection.execute(select(estimate.c.id, estimate.c.samples).where(estimate.c.target == target)))
    connection.execute(delete(estimate).where(estimate.c.target == target))
    connection.execute(delete(press).where(press.c.target == target))
    frames = [
        name
        for name in {row.frame for row in presses}
        if connection.execute(select(press.c.id).where(press.c.frame == name).limit(1)).first() is None
    ]
    for name in frames:
        connection.execute(delete(frame).where(frame.c.id == name))
    connection.execute(delete(tables.target_table).where(tables.target_table.c.id == target))
    removed = [
        *((estimate, row.id) for row in estimates),
        *((press, row.id) for row in presses),
        *((frame, name) for name in frames),
        (tables.target_table, target),
    ]
    tombstone = {"state": ERASED, "since": now.isoformat(), "number": int(number), "presses": len(presses)}
    samples = [
        row.samples
        for row in estimates
        if connection.execute(select(estimate.c.id).where(estimate.c.samples == row.samples).limit(1)).first() is None
    ]
    return [
        *(AuditChange(action="erase", kind=table.name, row=row, values={}) for table, row in removed),
        _term_change(connection, target, "erase", tombstone),
    ], [*((name, "png") for name in frames), *((name, "samples") for name in samples)]
