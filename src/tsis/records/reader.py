"""Reading a store: lists by the indexes, records as values, files after a check of their hash."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import datetime
from threading import Lock
from typing import TYPE_CHECKING, Any, TypeVar

from sqlalchemy import func, select, union_all

from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.file import parse_calibration
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.model.require import require_integer
from tsis.records import rows
from tsis.records import schema as tables
from tsis.records.audit import AuditHead, has_entry
from tsis.records.blobs import frame_levels, samples_of
from tsis.records.rows import target_of_row
from tsis.records.staleness import stale_results
from tsis.records.values import TargetRecord

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from sqlalchemy import Connection, Table

    from tsis.calibration.file import ProbeCalibration
    from tsis.records.blobs import Blobs
    from tsis.records.database import Database
    from tsis.records.staleness import StaleResult
    from tsis.records.values import StoredEstimate, StoredMap, StoredPress, Target


MOST_AT_ONCE = 500  # names in a query
Key = TypeVar("Key")
Value = TypeVar("Value")


class StoreReader:
    """Reads targets with their presses, calibrations and estimates; parameters as in `Store`."""

    def __init__(self, folder: Path, database: Database, blobs: Blobs, *, identity: str, kind: str) -> None:
        self.folder, self.database, self.blobs, self.identity, self.kind = folder, database, blobs, identity, kind
        self._summaries = _Summaries()

    def entries(self) -> int:
        """Number of audit entries; it grows with every change, so a view knows when to update."""
        with self.database.reading() as connection:
            return int(connection.execute(select(tables.audit_head_table.c.number)).scalar() or 0)

    def targets(self, *, hidden: bool = False) -> tuple[TargetSummary, ...]:
        """Summaries of the targets, by number; ``hidden`` adds those that are archived or deleted."""
        with self.database.reading() as connection:
            summaries = self._summaries.read(connection)
        return tuple(item for item in summaries if hidden or item.state is None)

    def state(self, target: Target) -> TargetState | None:
        """Whether a target is archived or deleted; None for the others."""
        with self.database.reading() as connection:
            return read_states(connection, target.id).get(target.id)

    def target(self, number: int) -> Target:
        """The target of this number, or `InputError`."""
        require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
        with self.database.reading() as connection:
            query = select(tables.target_table).where(tables.target_table.c.number == int(number))
            row = connection.execute(query).first()
        if row is None:
            raise InputError(
                f"target must be a number that this store of {self.kind}s holds; got {number} (tsis records list)"
            )
        return rows.target_of_row(row._asdict())

    def presses(self, target: Target, *, limit: int | None = None, offset: int = 0) -> tuple[StoredPress, ...]:
        """Presses of a target in the order of time: ``limit`` of them after the first ``offset``."""
        with self.database.reading() as connection:
            return _presses_of(connection, target, limit, offset)

    def press_count(self, target: Target) -> int:
        """Number of presses of a target."""
        query = select(func.count()).select_from(tables.press_table).where(tables.press_table.c.target == target.id)
        with self.database.reading() as connection:
            return int(connection.execute(query).scalar_one())

    def edited_targets(self, target: Target | None = None) -> frozenset[str]:
        """Identities of the targets, or of this one, that have an edited press: the others are as they were."""
        table = tables.press_table.c
        query = select(table.target).distinct().where(table.version > 1)
        with self.database.reading() as connection:
            found = connection.execute(query if target is None else query.where(table.target == target.id))
            return frozenset(found.scalars())

    def stale_results(self, target: Target) -> tuple[StaleResult, ...]:
        """The current results of a target whose presses were edited since they were made."""
        return stale_results(self.record(target)) if self.edited_targets(target) else ()

    def press(self, target: Target, identity: str) -> StoredPress:
        """The press of this identity, or `InputError`."""
        query = rows.press_query().where(tables.press_table.c.id == identity, tables.press_table.c.target == target.id)
        with self.database.reading() as connection:
            row = connection.execute(query).first()
        if row is None:
            raise InputError(f"press must be one of target {target.number}; got {identity!r:.40}")
        return rows.press_of_row(row._asdict())

    def presses_of_frames(self, frames: Sequence[str]) -> tuple[StoredPress, ...]:
        """Presses of any target whose frame is among these."""
        found: list[Any] = []
        with self.database.reading() as connection:
            for at in range(0, len(frames), MOST_AT_ONCE):
                some = tables.frame_table.c.id.in_(frames[at : at + MOST_AT_ONCE])
                stored = list(connection.execute(select(tables.frame_table.c.id).where(some)).scalars())
                if stored:
                    found += connection.execute(rows.press_query().where(tables.press_table.c.frame.in_(stored)))
        return tuple(rows.press_of_row(row._asdict()) for row in found)

    def estimates(self, target: Target) -> tuple[StoredEstimate, ...]:
        """Estimates of a target in the order of time, each after the one that it supersedes."""
        with self.database.reading() as connection:
            stored = _result_rows(connection, tables.estimate_table, target)
        return in_lineage([self._estimate(row) for row in stored])

    def _estimate(self, row: rows.Row) -> StoredEstimate:
        name = str(row["samples"])
        return rows.estimate_of_row(row, samples_of(self.blobs.get(name, "samples"), f"samples {name:.12}"))

    def _map(self, row: rows.Row) -> StoredMap:
        return rows.map_of_row(row, self.blobs.get(str(row["file"]), "json"))

    def levels(self, frame: str) -> NDArray[Any]:
        """Grey levels of a stored frame, shape (rows, columns), uint8 or uint16; `RecordsError` when damaged."""
        return frame_levels(self.blobs.get(frame, "png"), frame)

    def calibration(self, cited: str) -> ProbeCalibration:
        """The stored calibration of this identity; `RecordsError` when it is missing or damaged."""
        table = tables.calibration_table
        with self.database.reading() as connection:
            result = connection.execute(select(table.c.file).where(table.c.id == cited)).scalar()
        if result is None:
            raise RecordsError(f"a calibration must be stored before it is cited; {cited[:12]!r} is not")
        file = str(result)
        return parse_calibration(self.blobs.get(file, "json"), f"calibration {cited:.12}")

    def record(self, target: Target, *, limit: int | None = None, offset: int = 0) -> TargetRecord:
        """All data of a target, or ``limit`` of its presses after the first ``offset``.

        Damaged parts are omitted and listed. Frames are read on use.
        """
        with self.database.reading() as connection:  # one state, which has the presses of all its estimates
            presses = _presses_of(connection, target, limit, offset)
            estimate_rows, map_rows = (
                _result_rows(connection, table, target) for table in (tables.estimate_table, tables.map_table)
            )
        damaged: list[str] = []
        estimates, maps = _readable(self._estimate, estimate_rows, damaged), _readable(self._map, map_rows, damaged)
        cited = {str(item["calibration"]) for item in (*estimate_rows, *map_rows)}
        cited |= {press.calibration for press in presses if press.calibration is not None}
        named = _readable(lambda item: (item, self.calibration(item)), sorted(cited), damaged)
        return TargetRecord(
            target=target,
            presses=presses,
            estimates=in_lineage(estimates),
            maps=in_lineage(maps),
            calibrations=dict(named),
            read=self.levels,
            damaged=tuple(damaged),
        )


def _readable(read: Callable[[Key], Value], names: Iterable[Key], damaged: list[str]) -> list[Value]:
    """The readable values; each failure adds a message to ``damaged``."""
    values = []
    for name in names:
        try:
            values.append(read(name))
        except (RecordsError, FileInputError) as error:
            damaged.append(str(error))
    return values


def _presses_of(
    connection: Connection, target: Target, limit: int | None = None, offset: int = 0
) -> tuple[StoredPress, ...]:
    table = tables.press_table.c
    page = select(table.id).where(table.target == target.id).order_by(table.taken, table.id)
    # The index gives the identities; only their own rows are read.
    found = connection.execute(
        rows.press_query().where(table.id.in_(page.limit(limit).offset(offset))).order_by(table.taken, table.id)
    )
    names, values = tuple(found.keys()), found.all()
    return tuple(rows.press_of_row(dict(zip(names, row, strict=True))) for row in values)


def _result_rows(connection: Connection, table: Table, target: Target) -> list[rows.Row]:
    query = select(table).where(table.c.target == target.id).order_by(table.c.made, table.c.id)
    return [row._asdict() for row in connection.execute(query)]


Result = TypeVar("Result", "StoredEstimate", "StoredMap")


def in_lineage(results: Sequence[Result]) -> tuple[Result, ...]:
    """The estimates or the maps of a target in the order of time; the last of each kind is active.

    A clock can be set back, so a result counts as at least as late as those that it supersedes.
    """
    by_name = {stored.id: stored for stored in results}

    def made(stored: Result) -> tuple[datetime, int, str]:
        latest, generation, visited = stored.made, 0, {stored.id}
        before = stored
        while before.supersedes in by_name and before.supersedes not in visited:  # a cycle is a forgery
            before = by_name[before.supersedes]
            visited.add(before.id)
            latest, generation = max(latest, before.made), generation + 1
        return latest, generation, stored.id

    return tuple(sorted(results, key=made))


ARCHIVED, DELETED = "archived", "deleted"
TERM_OF = "state of target "  # before its identity: the name of its state in the table of the store's terms


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetState:
    """That a target is archived or deleted, and since when."""

    name: str
    since: datetime


def read_states(connection: Connection, target: str = "") -> dict[str, TargetState]:
    """The state of each target, or of one, that is archived or deleted, by identity."""
    table = tables.store_table
    found = connection.execute(select(table).where(table.c.name.startswith(TERM_OF + target, autoescape=True)))
    states = {}
    for row in found:
        try:
            value = json.loads(row.value)
            state = TargetState(name=value["state"], since=datetime.fromisoformat(value["since"]))
        except (ValueError, TypeError, KeyError) as error:
            raise RecordsError(
                f"the state of a target must be as it was stored; got {row.value!r:.60} (tsis records verify)"
            ) from error
        if state.name in (ARCHIVED, DELETED):
            states[row.name.removeprefix(TERM_OF)] = state
    return states


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetSummary:
    """A target with the number of its presses and of its estimates and maps, and the time of the last press or None."""

    target: Target
    presses: int
    estimates: int
    last: datetime | None
    state: TargetState | None = None  # whether it is archived or deleted


class _Summaries:
    """The summaries of all targets, counted once; after a change the audit names the targets that are counted anew."""

    def __init__(self) -> None:
        self._head: AuditHead | None = None
        self._known: dict[str, TargetSummary] = {}
        self._lock = Lock()

    def read(self, connection: Connection) -> tuple[TargetSummary, ...]:
        """The summaries by number, as this transaction sees the store."""
        row = connection.execute(select(tables.audit_head_table)).first()
        if row is None:  # the audit was damaged; the counts of the tables are still true
            return tuple(target_summaries(connection).values())
        head = AuditHead(number=row.number, hash=row.hash)
        with self._lock:
            if head != self._head:
                changed = self._changed(connection)
                if changed is None:
                    self._known = target_summaries(connection)
                else:
                    stay = {name: item for name, item in self._known.items() if name not in changed}
                    self._known = stay | target_summaries(connection, changed)
                self._head = head
            return tuple(sorted(self._known.values(), key=lambda item: item.target.number))

    def _changed(self, connection: Connection) -> set[str] | None:
        """Identities of the targets that changed since the last time; None where all may have."""
        if self._head is None or not has_entry(connection, self._head):
            return None
        log = tables.audit_table.c
        since = select(log.kind, log.row).where(log.number > self._head.number).limit(MOST_AT_ONCE + 1)
        entries = connection.execute(since).all()
        if len(entries) > MOST_AT_ONCE:
            return None
        result = {row for kind, row in entries if kind == tables.target_table.name}
        result |= {row.removeprefix(TERM_OF) for _, row in entries if row.startswith(TERM_OF)}
        for table in (tables.press_table, tables.estimate_table, tables.map_table):
            of_table = {row for kind, row in entries if kind == table.name}
            found = connection.execute(select(table.c.id, table.c.target).where(table.c.id.in_(of_table))).all()
            if len(found) < len(of_table):  # a row was removed, with it the name of its target
                return None
            result |= {row.target for row in found}
        return result


def target_summaries(connection: Connection, some: Collection[str] | None = None) -> dict[str, TargetSummary]:
    """The summaries of all targets, or of those with these identities, by identity in the order of their numbers."""
    pressed, named = tables.press_table.c, tables.target_table.c
    count = select(pressed.target, func.count().label("number"), func.max(pressed.taken).label("last"))
    result = union_all(*(select(table.c.target) for table in (tables.estimate_table, tables.map_table))).subquery().c
    result_count = select(result.target, func.count().label("number"))
    query = select(tables.target_table).order_by(named.number)
    if some is not None:
        count, result_count = count.where(pressed.target.in_(some)), result_count.where(result.target.in_(some))
        query = query.where(named.id.in_(some))
    presses = {row.target: (row.number, row.last) for row in connection.execute(count.group_by(pressed.target))}
    estimates = {row.target: row.number for row in connection.execute(result_count.group_by(result.target))}
    states = read_states(connection)
    return {
        row.id: TargetSummary(
            target=target_of_row(row._asdict()),
            presses=presses.get(row.id, (0, None))[0],
            estimates=estimates.get(row.id, 0),
            last=_moment(presses[row.id][1]) if row.id in presses else None,
            state=states.get(row.id),
        )
        for row in connection.execute(query)
    }


def _moment(stored: object) -> datetime:
    try:
        return datetime.fromisoformat(str(stored))
    except ValueError as error:
        raise RecordsError(
            f"the time of a press must be as it was stored; got {stored!r:.60} (tsis records verify)"
        ) from error
