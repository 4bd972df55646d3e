"""Lists of targets: counts by the index, no frame opened."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING

from sqlalchemy import func, select

from tsis.model.errors import RecordsError
from tsis.records import tables
from tsis.records.rows import target_of_row

if TYPE_CHECKING:
    from sqlalchemy import Connection

    from tsis.records.values import Target


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSummary:
    """A target and how much is stored of it.

    Attributes
    ----------
    target
        Itself.
    presses, estimates
        How many there are.
    last
        When it was pressed last; None when it never was.
    """

    target: Target
    presses: int
    estimates: int
    last: datetime | None


def target_summaries(connection: Connection) -> tuple[TargetSummary, ...]:
    """Every target of the store, by number."""
    pressed, made = tables.presses.c, tables.estimates.c
    count = select(pressed.target, func.count().label("number"), func.max(pressed.taken).label("last"))
    presses = {row.target: (row.number, row.last) for row in connection.execute(count.group_by(pressed.target))}
    query = select(made.target, func.count().label("number")).group_by(made.target)
    estimates = {row.target: row.number for row in connection.execute(query)}
    found = [row._asdict() for row in connection.execute(select(tables.targets).order_by(tables.targets.c.number))]
    return tuple(
        TargetSummary(
            target=target_of_row(row),
            presses=presses.get(row["id"], (0, None))[0],
            estimates=estimates.get(row["id"], 0),
            last=_moment(presses[row["id"]][1]) if row["id"] in presses else None,
        )
        for row in found
    )


def _moment(stored: object) -> datetime:
    try:
        return datetime.fromisoformat(str(stored))
    except ValueError as error:
        raise RecordsError(
            f"the time of a press must be as it was stored; got {stored!r:.60} (tsis records verify)"
        ) from error
