"""Values of records as rows of the tables, and back; their edits with the entries of the audit."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from sqlalchemy import insert, select, update

from tsis.calibration.file import calibration_sha256
from tsis.errors import InputError, RecordsError, StaleRecordError
from tsis.files.canonical_json import canonical, digest_or_none, parse_canonical
from tsis.files.json_values import from_json_value, to_json_value
from tsis.model.require import require_one_of
from tsis.records import schema as tables
from tsis.records.audit import AuditChange, last_content
from tsis.records.values import (
    StoredPress,
    Target,
    estimate_from_json,
    estimate_to_json,
    map_from_json,
    map_to_json,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    import numpy as np
    from numpy.typing import NDArray
    from sqlalchemy import Connection, Table

    from tsis.calibration.file import ProbeCalibration
    from tsis.records.values import StoredEstimate, StoredMap


Row = dict[str, Any]


def moment(when: datetime) -> str:
    """A time as the tables store it: UTC, of equal length, so that text sorts by time."""
    return when.astimezone(UTC).isoformat(timespec="microseconds")


def target_row(target: Target) -> Row:
    """Row of a target."""
    document = to_json_value(target)
    return document | {"truth": canonical(document["truth"]), "made": moment(target.made)}


def target_of_row(row: Mapping[str, Any]) -> Target:
    """The target of a row; `RecordsError` when the row is invalid."""
    with _as_stored("target", row):
        document = dict(row) | {"truth": parse_canonical(row["truth"], "truth")}
        return from_json_value(Target, document, "target", complete=True)


def press_row(press: StoredPress) -> Row:
    """Row of a press; the row of the frame has the size of the frame."""
    document = to_json_value(press)
    scale, axis = document.pop("mm_per_pixel") or (None, None), document.pop("axis_px")
    force = document["force_n"]
    for name in ("rows", "columns"):
        del document[name]
    return document | {
        "taken": moment(press.taken),
        "mm_per_pixel_x": scale[0],
        "mm_per_pixel_y": scale[1],
        "axis_px_x": axis[0] + 0.0,  # -0.0 becomes 0.0, as SQLite makes it
        "axis_px_y": axis[1] + 0.0,
        "force_n": None if force is None else force + 0.0,
        "settings": canonical(document["settings"]),
        "flags": canonical(document["flags"]),
    }


def press_query() -> Any:
    """Presses with the size of their frames, as `press_of_row` expects them."""
    sizes = (tables.frame_table.c.rows, tables.frame_table.c.columns)
    return select(tables.press_table, *sizes).join(
        tables.frame_table, tables.press_table.c.frame == tables.frame_table.c.id
    )


def press_of_row(row: Mapping[str, Any]) -> StoredPress:
    """The press of a row joined with the size of its frame; `RecordsError` when the row is invalid."""
    with _as_stored("press", row):
        document = dict(row)
        scale = [document.pop("mm_per_pixel_x"), document.pop("mm_per_pixel_y")]
        document["mm_per_pixel"] = None if None in scale else scale
        document["axis_px"] = [document.pop("axis_px_x"), document.pop("axis_px_y")]
        document["settings"] = parse_canonical(row["settings"], "settings")
        document["flags"] = parse_canonical(row["flags"], "flags")
        return from_json_value(StoredPress, document, "press", complete=True)


def estimate_row(stored: StoredEstimate, samples: str) -> Row:
    """Row of an estimate; ``samples`` names the file of its samples."""
    row = estimate_to_json(stored)
    document = row.pop("estimate")
    return _result_row(stored, row) | {"document": canonical(document), "samples": samples}


NESTED = ("presses", "options", "environment")  # columns of a result in canonical JSON


def _result_row(stored: StoredEstimate | StoredMap, document: Row) -> Row:
    return document | {name: canonical(document[name]) for name in NESTED} | {"made": moment(stored.made)}


def estimate_of_row(row: Mapping[str, Any], samples: Mapping[str, NDArray[np.float64]]) -> StoredEstimate:
    """The estimate of a row with its samples, name -> shape (n,); `RecordsError` when the row is invalid."""
    with _as_stored("estimate", row):
        document = {name: value for name, value in row.items() if name not in ("document", "samples")}
        nested = {name: parse_canonical(row[name], name) for name in NESTED}
        nested["estimate"] = parse_canonical(row["document"], "document")
        return estimate_from_json(document | nested, samples)


def map_row(stored: StoredMap, file: str) -> Row:
    """Row of a map; ``file`` names the file that holds it."""
    return _result_row(stored, map_to_json(stored)) | {"file": file}


def map_of_row(row: Mapping[str, Any], content: bytes) -> StoredMap:
    """The map of a row with the content of its file; `RecordsError` when the row is invalid."""
    with _as_stored("map", row):
        document = {name: value for name, value in row.items() if name != "file"}
        return map_from_json(document | {name: parse_canonical(row[name], name) for name in NESTED}, content)


def calibration_row(calibration: ProbeCalibration, file: str) -> Row:
    """Row of a calibration; ``file`` names its stored file."""
    row = {"id": calibration_sha256(calibration), "file": file, "name": calibration.name, "probe": calibration.probe}
    return row | {"made": "" if calibration.made is None else moment(calibration.made)}


@contextmanager
def _as_stored(what: str, row: Mapping[str, Any]) -> Iterator[None]:
    try:
        yield
    except InputError as error:
        raise RecordsError(
            f"{what} {str(row.get('id', ''))!r:.40} must be as it was stored; {error} (tsis records verify)"
        ) from error


def insert_row(connection: Connection, table: Table, row: Row, *, action: str = "add") -> AuditChange:
    """Insert a row, and return its entry of the audit."""
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
    stored = connection.execute(select(table).where(unchanged)).first()
    if stored is None:
        raise StaleRecordError(
            f"the {what} must be as it was read to be changed; somebody else has changed it since version "
            f"{before.version} (read it again)"
        )
    if digest_or_none(stored._asdict()) != last_content(connection, table.name, before.id):
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
    changed = _columns(target_row(_edited(target, "target", changes, EDITABLE["target"])), changes)

    def enter(connection: Connection) -> tuple[Target, list[AuditChange]]:
        change = update_row(connection, tables.target_table, target, changed)
        return target_of_row(change.values), [change]

    return enter


def press_edit(
    press: StoredPress, changes: Mapping[str, Any], *, editable: tuple[str, ...] = EDITABLE["press"]
) -> Callable[[Connection], tuple[StoredPress, list[AuditChange]]]:
    """A function that applies changes to a press; errors as `target_edit`."""
    edited = press_row(_edited(press, "press", changes, editable))
    names = [name for name in changes if name != "mm_per_pixel"]
    scale = ("mm_per_pixel_x", "mm_per_pixel_y") if "mm_per_pixel" in changes else ()
    changed = _columns(edited, (*names, *scale))

    def enter(connection: Connection) -> tuple[StoredPress, list[AuditChange]]:
        change = update_row(connection, tables.press_table, press, changed)
        stored = connection.execute(press_query().where(tables.press_table.c.id == press.id)).one()
        return press_of_row(stored._asdict()), [change]

    return enter


def _edited(record: Any, kind: str, changes: Mapping[str, Any], editable: tuple[str, ...]) -> Any:
    if not changes:
        raise InputError(f"an edit of a {kind} must change something; got nothing (name {', '.join(editable)})")
    for name in changes:
        require_one_of(f"field of a {kind} that may be changed", name, editable)
    return replace(record, **changes, version=record.version + 1)


def _columns(row: Row, changes: Iterable[str]) -> Row:
    """The changed columns only: the caller may have altered the other fields."""
    return {name: row[name] for name in (*changes, "version")}
