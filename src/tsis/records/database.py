"""The database behind a store: SQLite with every commit synced, or PostgreSQL by its URL; with the present schema."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from alembic import command
from alembic.config import Config
from alembic.runtime.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import URL, create_engine, event, make_url, text
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError, SQLAlchemyError

from tsis.model.errors import RecordsError
from tsis.model.extra import library

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from sqlalchemy import Connection, Engine

FILE = "records.sqlite3"
BUSY_S = 30.0  # how long one waits for another that writes
_IMMEDIATE = "tsis_immediate"


class Database:
    """Connections to one database whose commits last.

    Parameters
    ----------
    url
        ``None`` for SQLite in ``folder``, else the URL of a PostgreSQL database.
    folder
        Folder of the store.

    Raises
    ------
    RecordsError
        When the URL is none, the database cannot be reached, is no store, or does not sync what it commits.
    MissingExtraError
        When PostgreSQL is named and its driver is not installed.
    """

    def __init__(self, url: str | None, folder: Path) -> None:
        self.file = folder / FILE if url is None else None
        self.name = str(self.file) if self.file else _url(url or "").render_as_string(hide_password=True)
        self._engine = _sqlite(folder / FILE) if url is None else _postgresql(_url(url))
        with self.reading() as connection:
            self._require_lasting(connection)

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """One state of the whole database, whatever others write meanwhile."""
        options: dict[str, Any] = {} if self.file else {"isolation_level": "REPEATABLE READ"}
        with told(self.name), self._engine.connect() as connection:
            yield connection.execution_options(**options)

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction that lasts when this ends, or that never was; one at a time in SQLite."""
        with (
            told(self.name),
            self._engine.connect() as connection,
            connection.execution_options(**{_IMMEDIATE: True}).begin(),
        ):
            yield connection

    def migrate(self) -> None:
        """Bring the schema up to date; of an old SQLite file a copy is kept beside it first."""
        script = ScriptDirectory.from_config(_alembic())
        with self.reading() as connection:
            present = MigrationContext.configure(connection).get_current_revision()
        if present == script.get_current_head():
            return
        if present is not None:
            self._require_known(present, script)
            self._copy(present)
        with self.writing() as connection:
            if self.file is None:
                connection.execute(text("SELECT pg_advisory_xact_lock(0x74736973)"))  # two that begin at once
            command.upgrade(_alembic(connection), "head")

    def empty(self) -> bool:
        """Whether nothing was ever stored in it."""
        with self.reading() as connection:
            return MigrationContext.configure(connection).get_current_revision() is None

    def close(self) -> None:
        """Let go of every connection."""
        self._engine.dispose()

    def _require_known(self, present: str, script: ScriptDirectory) -> None:
        if present not in {step.revision for step in script.walk_revisions()}:
            raise RecordsError(
                f"{self.name} must have a schema up to {script.get_current_head()}; it has {present[:20]!r} "
                "(it was written by a newer release of tsis: update tsis)"
            )

    def _copy(self, present: str) -> None:
        if self.file is None:
            return  # a server's backups are its keeper's
        copy = self.file.with_name(f"records-of-schema-{present}.sqlite3")
        copy.unlink(missing_ok=True)  # of a step that was interrupted before it changed anything
        with told(self.name), self._engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.execute(text("VACUUM INTO :copy"), {"copy": str(copy)})

    def _require_lasting(self, connection: Connection) -> None:
        if self.file is not None:
            journal = connection.execute(text("PRAGMA journal_mode")).scalar_one()
            if journal != "wal":
                raise RecordsError(
                    f"{self.name} must lie on a file system that allows a write-ahead log; got {journal!r}"
                )
            return
        for name in ("synchronous_commit", "fsync"):
            value = connection.execute(text(f"SHOW {name}")).scalar_one()
            if value == "off":
                raise RecordsError(
                    f"{self.name} must sync what it commits; its server has {name} = off "
                    "(switch it on in postgresql.conf)"
                )


@contextmanager
def told(name: str) -> Iterator[None]:
    """Turn what a database says into one sentence."""
    try:
        yield
    except DBAPIError as error:
        said = str(error.orig).strip().splitlines()
        raise RecordsError(
            f"the records in {name} must be open to reading and writing; the database says: "
            f"{said[0] if said else type(error.orig).__name__} (nothing that was stored before is lost)"
        ) from error
    except SQLAlchemyError as error:
        raise RecordsError(f"the records in {name} must be readable; got: {str(error).splitlines()[0]}") from error


def _url(url: str) -> URL:
    try:
        found = make_url(url)
    except ArgumentError as error:
        raise RecordsError("the database must be a URL as postgresql://user@host/name; got something else") from error
    if found.get_backend_name() != "postgresql":
        raise RecordsError(
            f"the database must be PostgreSQL, as postgresql://user@host/name; got {found.drivername!r:.40} "
            "(for SQLite name no database, only the folder)"
        )
    return found.set(drivername="postgresql+psycopg")


def _postgresql(url: URL) -> Engine:
    library("psycopg", feature="a store of records in PostgreSQL", extra="postgres")
    try:
        return create_engine(url, pool_pre_ping=True, connect_args={"connect_timeout": int(BUSY_S)})
    except (NoSuchModuleError, ArgumentError) as error:
        raise RecordsError(f"the database must be a URL that its driver understands; got: {error}") from error


def _sqlite(file: Path) -> Engine:
    engine = create_engine(URL.create("sqlite", database=str(file)), connect_args={"timeout": BUSY_S})

    @event.listens_for(engine, "connect")
    def configure(connection: Any, _record: Any) -> None:
        connection.isolation_level = None  # SQLAlchemy's own BEGIN, below, and no other
        for pragma in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON", "trusted_schema=OFF"):
            connection.execute(f"PRAGMA {pragma}")

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        # A transaction that will write takes its lock at once: one that reads first could not get it later.
        immediate = connection.get_execution_options().get(_IMMEDIATE)
        connection.exec_driver_sql("BEGIN IMMEDIATE" if immediate else "BEGIN")

    return engine


def _alembic(connection: Connection | None = None) -> Config:
    config = Config()
    config.set_main_option("script_location", "tsis.records:migrations")
    config.attributes["connection"] = connection
    return config
