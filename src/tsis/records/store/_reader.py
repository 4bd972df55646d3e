"""What is read of a store: lists by the indexes, records as values, files only after their hash was found right."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

from sqlalchemy import func, select

from tsis.calibration.file import parse_calibration
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files import LARGEST_TARGET
from tsis.model import require_integer
from tsis.records._target_record import TargetRecord
from tsis.records.store import _rows as rows
from tsis.records.store import _tables as tables
from tsis.records.store._files import frame_levels, samples_of
from tsis.records.store._summary import TargetSummary, in_lineage, target_summaries

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray
    from sqlalchemy import Connection

    from tsis.calibration.file import ProbeCalibration
    from tsis.records._values import StoredEstimate, StoredPress, Target
    from tsis.records.store._database import Database
    from tsis.records.store._files import Blobs


MOST_AT_ONCE = 500  # names in one question to a database
Named = TypeVar("Named")
Whole = TypeVar("Whole")


class StoreReader:
    """Targets with their presses, calibrations and estimates, as they are stored.

    Parameters
    ----------
    folder, database, blobs
        Where the store lies, its rows and its files.
    identity, kind
        Of the store: its own, and ``"phantom"`` or ``"subject"``.
    """

    def __init__(self, folder: Path, database: Database, blobs: Blobs, *, identity: str, kind: str) -> None:
        self.folder, self.database, self.blobs, self.identity, self.kind = folder, database, blobs, identity, kind

    def entries(self) -> int:
        """How many entries the audit has: it grows with every change, so that who shows a store knows when to look."""
        with self.database.reading() as connection:
            return int(connection.execute(select(tables.audit_head_table.c.number)).scalar() or 0)

    def targets(self) -> tuple[TargetSummary, ...]:
        """Every target with the number of its presses and estimates, by number."""
        with self.database.reading() as connection:
            return target_summaries(connection)

    def target(self, number: int) -> Target:
        """The target that people call by this number; `InputError` when there is none."""
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
        """Presses of a target in the order in which they were taken, ``limit`` of them after the first ``offset``."""
        with self.database.reading() as connection:
            return _presses_of(connection, target, limit, offset)

    def press_count(self, target: Target) -> int:
        """How many presses a target has; by the index alone."""
        query = select(func.count()).select_from(tables.press_table).where(tables.press_table.c.target == target.id)
        with self.database.reading() as connection:
            return int(connection.execute(query).scalar_one())

    def press(self, target: Target, identity: str) -> StoredPress:
        """The press of that identity; `InputError` when the target has none."""
        query = press_query().where(tables.press_table.c.id == identity, tables.press_table.c.target == target.id)
        with self.database.reading() as connection:
            row = connection.execute(query).first()
        if row is None:
            raise InputError(f"press must be one of target {target.number}; got {identity!r:.40}")
        return rows.press_of_row(row._asdict())

    def presses_of_frames(self, frames: Sequence[str]) -> tuple[StoredPress, ...]:
        """Presses of any target whose frame is one of these: by it one tells what is stored already."""
        result: list[Any] = []
        with self.database.reading() as connection:
            for at in range(0, len(frames), MOST_AT_ONCE):
                some = tables.frame_table.c.id.in_(frames[at : at + MOST_AT_ONCE])
                stored = list(connection.execute(select(tables.frame_table.c.id).where(some)).scalars())
                if stored:  # else no press needs to be looked at
                    result += connection.execute(press_query().where(tables.press_table.c.frame.in_(stored)))
        return tuple(rows.press_of_row(row._asdict()) for row in result)

    def estimates(self, target: Target) -> tuple[StoredEstimate, ...]:
        """Estimates of a target in the order in which they were made; one that supersedes another after it."""
        with self.database.reading() as connection:
            result = _estimate_rows(connection, target)
        return in_lineage([self._estimate(row) for row in result])

    def _estimate(self, row: rows.Row) -> StoredEstimate:
        name = str(row["samples"])
        return rows.estimate_of_row(row, samples_of(self.blobs.get(name, "samples"), f"samples {name:.12}"))

    def levels(self, frame: str) -> NDArray[Any]:
        """Grey levels of a stored frame, shape (rows, columns), uint8 or uint16; `RecordsError` when it is damaged."""
        return frame_levels(self.blobs.get(frame, "png"), frame)

    def calibration(self, cited: str) -> ProbeCalibration:
        """The stored calibration of that identity; `RecordsError` when there is none or it is damaged."""
        table = tables.calibration_table
        with self.database.reading() as connection:
            result = connection.execute(select(table.c.file).where(table.c.id == cited)).scalar()
        if result is None:
            raise RecordsError(f"a calibration must be stored before it is cited; {cited[:12]!r} is not")
        file = str(result)
        return parse_calibration(self.blobs.get(file, "json"), f"calibration {cited:.12}")

    def record(self, target: Target, *, limit: int | None = None, offset: int = 0) -> TargetRecord:
        """All that is stored of a target, what is damaged left out and said; frames are read when asked for.

        Of its presses only ``limit`` after the first ``offset``, where one is given.
        """
        with self.database.reading() as connection:  # one state, so that presses that estimates rest on are there
            presses, created = _presses_of(connection, target, limit, offset), _estimate_rows(connection, target)
        damaged: list[str] = []
        result = _whole(self._estimate, created, damaged)
        cited = {str(item["calibration"]) for item in created}
        cited |= {press.calibration for press in presses if press.calibration is not None}
        named = _whole(lambda item: (item, self.calibration(item)), sorted(cited), damaged)
        return TargetRecord(
            target=target,
            presses=presses,
            estimates=in_lineage(result),
            calibrations=dict(named),
            read=self.levels,
            damaged=tuple(damaged),
        )


def _whole(read: Callable[[Named], Whole], names: Iterable[Named], damaged: list[str]) -> list[Whole]:
    """What can be read of these, and a sentence more for each other: one damaged file hides nothing else."""
    results = []
    for name in names:
        try:
            results.append(read(name))
        except (RecordsError, FileInputError) as error:
            damaged.append(str(error))
    return results


def _presses_of(
    connection: Connection, target: Target, limit: int | None = None, offset: int = 0
) -> tuple[StoredPress, ...]:
    table = tables.press_table.c
    page = select(table.id).where(table.target == target.id).order_by(table.taken, table.id)
    # Which they are tells the index alone; only their own rows are read.
    result = connection.execute(
        press_query().where(table.id.in_(page.limit(limit).offset(offset))).order_by(table.taken, table.id)
    )
    names, values = tuple(result.keys()), result.all()
    return tuple(rows.press_of_row(dict(zip(names, row, strict=True))) for row in values)


def _estimate_rows(connection: Connection, target: Target) -> list[rows.Row]:
    table = tables.estimate_table
    query = select(table).where(table.c.target == target.id).order_by(table.c.made, table.c.id)
    return [row._asdict() for row in connection.execute(query)]


def press_query() -> Any:
    """Presses with the size of their frames, as `tsis.records.store._rows.press_of_row` takes them."""
    sizes = (tables.frame_table.c.rows, tables.frame_table.c.columns)
    return select(tables.press_table, *sizes).join(
        tables.frame_table, tables.press_table.c.frame == tables.frame_table.c.id
    )
