"""The order of estimates: by when they were made, and each after the one that it supersedes."""

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
    """Estimates in the order in which they were made, as far as clocks tell.

    A clock can be set back. What supersedes another was made after it all the same, so it counts as made then at least.

    Parameters
    ----------
    estimates
        Of one target.

    Returns
    -------
    tuple
        All of them; the last is the one in force.
    """
    by_name = {stored.id: stored for stored in estimates}

    def made(stored: StoredEstimate) -> tuple[datetime, int, str]:
        latest, generation, observed = stored.made, 0, {stored.id}
        before = stored
        while before.supersedes in by_name and before.supersedes not in observed:  # seen: somebody tampered with it
            before = by_name[before.supersedes]
            observed.add(before.id)
            latest, generation = max(latest, before.made), generation + 1
        return latest, generation, stored.id

    return tuple(sorted(estimates, key=made))


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
    pressed, created = tables.press_table.c, tables.estimate_table.c
    count = select(pressed.target, func.count().label("number"), func.max(pressed.taken).label("last"))
    presses = {row.target: (row.number, row.last) for row in connection.execute(count.group_by(pressed.target))}
    query = select(created.target, func.count().label("number")).group_by(created.target)
    estimates = {row.target: row.number for row in connection.execute(query)}
    results = [
        row._asdict() for row in connection.execute(select(tables.target_table).order_by(tables.target_table.c.number))
    ]
    return tuple(
        TargetSummary(
            target=target_of_row(row),
            presses=presses.get(row["id"], (0, None))[0],
            estimates=estimates.get(row["id"], 0),
            last=_moment(presses[row["id"]][1]) if row["id"] in presses else None,
        )
        for row in results
    )


def _moment(stored: object) -> datetime:
    try:
        return datetime.fromisoformat(str(stored))
    except ValueError as error:
        raise RecordsError(
            f"the time of a press must be as it was stored; got {stored!r:.60} (tsis records verify)"
        ) from error
