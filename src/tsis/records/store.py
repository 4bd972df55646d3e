"""Targets that are archived, deleted, restored and erased."""

from __future__ import annotations

import getpass
import json
import os
import shlex
import stat
import threading
import uuid
import warnings
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

import platformdirs
from sqlalchemy import delete, insert, select, update

from tsis.calibration.file import ProbeCalibration, calibration_bytes, calibration_sha256
from tsis.errors import InputError, RecordsError, RecordsWarning
from tsis.files.atomic import (
    DISK,
    PRIVATE_FILE,
    PRIVATE_FOLDER,
    Disk,
    atomic_folder,
    make_folder_durably,
    remove_unfinished,
)
from tsis.files.canonical_json import digest_or_none
from tsis.files.hash_chain import FIRST_HASH, link_faults
from tsis.files.json_values import from_json_value, to_json_value
from tsis.files.reading import as_path, file_error, one_line, printable_path
from tsis.model.image import TactileImage
from tsis.model.require import require_one_of, require_type
from tsis.records import rows
from tsis.records import schema as tables
from tsis.records.audit import ANCHOR_FILE as ANCHOR
from tsis.records.audit import (
    BEFORE,
    LOST,
    AuditChange,
    AuditHead,
    append_audit,
    begin_audit,
    has_entry,
    locked_head,
    lost_after,
    read_anchor,
    require_anchored,
    write_anchor,
)
from tsis.records.audit import KIND as ANCHOR_ENTRY
from tsis.records.blobs import Blobs, frame_bytes, samples_bytes
from tsis.records.database import DATABASE_FILE, TERM, Database, derived, new_secret, read_secret
from tsis.records.reader import ARCHIVED, DELETED, TERM_OF, StoreReader, TargetState, read_states
from tsis.records.rows import insert_row, insert_row_once, press_edit, require_row, target_edit
from tsis.records.schema import (
    RECORDED,
    audit_head_table,
    audit_table,
    calibration_table,
    frame_table,
    schema_faults,
)
from tsis.records.transfer import ImportedTarget, TargetImport, is_taken, next_number, require_kind, stored_frames
from tsis.records.values import (
    KINDS,
    StoredEstimate,
    StoredMap,
    StoredPress,
    Target,
    map_bytes,
    require_label,
    require_moment,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping

    from sqlalchemy import Connection, Row, Select, Table

    from tsis.mapping.lump_map import LumpMap
    from tsis.model.estimate import Estimate
    from tsis.records.values import TargetRecord


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
    own = table.c.name == row["name"]
    if connection.execute(select(table.c.name).where(own)).first() is None:
        connection.execute(insert(table).values(row))
    else:
        connection.execute(update(table).where(own).values(value=row["value"]))
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
    press, frame, files = tables.press_table, tables.frame_table, list[tuple[str, str]]()
    number = connection.execute(
        select(tables.target_table.c.number).where(tables.target_table.c.id == target)
    ).scalar_one()
    presses = list(connection.execute(select(press.c.id, press.c.frame).where(press.c.target == target)))
    results: list[tuple[Table, str]] = []
    for table, column, ending in RESULT_FILES:
        file = table.c[column].label("file")
        own = connection.execute(select(table.c.id, file).where(table.c.target == target)).all()
        connection.execute(delete(table).where(table.c.target == target))
        results += [(table, row.id) for row in own]
        for name in {row.file for row in own}:
            if connection.execute(select(table.c.id).where(table.c[column] == name).limit(1)).first() is None:
                files.append((name, ending))
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
        *results,
        *((press, row.id) for row in presses),
        *((frame, name) for name in frames),
        (tables.target_table, target),
    ]
    tombstone = {"state": ERASED, "since": now.isoformat(), "number": int(number), "presses": len(presses)}
    return [
        *(AuditChange(action="erase", kind=table.name, row=row, values={}) for table, row in removed),
        _term_change(connection, target, "erase", tombstone),
    ], [*((name, "png") for name in frames), *files]


RESULT_FILES = ((tables.estimate_table, "samples", "samples"), (tables.map_table, "file", "json"))
FILES = "files"
Value = TypeVar("Value")


class Store(StoreReader):
    """Targets with their presses, calibrations and estimates; see `tsis.records.store.open_store`.

    ``folder`` has the files and ``database`` the rows; ``identity`` and ``kind``, ``"phantom"`` or ``"subject"``, are
    those of the store; ``actor`` is the user, for the audit.
    """

    def __init__(
        self, folder: Path, database: Database, *, identity: str, kind: str, actor: str, disk: Disk = DISK
    ) -> None:
        blobs = Blobs(folder / FILES, disk=disk, allowed=database.require_there)
        super().__init__(folder, database, blobs, identity=identity, kind=kind)
        require_label("actor", actor)
        self.actor = actor
        self._disk = disk
        self._write_lock = threading.Lock()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the database."""
        self.database.close()

    # What is stored

    def record(self, target: Target, *, limit: int | None = None, offset: int = 0) -> TargetRecord:
        """All data of a target."""
        with self.database.reading() as connection:
            secret = read_secret(connection)
        return replace(super().record(target, limit=limit, offset=offset), secret=derived(secret, "target", target.id))

    def add_target(
        self, *, number: int | None = None, name: str = "", note: str = "", truth: Mapping[str, float] | None = None
    ) -> Target:
        """Enter a target; ``number`` is the next free one by default.

        Raises
        ------
        InputError
            When the number is taken, no number is left, or a value is invalid.
        RecordsError
            When it cannot be stored.
        """
        new = Target(
            number=1 if number is None else number,
            kind=self.kind,
            name=name,
            note=note,
            truth=truth or {},
            made=datetime.now(UTC),
            id=uuid.uuid4().hex,
        )

        def enter(connection: Connection) -> tuple[Target, list[AuditChange]]:
            if number is not None and is_taken(connection, number):
                raise InputError(f"number must be that of no target of this store; {number} is taken")
            target = replace(new, number=next_number(connection)) if number is None else new
            return target, [insert_row(connection, tables.target_table, rows.target_row(target))]

        return self._write(enter)

    def add_press(
        self,
        target: Target,
        image: TactileImage,
        *,
        role: str = "target",
        taken: datetime,
        probe: str = "",
        calibration: ProbeCalibration | None = None,
        flags: tuple[str, ...] = (),
        note: str = "",
    ) -> StoredPress:
        """Save a frame with its metadata; when this returns, it survives a loss of power.

        The grey levels of the image must be whole. The active calibration is saved too; other parameters as in
        `StoredPress`.

        Raises
        ------
        InputError
            When grey levels are not whole numbers, or `StoredPress` refuses a value.
        RecordsError
            When it cannot be stored; earlier data stay intact.
        """
        require_type("target", target, Target)
        require_type("image", image, TactileImage)
        if calibration is not None:
            require_type("calibration", calibration, ProbeCalibration)
        require_moment("taken", taken)
        content = frame_bytes(image)
        shape = image.grey.shape
        press = StoredPress(
            role=role,
            taken=taken.astimezone(UTC),
            frame=self.blobs.put(content, "png"),
            rows=shape[0],
            columns=shape[1],
            full_scale=image.full_scale,
            force_n=image.force_n,
            mm_per_pixel=image.mm_per_pixel,
            axis_px=image.axis(),
            probe=probe,
            calibration=None if calibration is None else calibration_sha256(calibration),
            flags=flags,
            settings=image.settings,
            name=image.name,
            note=note,
            id=uuid.uuid4().hex,
            target=target.id,
        )
        # The value as a reader will get it: settings as lists, not as tuples.
        press = from_json_value(StoredPress, to_json_value(press), "press", complete=True)
        stored = None if calibration is None else self._calibration_row(calibration)
        frame = {"id": press.frame, "rows": shape[0], "columns": shape[1], "bytes": len(content)}

        def enter(connection: Connection) -> tuple[StoredPress, list[AuditChange]]:
            require_present(connection, target)
            return press, [
                *insert_row_once(connection, tables.calibration_table, stored),
                *insert_row_once(connection, tables.frame_table, frame),
                insert_row(connection, tables.press_table, rows.press_row(press)),
            ]

        return self._write(enter)

    def add_estimate(
        self,
        target: Target,
        estimate: Estimate,
        *,
        kind: str,
        presses: Iterable[StoredPress],
        probe: str,
        calibration: ProbeCalibration,
        options: Mapping[str, Any] | None = None,
        environment: Mapping[str, Any] | None = None,
        supersedes: StoredEstimate | None = None,
    ) -> StoredEstimate:
        """Save an estimate with everything needed to repeat it; parameters as in `StoredEstimate`.

        Raises
        ------
        InputError
            When `StoredEstimate` refuses a value.
        RecordsError
            When a press is not of this target, or the estimate cannot be stored.
        """
        stored = StoredEstimate(
            kind=kind,
            estimate=estimate,
            made=datetime.now(UTC),
            probe=probe,
            presses=tuple(press.id for press in presses),
            calibration=calibration_sha256(calibration),
            options=options or {},
            environment=environment or {},
            supersedes=None if supersedes is None else supersedes.id,
            id=uuid.uuid4().hex,
            target=target.id,
        )
        row = rows.estimate_row(stored, self.blobs.put(samples_bytes(estimate), "samples"))
        self._enter_result(target, stored.presses, calibration, tables.estimate_table, row)
        return stored

    def add_map(
        self,
        target: Target,
        found: LumpMap,
        *,
        presses: Iterable[StoredPress],
        probe: str,
        calibration: ProbeCalibration,
        options: Mapping[str, Any] | None = None,
        environment: Mapping[str, Any] | None = None,
        supersedes: StoredMap | None = None,
    ) -> StoredMap:
        """Save a map of lumps with everything needed to repeat it, and return it as a reader will get it.

        Parameters as in `StoredMap`; errors as `add_estimate`.
        """
        stored = StoredMap(
            estimate=found,
            made=datetime.now(UTC),
            probe=probe,
            presses=tuple(press.id for press in presses),
            calibration=calibration_sha256(calibration),
            options=options or {},
            environment=environment or {},
            supersedes=None if supersedes is None else supersedes.id,
            id=uuid.uuid4().hex,
            target=target.id,
        )
        content = map_bytes(found)
        row = rows.map_row(stored, self.blobs.put(content, "json"))
        self._enter_result(target, stored.presses, calibration, tables.map_table, row)
        return rows.map_of_row(row, content)

    def _enter_result(
        self, target: Target, presses: tuple[str, ...], calibration: ProbeCalibration, table: Table, row: rows.Row
    ) -> None:
        calibration_row = self._calibration_row(calibration)

        def enter(connection: Connection) -> tuple[None, list[AuditChange]]:
            require_present(connection, target)
            for press in presses:
                require_row(connection, tables.press_table, press, "press", target=target.id)
            changes = insert_row_once(connection, tables.calibration_table, calibration_row)
            return None, [*changes, insert_row(connection, table, row)]

        self._write(enter)

    def import_target(
        self, record: TargetRecord, *, progress: Callable[[int, int], None] | None = None
    ) -> ImportedTarget:
        """Import a target of another store with its presses, estimates and calibrations: all or nothing.

        ``progress`` is called with (done, all) frames.

        Raises
        ------
        RecordsError
            When the kind differs, an identity is taken by another row, or the record cannot be stored.
        """
        require_kind(record.target, self.kind)
        with self.database.reading() as connection:
            stored = stored_frames(connection, record.presses)
        return self._write(TargetImport(record, self.blobs, stored, progress).enter)

    def _calibration_row(self, calibration: ProbeCalibration) -> rows.Row:
        return rows.calibration_row(calibration, self.blobs.put(calibration_bytes(calibration), "json"))

    # Edits: the digest of the old version stays in the audit

    def edit_target(self, target: Target, **changes: Any) -> Target:
        """Change ``name``, ``note`` or ``truth`` of a target that was read before.

        Raises
        ------
        StaleRecordError
            When another user has changed it since.
        InputError
            When a value is invalid or cannot be changed, or there is no change.
        RecordsError
            When the stored row was changed outside this program.
        """
        return self._write(target_edit(target, changes))

    def edit_press(self, press: StoredPress, **changes: Any) -> StoredPress:
        """Change ``role``, ``force_n``, ``flags`` or ``note`` of a press; errors as `edit_target`."""
        return self._write(press_edit(press, changes))

    def calibrate_press(self, press: StoredPress, calibration: ProbeCalibration) -> StoredPress:
        """Say under which calibration a press was taken that names none; the calibration is saved too.

        The calibration gives probe and scale where the press has none. Errors as `edit_target`, and `InputError` for a
        press that has a calibration.
        """
        if press.calibration is not None:
            raise InputError(f"a press must have no calibration to be given one; it has {press.calibration[:12]}")
        changes: dict[str, Any] = {"calibration": calibration_sha256(calibration)}
        if not press.probe and calibration.probe:
            changes["probe"] = calibration.probe
        if press.mm_per_pixel is None and calibration.scale is not None:
            changes["mm_per_pixel"] = calibration.scale.mm_per_pixel
        row, edit = self._calibration_row(calibration), rows.press_edit(press, changes, editable=tuple(changes))

        def enter(connection: Connection) -> tuple[StoredPress, list[AuditChange]]:
            added = insert_row_once(connection, tables.calibration_table, row)
            stored, entries = edit(connection)
            return stored, [*added, *entries]

        return self._write(enter)

    # Removal: hidden first, and for good only after some weeks

    def set_state(self, target: Target, state: str) -> TargetState | None:
        """Archive (``"archived"``), delete (``"deleted"``) or restore (``""``) a target; nothing of it is lost.

        `RecordsError` when it is not stored.
        """
        return self._write(state_edit(target, state))

    def erase_expired(self, *, now: datetime | None = None) -> int:
        """Remove what was deleted more than `UNDO_DAYS` days ago, and return how many targets.

        Rows and files go; number, time and count of presses stay, and the audit has an entry for each removed row.
        """
        now = now or datetime.now(UTC)
        with self.database.reading() as connection:
            if not any(state.name == DELETED for state in read_states(connection).values()):
                return 0
        count, files = self._write(erase_expired(now))
        for name, ending in files:
            self.blobs.remove(name, ending)
        return count

    def _write(self, enter: Callable[[Connection], tuple[Value, list[AuditChange]]]) -> Value:
        """Commit one transaction of rows and their audit entries."""
        with self._write_lock:
            with self.database.writing() as connection:
                head = locked_head(connection)
                lost = not require_anchored(connection, self.folder) and head != BEFORE
                value, changes = enter(connection)
                changes = [lost_after(head), *changes] if lost else changes
                head = append_audit(connection, head, changes, actor=self.actor)
            # The rows are committed: an error here would make users save them twice. The anchor lags until the next
            # write, and `verify` reports by how much.
            with suppress(OSError):
                write_anchor(self.folder, self.identity, head, disk=self._disk)
        return value


ABANDONED_S = 86_400.0  # a draft of this age is from a killed program


def default_folder(kind: str) -> Path:
    """Folder of this user's store of a kind: below ``$TSIS_RECORDS_DIR``, else the data folder of the platform.

    Raises
    ------
    UnknownNameError
        When the kind is neither ``"phantom"`` nor ``"subject"``.
    """
    require_one_of("kind of store", kind, KINDS)
    return Path(os.environ.get("TSIS_RECORDS_DIR") or Path(platformdirs.user_data_dir("tsis")) / "records") / f"{kind}s"


def open_store(
    folder: str | os.PathLike[str] | None = None,
    *,
    kind: str = "phantom",
    database: str | None = None,
    create: bool = True,
    actor: str | None = None,
    disk: Disk = DISK,
) -> Store:
    """Open a store, read-only where the folder is not writable, or create an empty one.

    A new store has folders of mode 0700 and files of mode 0600; `RecordsWarning` for one that others may read.

    Parameters
    ----------
    folder
        Folder of its files; by default that of this user and kind.
    kind
        ``"phantom"`` or ``"subject"``; a store of the other kind is refused.
    database
        URL of a PostgreSQL database for the rows; by default SQLite in the folder.
    create
        Whether to create a missing store.
    actor
        The user, for the audit; by default the user of this machine.
    disk
        Write operations, which tests replace.

    Raises
    ------
    RecordsError
        When the store is missing and ``create`` is false, cannot be created or read, or is of the other kind.
    InputError
        When the actor is not printable on one line.
    """
    require_one_of("kind of store", kind, KINDS)
    actor = _user() if actor is None else actor
    require_label("actor", actor)
    path = default_folder(kind) if folder is None else as_path(folder)
    if not create and (not path.is_dir() if database else not (path / DATABASE_FILE).is_file()):
        raise file_error(
            path, "must be a store of records; there is none (tsis records import makes one)", RecordsError
        )
    read_only = only_readable(path) and (database is not None or (path / DATABASE_FILE).is_file())
    if not read_only:
        _make_folders(path, disk, own_database=database is None)
    opened = Database(database, path, read_only=read_only)
    try:
        if not create or read_only:
            _require_begun(opened)
        terms = _terms(opened) or _begin(opened, path, kind, actor, disk)
        _require_kind(path, kind, terms["kind"])
        _require_own_folder(opened, path, terms["identity"])
        if not read_only:
            _warn_of_open_modes(path)
        return Store(path, opened, identity=terms["identity"], kind=kind, actor=actor, disk=disk)
    except BaseException:
        opened.close()
        raise


def only_readable(path: Path) -> bool:
    """Whether a folder exists and is not writable, e.g. on a backup medium."""
    try:
        return any(item.exists() and not os.access(item, os.W_OK) for item in (path, path / DATABASE_FILE))
    except (OSError, ValueError):  # an impossible name
        return False


def _make_folders(path: Path, disk: Disk, *, own_database: bool) -> None:
    """Create the folders and the database file where missing; remove drafts of killed programs."""
    try:
        make_folder_durably(path / FILES, disk=disk, private=True)
        if own_database:  # SQLite would create a file that all may read; its log copies the mode
            os.close(os.open(path / DATABASE_FILE, os.O_RDWR | os.O_CREAT, PRIVATE_FILE))
    except (OSError, ValueError) as error:  # ValueError: a NUL character in its name
        raise file_error(
            path, f"must be a folder that can be made; got: {one_line(error)} (choose another)", RecordsError
        ) from error
    for folder in (path, path / FILES):
        remove_unfinished(folder, age_s=ABANDONED_S)


def _warn_of_open_modes(path: Path) -> None:
    """Warn where other users of this machine may read a store, whose modes were changed since."""
    if os.name == "posix" and all(map(_open_to_others, (path, path / FILES))):
        warnings.warn(
            f"other users of this machine can read the records in {printable_path(path)} "
            f"(this closes the folder: chmod -R go= {shlex.quote(str(path))})",
            RecordsWarning,
            stacklevel=1,
        )


def _open_to_others(folder: Path) -> bool:
    return bool(stat.S_IMODE(folder.stat().st_mode) & ~PRIVATE_FOLDER)


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):  # a container's user without a name
        return "unknown"


def _require_begun(database: Database) -> None:
    if database.empty():
        raise RecordsError(f"{database.name} must hold a store of records; it is empty (tsis records import makes one)")


def _require_kind(path: Path, requested: str, kind: str) -> None:
    if kind != requested:
        raise RecordsError(
            f"{printable_path(path)} must be a store of {requested}s; it is one of {kind}s, which are kept apart "
            f"(name it with --kind {kind})"
        )


def _require_own_folder(database: Database, path: Path, identity: str) -> None:
    """Refuse a folder whose files belong to another store, or that never had any."""
    if (path / ANCHOR).exists():
        try:
            anchored = read_anchor(path)[0]
        except RecordsError:
            return  # a damaged anchor: `verify` reports it, and nothing can be added
    elif any((path / FILES).glob("*/*")):
        return  # a lost anchor: `verify` reports it
    else:
        with database.reading() as connection:
            if connection.execute(select(tables.frame_table.c.id).limit(1)).first() is None:
                return  # nothing is missing
        anchored = "none"
    if anchored != identity:
        raise RecordsError(
            f"{printable_path(path)} must be the folder of the store {identity[:12]}; it is that of {anchored[:12]!r} "
            "(name the folder and the database that belong together)"
        )


def _terms(database: Database) -> dict[str, str]:
    """Properties of the store; empty for a new one."""
    with database.reading() as connection:
        if not tables.has_schema(connection):
            return {}
        terms = {row.name: row.value for row in connection.execute(select(tables.store_table))}
        if terms:
            tables.require_schema(connection, database.name)
    if terms.get("kind") not in KINDS or not isinstance(terms.get("identity"), str):
        shown = {name: value for name, value in terms.items() if name != TERM}
        raise RecordsError(f"{database.name} must say what store it is; got {shown!r:.80} (take it from a backup)")
    return terms


def _begin(database: Database, path: Path, kind: str, actor: str, disk: Disk) -> dict[str, str]:
    made = rows.moment(datetime.now(UTC))
    terms = dict([tables.SCHEMA]) | {"kind": kind, "identity": uuid.uuid4().hex, "made": made, TERM: new_secret()}
    with database.beginning() as connection:
        if tables.has_schema(connection):
            head = None  # another program created it meanwhile
        else:
            _require_no_other(database, path)
            tables.create_schema(connection)
            begin_audit(connection)
            entered = [{"name": name, "value": value} for name, value in terms.items()]
            connection.execute(insert(tables.store_table), entered)
            changes = [AuditChange(action="add", kind="store", row=row["name"], values=row) for row in entered]
            head = append_audit(connection, locked_head(connection), changes, actor=actor)
            _anchor(path, terms["identity"], BEFORE, disk)  # a store without an anchor was tampered with
    if head is None:
        return _terms(database)
    _anchor(path, terms["identity"], head, disk)
    return terms


def _require_no_other(database: Database, path: Path) -> None:
    """Refuse to create a store in a folder whose database was lost."""
    if (path / ANCHOR).exists():
        identity, anchored = read_anchor(path)
        if anchored != BEFORE:  # equal where the creation was interrupted
            raise RecordsError(
                f"{printable_path(path)} must have its database; {database.name} is empty, and the anchor tells of "
                f"{anchored.number} entries of the store {identity[:12]!r} (take the database from a backup)"
            )


def _anchor(path: Path, identity: str, head: AuditHead, disk: Disk) -> None:
    try:
        write_anchor(path, identity, head, disk=disk)
    except OSError as error:
        raise file_error(path, f"must be a folder that can be written; got: {one_line(error)}", RecordsError) from error


_AT_ONCE = 1000  # rows
GONE = digest_or_none({})  # in the last entry of a row that was erased


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreVerification:
    """Result of a verification.

    Attributes
    ----------
    faults
        A message for each difference from the stored state; empty for a sound store.
    notes
        A message for each other event.
    head
        Last entry of the audit. A copy of it elsewhere shows later whether the whole store was replaced.
    rows, files
        Number of checked rows and files.
    unnamed
        Number of files without a row, of interrupted saves. No fault.
    unanchored
        Number of audit entries after the anchor, of saves that were interrupted before the anchor was written. No
        fault; the next save writes it.
    """

    faults: tuple[str, ...]
    notes: tuple[str, ...]
    head: AuditHead
    rows: int
    files: int
    unnamed: int
    unanchored: int

    @property
    def sound(self) -> bool:
        """Whether there are no faults."""
        return not self.faults


def verify_store(store: Store, *, progress: Callable[[int, int], None] | None = None) -> StoreVerification:
    """Compare a store with its audit, read-only.

    ``progress`` is called with (done, all) files. `RecordsError` when the database is unreadable.
    """
    faults, anchored = _anchor_faults(store)  # before the database, which others may extend meanwhile
    with store.database.reading() as connection:
        faults += schema_faults(connection)
        faults += _chain_faults(connection)
        head = last_entry(connection)
        if anchored is not None and anchored != BEFORE and not has_entry(connection, anchored):
            faults.append(
                f"audit entry {anchored.number} must be the one that the anchor tells; it is another, or was cut off"
            )
        row_faults, count = _row_faults(connection)
        notes = tuple(_notes(connection))
        cited = dict(cited_files(connection))
    faults += row_faults
    for done, ((name, ending), of) in enumerate(cited.items(), start=1):
        try:
            store.blobs.get(name, ending)
        except RecordsError as error:
            faults.append(f"{of}: {error}")
        if progress is not None:
            progress(done, len(cited))
    return StoreVerification(
        faults=tuple(faults),
        notes=notes,
        head=head,
        rows=count,
        files=len(cited),
        unnamed=sum(1 for name in store.blobs.names() if name not in cited),
        unanchored=max(0, head.number - (0 if anchored is None else anchored.number)),
    )


def _anchor_faults(store: Store) -> tuple[list[str], AuditHead | None]:
    try:
        identity, anchored = read_anchor(store.folder)
    except RecordsError as error:
        return [str(error)], None
    if identity != store.identity:
        return [f"the anchor must be that of this store, {store.identity}; it is that of {identity!r:.60}"], anchored
    return [], anchored


def _notes(connection: Connection) -> Iterator[str]:
    """Notes on lost anchors."""
    for row in _all(connection, select(audit_table).where(audit_table.c.action == LOST).order_by(audit_table.c.number)):
        number, moment, actor = (one_line(item, 80) for item in (row.number, row.moment, row.actor))
        yield (
            f"audit entry {number} tells that the anchor was missing when {actor} went on at {moment}: whether the "
            "entries before it were cut short or written anew until then, only a backup or a head that was written "
            "down can tell"
        )


def last_entry(connection: Connection) -> AuditHead:
    """The last entry according to the database; `BEFORE` where that is invalid."""
    heads = [tuple(row) for row in connection.execute(select(audit_head_table).limit(2))]
    if len(heads) != 1 or heads[0][0] != 1 or type(heads[0][1]) is not int or not isinstance(heads[0][2], str):
        return BEFORE
    return AuditHead(number=heads[0][1], hash=heads[0][2])


def _all(connection: Connection, query: Select[Any]) -> Iterator[Row[Any]]:
    yield from connection.execute(query, execution_options={"yield_per": _AT_ONCE})


def _chain_faults(connection: Connection) -> Iterator[str]:
    number, before = 0, FIRST_HASH
    for row in _all(connection, select(audit_table).order_by(audit_table.c.number)):
        entry = row._asdict()
        faults, shown = link_faults(entry, number + 1, before), one_line(entry["number"], 40)
        if "number" in faults:
            yield f"audit entry {number + 1} must follow entry {number}; {shown} does (entries were removed or put in)"
        elif "previous" in faults:
            yield f"audit entry {number + 1} must follow the one before it; it follows another"
        if "hash" in faults:
            yield f"audit entry {shown} must be as it was written; it was changed"
        number, before = entry["number"] if type(entry["number"]) is int else number + 1, entry["hash"]
    head = last_entry(connection)
    if (head.number, head.hash) != (number, before):
        yield f"the audit must end at entry {head.number}; it ends at {number}"


def _row_faults(connection: Connection) -> tuple[list[str], int]:
    """Rows that differ from their last entry, lack one, or are missing."""
    entries = _all(
        connection, select(audit_table.c.kind, audit_table.c.row, audit_table.c.content).order_by(audit_table.c.number)
    )
    last = {(entry.kind, entry.row): entry.content for entry in entries if entry.kind != ANCHOR_ENTRY}
    faults, count = [], 0
    for name, table in RECORDED.items():
        primary = next(iter(table.primary_key)).name
        for stored in _all(connection, select(table)):
            row = stored._asdict()
            count += 1
            key, shown = (name, row[primary]), one_line(row[primary], 80)
            if key not in last:
                faults.append(f"{name} {shown}: this row was put in beside the audit")
            elif last.pop(key) != digest_or_none(row):
                faults.append(f"{name} {shown}: this row is not as it was stored")
    taken_out = [key for key, content in last.items() if content != GONE]
    faults += [f"{one_line(name, 40)} {one_line(key, 80)}: this row was taken out" for name, key in taken_out]
    return faults, count


def cited_files(connection: Connection) -> Iterator[tuple[tuple[str, str], str]]:
    """Name and ending of every file that a row cites, with the row."""
    kinds: tuple[tuple[Table, str, str], ...] = (
        (frame_table, "id", "png"),
        (calibration_table, "file", "json"),
        *RESULT_FILES,
    )
    for table, column, ending in kinds:
        for row in _all(connection, select(table.c.id, table.c[column].label("file"))):
            yield (str(row.file), ending), f"{table.name} {one_line(row.id, 80)}"


def back_up_store(
    store: Store, folder: str | os.PathLike[str], *, progress: Callable[[int, int], None] = lambda done, total: None
) -> StoreVerification:
    """Copy a store into a new folder, and verify the copy against its audit; it opens as any store.

    Others may save meanwhile: the copy has the state of its beginning. To restore is the same with the backup as the
    store. ``progress`` is called with (done, all) files, each of which is copied and read again.

    Raises
    ------
    RecordsError
        When rows are in PostgreSQL, a file is missing or damaged, or the copy differs from its audit; no copy is left.
    FileInputError
        When the folder exists already or cannot be written.
    """
    path = as_path(folder)
    if store.database.file is None:
        raise RecordsError(
            f"a backup copies a store in SQLite; the rows of this one are in {store.database.name} (back the database "
            f"up by pg_dump, and copy {printable_path(store.folder)})"
        )
    try:
        with atomic_folder(path) as draft:
            draft.chmod(0o700)
            return _copied(store, draft, progress)
    except FileExistsError as error:
        raise file_error(path, "must be a new folder; there is such a name (choose another)") from error
    except OSError as error:
        raise file_error(path, f"must be a place that can be written; got: {one_line(error)}") from error


def _copied(store: Store, draft: Path, progress: Callable[[int, int], None]) -> StoreVerification:
    (draft / DATABASE_FILE).touch(mode=PRIVATE_FILE)
    (draft / FILES).mkdir(mode=0o700)
    with store.database.reading() as connection:
        driver = connection.connection.driver_connection
        driver.execute("VACUUM INTO ?", (str(draft / DATABASE_FILE),))  # type: ignore[union-attr]
    with closing(Database(None, draft)) as copy, copy.reading() as connection:  # of the same state, whatever is added
        files = list(dict(cited_files(connection)))
        write_anchor(draft, store.identity, last_entry(connection))
    blobs = Blobs(draft / FILES)
    for done, (name, ending) in enumerate(files, start=1):
        blobs.put(store.blobs.get(name, ending), ending)
        progress(done, 2 * len(files))
    with open_store(draft, kind=store.kind, create=False, actor=store.actor) as opened:
        verification = verify_store(opened, progress=lambda done, total: progress(total + done, 2 * total))
    if not verification.sound:
        raise RecordsError(
            f"a backup must be as its audit says; it is not, and neither is the store: {verification.faults[0]} (tsis "
            "records verify shows all; a copy of its folder keeps what there is)"
        )
    return verification
