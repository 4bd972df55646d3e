"""Opening and creating stores."""

from __future__ import annotations

import getpass
import os
import shlex
import stat
import uuid
import warnings
from datetime import UTC, datetime
from pathlib import Path

import platformdirs
from sqlalchemy import insert, select

from tsis.errors import RecordsError, RecordsWarning
from tsis.files import (
    DISK,
    PRIVATE_FILE,
    PRIVATE_FOLDER,
    Disk,
    as_path,
    file_error,
    make_folder_durably,
    one_line,
    printable_path,
    remove_unfinished,
)
from tsis.model import require_one_of
from tsis.records import schema as tables
from tsis.records._values import KINDS, require_label
from tsis.records.store import _rows as rows
from tsis.records.store._audit import ANCHOR_FILE as ANCHOR
from tsis.records.store._audit import (
    BEFORE,
    AuditChange,
    AuditHead,
    append_audit,
    begin_audit,
    locked_head,
    read_anchor,
    write_anchor,
)
from tsis.records.store._database import DATABASE_FILE, TERM, Database, new_secret
from tsis.records.store._store import FILES, Store

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
    position = default_folder(kind) if folder is None else as_path(folder)
    if not create and (not position.is_dir() if database else not (position / DATABASE_FILE).is_file()):
        raise file_error(
            position, "must be a store of records; there is none (tsis records import makes one)", RecordsError
        )
    read_only = only_readable(position) and (database is not None or (position / DATABASE_FILE).is_file())
    if not read_only:
        _make_folders(position, disk, own_database=database is None)
    rows_of = Database(database, position, read_only=read_only)
    try:
        if not create or read_only:
            _require_begun(rows_of)
        result = _terms(rows_of) or _begin(rows_of, position, kind, actor, disk)
        _require_kind(position, kind, result["kind"])
        _require_own_folder(rows_of, position, result["identity"])
        if not read_only:
            _warn_of_open_modes(position)
        return Store(position, rows_of, identity=result["identity"], kind=kind, actor=actor, disk=disk)
    except BaseException:
        rows_of.close()
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
        shown_terms = {name: value for name, value in terms.items() if name != TERM}
        raise RecordsError(
            f"{database.name} must say what store it is; got {shown_terms!r:.80} (take it from a backup)"
        )
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
