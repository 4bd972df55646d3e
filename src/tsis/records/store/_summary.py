"""Summaries of targets, and the order of estimates."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from sqlalchemy import func, select

from tsis.errors import RecordsError
from tsis.records.store import _tables as tables
from tsis.records.store._rows import target_of_row

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sqlalchemy import Connection

    from tsis.records._values import StoredEstimate, Target


def in_lineage(estimates: Sequence[StoredEstimate]) -> tuple[StoredEstimate, ...]:
    """The estimates of a target in the order of time; the last of each kind is active.

    A clock can be set back, so an estimate counts as at least as late as those that it supersedes.
    """
    by_name = {stored.id: stored for stored in estimates}

    def made(stored: StoredEstimate) -> tuple[datetime, int, str]:
        latest, generation, visited = stored.made, 0, {stored.id}
        before = stored
        while before.supersedes in by_name and before.supersedes not in visited:  # a cycle is a forgery
            before = by_name[before.supersedes]
            visited.add(before.id)
            latest, generation = max(latest, before.made), generation + 1
        return latest, generation, stored.id

    return tuple(sorted(estimates, key=made))


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSummary:
    """A target with the number of its presses and estimates, and the time of the last press or None."""

    target: Target
    presses: int
    estimates: int
    last: datetime | None


def target_summaries(connection: Connection) -> tuple[TargetSummary, ...]:
    pressed, created = tables.press_table.c, tables.estimate_table.c
    count = select(pressed.target, func.count().label("number"), func.max(pressed.taken).label("last"))
    presses = {row.target: (row.number, row.last) for row in connection.execute(count.group_by(pressed.target))}
    query = select(created.target, func.count().label("number")).group_by(created.target)
    estimates = {row.target: row.number for row in connection.execute(query)}
    targets = connection.execute(select(tables.target_table).order_by(tables.target_table.c.number))
    return tuple(
        TargetSummary(
            target=target_of_row(row._asdict()),
            presses=presses.get(row.id, (0, None))[0],
            estimates=estimates.get(row.id, 0),
            last=_moment(presses[row.id][1]) if row.id in presses else None,
        )
        for row in targets
    )


def _moment(stored: object) -> datetime:
    try:
        return datetime.fromisoformat(str(stored))
    except ValueError as error:
        raise RecordsError(
            f"the time of a press must be as it was stored; got {stored!r:.60} (tsis records verify)"
        ) from error
