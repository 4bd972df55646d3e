"""Connections to SQLite and PostgreSQL with durable commits."""

from __future__ import annotations

import hashlib
import hmac
import secrets
import sqlite3
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from sqlalchemy import URL, create_engine, event, inspect, make_url, select, text
from sqlalchemy.exc import ArgumentError, DatabaseError, DBAPIError, NoSuchModuleError, SQLAlchemyError

from tsis.errors import RecordsError, import_extra
from tsis.files.reading import one_line, printable_path
from tsis.records.schema import has_schema, store_table

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from sqlalchemy import Connection, Engine


BUSY_S = 30  # wait for another writer
CONNECT_S = 10  # wait for a server
IMMEDIATE = "tsis_immediate"
_PING = {"keepalives_idle": 10, "keepalives_interval": 5, "keepalives_count": 4, "tcp_user_timeout": 30_000}
_PRAGMAS = (
    "synchronous=FULL",
    "fullfsync=ON",  # these two: macOS' plain fsync leaves data in the cache of the drive
    "checkpoint_fullfsync=ON",
    "foreign_keys=ON",
    "trusted_schema=OFF",
)
SESSION = (
    f"SET lock_timeout = '{BUSY_S}s'",
    f"SET idle_in_transaction_session_timeout = '{2 * BUSY_S}s'",  # an idle client must not block the others
    "SET extra_float_digits = 1",  # shortest exact digits, whatever the settings of the server
    "SET bytea_output = 'hex'",
)


def sqlite_engine(file: Path) -> Engine:
    """Engine for a SQLite file with a write-ahead log and synced commits."""
    return _sqlite_engine(file, read_only=False, connect_args={"timeout": float(BUSY_S)})


def reading_engine(file: Path) -> Engine:
    """Engine for a SQLite file in a folder that is not writable."""

    def connection() -> sqlite3.Connection:
        log = file.with_name(f"{file.name}-wal")
        logged = log.exists() and log.stat().st_size > 0
        # Without a log there is no writer: the file needs no locks, which could not be created here. With a log,
        # writers have their locks beside it.
        options = "mode=ro" if logged else "mode=ro&immutable=1"
        uri = f"{file.absolute().as_uri()}?{options}"
        return sqlite3.connect(uri, uri=True, timeout=float(BUSY_S), check_same_thread=False)

    return _sqlite_engine(file, read_only=True, creator=connection)


def _sqlite_engine(file: Path, *, read_only: bool, **options: Any) -> Engine:
    engine = create_engine(URL.create("sqlite", database=str(file)), **options)

    @event.listens_for(engine, "connect")
    def configure(connection: Any, _record: Any) -> None:
        connection.isolation_level = None  # SQLAlchemy's own BEGIN, below, and no other
        if not read_only:
            use_write_ahead_log(connection)
        for pragma in _PRAGMAS:
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        # A transaction that will write takes its lock at once: after a read it could not get it.
        immediate = connection.get_execution_options().get(IMMEDIATE)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")

    return engine


def use_write_ahead_log(connection: sqlite3.Connection) -> None:
    """Switch to a write-ahead log, with retries: SQLite ignores its timeout when two clients switch at once."""
    until = time.monotonic() + BUSY_S
    while True:
        try:
            connection.execute("PRAGMA journal_mode=WAL")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                raise
            time.sleep(0.01)
        else:
            return


def postgresql_engine(url: URL) -> Engine:
    """Engine for a PostgreSQL server with bounded waits.

    `MissingExtraError` when the driver is not installed, `RecordsError` when it does not understand the URL.
    """
    import_extra("psycopg", feature="a store of records in PostgreSQL", extra="postgres")
    settings = {"connect_timeout": CONNECT_S, "client_encoding": "utf8", **_PING}
    try:
        engine = create_engine(url, pool_pre_ping=True, connect_args=settings)
    except (NoSuchModuleError, ArgumentError) as error:
        raise RecordsError("the database must be a URL that its driver understands; got another") from error

    @event.listens_for(engine, "connect")
    def configure(connection: Any, _record: Any) -> None:
        for statement in SESSION:
            connection.execute(statement)
        connection.commit()

    return engine


def postgresql_url(text: str) -> URL:
    """The URL of a PostgreSQL database; `RecordsError`, which never repeats it, for anything else."""
    try:
        url = make_url(text)
    except (ArgumentError, ValueError) as error:
        raise RecordsError("the database must be a URL as postgresql://user@host/name; got something else") from error
    if url.get_backend_name() != "postgresql":
        raise RecordsError(
            f"the database must be PostgreSQL, as postgresql://user@host/name; got {url.drivername!r:.40} "
            "(for SQLite name no database, only the folder)"
        )
    return url.set(drivername="postgresql+psycopg")


def public_name(url: URL) -> str:
    """Name of a database in messages, without password and options, which may contain a secret.

    Examples
    --------
    >>> public_name(make_url("postgresql://me:secret@bench:5433/records?passfile=/secret"))
    'postgresql://me@bench:5433/records'
    """
    return url.set(drivername="postgresql", query={})._replace(password=None).render_as_string()


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
                f"the store in {printable_path(self.file.parent)} was moved or replaced since it was opened; nothing "
                "was stored (put it back, or start anew)"
            )


def _identity(file: Path) -> tuple[int, int] | None:
    """Device and inode of a file; None where it is missing."""
    try:
        status = file.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino  # the inode is 0 on some systems, which then detect only a missing file


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
            parsed = postgresql_url(url)
            self.name, self._engine = public_name(parsed), postgresql_engine(parsed)
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
    secret = connection.execute(select(store_table.c.value).where(store_table.c.name == TERM)).scalar()
    if isinstance(secret, str) and len(secret) == 2 * BYTES and set(secret) <= set("0123456789abcdef"):
        return secret
    raise RecordsError(
        "the secret of the store, from which pseudonyms follow, must be as it was made; it was changed or taken out "
        "(tsis records verify; take the database from a backup)"
    )
