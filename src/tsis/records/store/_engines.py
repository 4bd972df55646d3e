"""Engines for SQLite and PostgreSQL with durable commits and exact numbers."""

from __future__ import annotations

import sqlite3
import time
from typing import TYPE_CHECKING, Any

from sqlalchemy import URL, create_engine, event, make_url
from sqlalchemy.exc import ArgumentError, NoSuchModuleError

from tsis.errors import RecordsError, import_extra

if TYPE_CHECKING:
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
