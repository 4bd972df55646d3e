"""Connections to the database of a store, and the check that its file was not moved or replaced."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from sqlalchemy import event, inspect, select, text
from sqlalchemy.exc import DatabaseError, DBAPIError, SQLAlchemyError

from tsis.errors import RecordsError
from tsis.files import one_line, printable_path
from tsis.records.schema import has_schema, store_table
from tsis.records.store._engines import (
    IMMEDIATE,
    postgresql_engine,
    postgresql_url,
    public_name,
    reading_engine,
    sqlite_engine,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from sqlalchemy import Connection


class SameFile:
    """Detects that the file of a database was moved or replaced after this was created; ``file`` must exist."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self._opened = _identity(file)

    def replaced(self) -> bool:
        """Whether the path is missing or has another file."""
        return _identity(self.file) != self._opened

    def require(self) -> None:
        """Raise `RecordsError` when the file was replaced: writes to it would be lost."""
        if self.replaced():
            raise RecordsError(
                f"the store in {printable_path(self.file.parent)} was moved or replaced since it was "
                f"opened; nothing was "
                "stored (put it back, or start anew)"
            )


def _identity(file: Path) -> tuple[int, int] | None:
    """Device and inode of a file; None where it is missing."""
    try:
        result = file.stat()
    except OSError:
        return None
    return result.st_dev, result.st_ino  # the inode is 0 on some systems, which then detect only a missing file


DATABASE_FILE = "records.sqlite3"
CURE = "copy the whole folder of the store to where it can be written, and name that"
_LOCK_KEY = 0x74736973  # advisory lock to create a store


class Database:
    """Connections to one database with durable commits.

    Parameters
    ----------
    url
        ``None`` for SQLite in ``folder``, else the URL of a PostgreSQL database.
    folder
        Folder of the store.
    read_only
        Whether the folder is not writable, e.g. on a backup medium.

    Raises
    ------
    RecordsError
        When the URL is invalid, or the database is unreachable, is no store, or does not sync its commits.
    MissingExtraError
        When PostgreSQL is named and its driver is not installed.
    """

    def __init__(self, url: str | None, folder: Path, *, read_only: bool = False) -> None:
        self.file = folder / DATABASE_FILE if url is None else None
        self.read_only = read_only
        self._closed = False
        self._opened: SameFile | None = None
        if url is None:
            engine = reading_engine if read_only else sqlite_engine
            self.name, self._engine = str(self.file), engine(folder / DATABASE_FILE)
        else:
            result = postgresql_url(url)
            self.name, self._engine = public_name(result), postgresql_engine(result)
        try:
            with self.reading() as connection:
                if self.read_only:
                    inspect(connection).get_table_names()  # fails where the write-ahead log cannot be applied
                else:
                    _require_lasting(connection, self.name)
            self._watch_file()
        except BaseException as error:
            self.close()
            if read_only and isinstance(error, RecordsError):
                raise RecordsError(f"{error}; {CURE}") from error
            raise

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A connection that sees one state of the database, whatever others write."""
        self._require_open()
        options: dict[str, Any] = {} if self.file else {"isolation_level": "REPEATABLE READ"}
        with database_errors(self.name), self._engine.connect() as connection:
            yield connection.execution_options(**options)

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction, committed durably or rolled back; one at a time in SQLite."""
        self._require_open()
        if self.read_only:
            raise RecordsError(f"{self.name} must lie where it can be written, to be added to; it does not: {CURE}")
        self.require_there()
        # A server may be set to a stricter isolation, which refuses the row after a wait.
        options: dict[str, Any] = {IMMEDIATE: True} if self.file else {"isolation_level": "READ COMMITTED"}
        with (
            database_errors(self.name),
            self._engine.connect() as connection,
            connection.execution_options(**options).begin(),
        ):
            yield connection
            self.require_there()  # SQLite would commit to a missing file without an error

    @contextmanager
    def beginning(self) -> Iterator[Connection]:
        """As `writing`, and one at a time in PostgreSQL too, to create a store."""
        with self.writing() as connection:
            if self.file is None:
                connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _LOCK_KEY})
            yield connection

    def empty(self) -> bool:
        """Whether the database holds no store."""
        with self.reading() as connection:
            return not has_schema(connection)

    def replaced(self) -> bool:
        """Whether SQLite's file was moved or replaced."""
        return self._opened is not None and self._opened.replaced()

    def require_there(self) -> None:
        """Raise `RecordsError` when the folder of the store was moved, deleted or replaced."""
        if self._opened is not None:
            self._opened.require()

    def close(self) -> None:
        """Close every connection."""
        self._closed = True
        self._engine.dispose()

    def _watch_file(self) -> None:
        """Refuse any later connection to another file, which would take the data of this store."""
        if self.file is None:
            return
        self._opened = SameFile(self.file)
        if not self.read_only:
            for moment in ("do_connect", "connect"):  # before, so that no empty file is created, and after
                event.listen(self._engine, moment, lambda *_: self.require_there())

    def _require_open(self) -> None:
        if self._closed:
            raise RecordsError(
                f"the records in {self.name} must be open; they were closed (open_store opens them again)"
            )


def _require_lasting(connection: Connection, name: str) -> None:
    if connection.dialect.name == "sqlite":
        journal = connection.execute(text("PRAGMA journal_mode")).scalar_one()
        if journal != "wal":
            raise RecordsError(f"{name} must lie on a file system that allows a write-ahead log; got {journal!r}")
        return
    for setting in ("synchronous_commit", "fsync"):
        if connection.execute(text(f"SHOW {setting}")).scalar_one() == "off":
            raise RecordsError(
                f"{name} must sync what it commits; its server has {setting} = off (switch it on in postgresql.conf)"
            )
    encoding = connection.execute(text("SHOW server_encoding")).scalar_one()
    if encoding not in ("UTF8", b"UTF8"):
        raise RecordsError(f"{name} must be a database in UTF8, which holds any text; it is in {encoding!r:.40}")


@contextmanager
def database_errors(name: str) -> Iterator[None]:
    """Convert errors of the database to `RecordsError`."""
    try:
        yield
    except DBAPIError as error:
        if type(error) is DatabaseError:  # the class itself: SQLite's error for a damaged file
            raise RecordsError(
                f"the records in {name} must be a database that is whole; it says: {one_line(error.orig)} "
                "(take it from a backup)"
            ) from error
        raise RecordsError(
            f"the records in {name} must be open to reading and writing; the database says: "
            f"{one_line(error.orig)} (nothing that was stored before is lost)"
        ) from error
    except (SQLAlchemyError, UnicodeError) as error:  # the last: invalid text
        raise RecordsError(f"the records in {name} must be readable; got: {one_line(error)}") from error


TERM = "secret"  # its name in the store table
BYTES = 32


def new_secret() -> str:
    """A random secret as hexadecimal digits."""
    return secrets.token_hex(BYTES)


def derived(secret: str, what: str, identity: str) -> str:
    """HMAC-SHA-256 of an identity under the secret, as 64 hexadecimal digits."""
    return hmac.new(bytes.fromhex(secret), f"tsis {what}\0{identity}".encode(), hashlib.sha256).hexdigest()


def read_secret(connection: Connection) -> str:
    """The secret of a store; `RecordsError` when it was changed or removed."""
    result = connection.execute(select(store_table.c.value).where(store_table.c.name == TERM)).scalar()
    if isinstance(result, str) and len(result) == 2 * BYTES and set(result) <= set("0123456789abcdef"):
        return result
    raise RecordsError(
        "the secret of the store, from which pseudonyms follow, must be as it was made; it was changed or taken out "
        "(tsis records verify; take the database from a backup)"
    )
