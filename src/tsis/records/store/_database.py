"""Whether the file that was opened still lies where it was: who goes on in one that is gone writes into nothing."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from alembic.util.exc import CommandError
from sqlalchemy import event, inspect, text
from sqlalchemy.exc import DatabaseError, DBAPIError, SQLAlchemyError

from tsis.errors import RecordsError
from tsis.files import one_line, printable_path
from tsis.records.store._engines import (
    IMMEDIATE,
    postgresql_engine,
    postgresql_url,
    public_name,
    reading_engine,
    sqlite_engine,
)
from tsis.records.store._upgrade import copied, newest_revision, revision, upgraded

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from sqlalchemy import Connection


class SameFile:
    """A database's file as it is when this is made, told from another one that takes its place.

    Parameters
    ----------
    file
        Where it lies; it is there.
    """

    def __init__(self, file: Path) -> None:
        self.file = file
        self._opened = _identity(file)

    def replaced(self) -> bool:
        """Whether it is gone from its place, or another one lies there; one look at the disk."""
        return _identity(self.file) != self._opened

    def require(self) -> None:
        """Refuse, with `RecordsError`, to write into a file that is gone: nobody would ever find it again."""
        if self.replaced():
            raise RecordsError(
                f"the store in {printable_path(self.file.parent)} was moved or replaced since it was "
                f"opened; nothing was "
                "stored (put it back, or start anew)"
            )


def _identity(file: Path) -> tuple[int, int] | None:
    """What tells a file from another of its name; None where there is none to be seen."""
    try:
        result = file.stat()
    except OSError:
        return None
    return result.st_dev, result.st_ino  # the latter is 0 on some systems: then only a missing file is noticed


DATABASE_FILE = "records.sqlite3"
CURE = "copy the whole folder of the store to where it can be written, and name that"
_LOCK_KEY = 0x74736973  # the advisory lock of those who begin or migrate a store


class Database:
    """Connections to one database whose commits last.

    Parameters
    ----------
    url
        ``None`` for SQLite in ``folder``, else the URL of a PostgreSQL database.
    folder
        Folder of the store.
    read_only
        Whether it lies where nothing can be written, as on a backup medium.

    Raises
    ------
    RecordsError
        When the URL is none, the database cannot be reached, is no store, or does not sync what it commits.
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
                    inspect(connection).get_table_names()  # what is logged and cannot be taken in shows here
                else:
                    _require_lasting(connection, self.name)
            self._hold_on_to_the_file()
        except BaseException as error:
            self.close()
            if read_only and isinstance(error, RecordsError):
                raise RecordsError(f"{error}; {CURE}") from error
            raise

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """One state of the whole database, whatever others write meanwhile."""
        self._require_open()
        options: dict[str, Any] = {} if self.file else {"isolation_level": "REPEATABLE READ"}
        with database_errors(self.name), self._engine.connect() as connection:
            yield connection.execution_options(**options)

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction that lasts when this ends, or that never was; one at a time in SQLite."""
        self._require_open()
        if self.read_only:
            raise RecordsError(f"{self.name} must lie where it can be written, to be added to; it does not: {CURE}")
        self.require_there()
        # A server may be set to a stricter isolation, in which who waits for another's row is refused it in the end.
        options: dict[str, Any] = {IMMEDIATE: True} if self.file else {"isolation_level": "READ COMMITTED"}
        with (
            database_errors(self.name),
            self._engine.connect() as connection,
            connection.execution_options(**options).begin(),
        ):
            yield connection
            self.require_there()  # what is committed to a file that is gone is lost, whatever SQLite says

    @contextmanager
    def beginning(self) -> Iterator[Connection]:
        """As `writing`, and of those who begin or migrate a store one at a time in PostgreSQL too."""
        with self.writing() as connection:
            if self.file is None:
                connection.execute(text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": _LOCK_KEY})
            yield connection

    def migrate(self) -> None:
        """Bring the schema up to date; of an old SQLite file a copy is kept beside it first."""
        with self.reading() as connection:
            present = revision(connection, self.name)
        if present == newest_revision():
            return
        if self.read_only:
            raise RecordsError(
                f"{self.name} must have schema {newest_revision()} where nothing can be written; it has "
                f"{present or 'none'}: {CURE}"
            )
        with self.beginning() as connection:
            present = revision(connection, self.name)  # another program may have been faster
            if present is not None and present != newest_revision() and self.file is not None:
                with self.reading() as other:  # sees what was committed: the old schema
                    copied(other, self.file, present)
            upgraded(connection)

    def empty(self) -> bool:
        """Whether nothing was ever stored in it."""
        with self.reading() as connection:
            return revision(connection, self.name) is None

    def replaced(self) -> bool:
        """Whether SQLite's file is gone from where it was opened, or another one lies there; one look at the disk."""
        return self._opened is not None and self._opened.replaced()

    def require_there(self) -> None:
        """Refuse, with `RecordsError`, to write to a store whose folder was moved, deleted or replaced."""
        if self._opened is not None:
            self._opened.require()

    def close(self) -> None:
        """Let go of every connection."""
        self._closed = True
        self._engine.dispose()

    def _hold_on_to_the_file(self) -> None:
        """From now on no connection is made to another file: kept for later, it would swallow what is stored then."""
        if self.file is None:
            return
        self._opened = SameFile(self.file)
        if not self.read_only:
            for moment in ("do_connect", "connect"):  # before, so that no empty file is made, and after
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
    """Turn what a database says into one sentence."""
    try:
        yield
    except DBAPIError as error:
        if type(error) is DatabaseError:  # and none of its kinds: what SQLite says of a file that is none, or damaged
            raise RecordsError(
                f"the records in {name} must be a database that is whole; it says: {one_line(error.orig)} "
                "(take it from a backup)"
            ) from error
        raise RecordsError(
            f"the records in {name} must be open to reading and writing; the database says: "
            f"{one_line(error.orig)} (nothing that was stored before is lost)"
        ) from error
    except (SQLAlchemyError, CommandError, UnicodeError) as error:  # the last: text that is none
        raise RecordsError(f"the records in {name} must be readable; got: {one_line(error)}") from error
