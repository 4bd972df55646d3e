"""Schema upgrades in one transaction, after a copy of an old SQLite file, and checks of the schema."""

from __future__ import annotations

import re
import sqlite3
import threading
from contextlib import suppress
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from sqlalchemy import create_engine, inspect, text

from tsis.errors import RecordsError
from tsis.files import DISK, PRIVATE_FILE, UNFINISHED, one_line, printable_path
from tsis.records.store._tables import metadata

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from alembic.config import Config
    from sqlalchemy import Connection


# Alembic is loaded where it is used: most programs that open a store need not spend a fifth of a second on it.
VERSIONS = "alembic_version"
_lock = threading.Lock()  # Alembic's context is global to the process


@cache
def readable_revisions() -> tuple[str, ...]:
    """The schemas that this release can read, the present one first."""
    names = [script.name for script in (resources.files("tsis.records.migrations") / "versions").iterdir()]
    numbers = sorted(
        (int(found[1]) for name in names if (found := re.fullmatch(r"schema_(\d+)\.py", name))), reverse=True
    )
    return tuple(map(str, numbers))


def newest_revision() -> str:
    """The present schema."""
    return readable_revisions()[0]


def revision(connection: Connection, name: str) -> str | None:
    """The schema of a database; None for an empty one, `RecordsError` for an unknown one."""
    if not inspect(connection).has_table(VERSIONS):
        return None
    result = list(connection.execute(text(f"SELECT version_num FROM {VERSIONS}")).scalars())
    if len(result) != 1 or result[0] not in readable_revisions():
        raise RecordsError(
            f"{name} must have a schema up to {newest_revision()}; it has {', '.join(map(repr, result)) or 'none':.60} "
            "(was it written by a newer release of tsis? then update tsis)"
        )
    return str(result[0])


def upgrade(connection: Connection) -> None:
    """Run the missing steps within the transaction of ``connection``."""
    from alembic import command

    with _lock:
        command.upgrade(_alembic(connection), "head")


def back_up(connection: Connection, file: Path, present: str) -> None:
    """Copy a SQLite ``file`` of schema ``present`` durably, or raise `RecordsError` so that nothing is migrated."""
    copy = file.with_name(f"records-of-schema-{present}.sqlite3")
    draft = copy.with_name(f".{copy.name}{UNFINISHED}")
    try:
        draft.unlink(missing_ok=True)  # from a killed migration
        draft.touch(mode=PRIVATE_FILE)
        vacuum_into(connection, draft)
        with draft.open("rb+") as written:
            DISK.sync(written)
        DISK.rename(draft, copy)
        DISK.sync_folder(copy.parent)
    except (OSError, sqlite3.Error) as error:
        raise RecordsError(
            f"a copy of the old records must be written to {printable_path(copy)}; got: {one_line(error)} "
            "(nothing was changed; free some space)"
        ) from error
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def vacuum_into(connection: Connection, file: Path) -> None:
    """Copy the database of SQLite into an empty or missing file; outside of a transaction only."""
    connection.connection.driver_connection.execute("VACUUM INTO ?", (str(file),))  # type: ignore[union-attr]


def _alembic(connection: Connection | None = None) -> Config:
    from alembic.config import Config

    config = Config()
    config.set_main_option("script_location", "tsis.records:migrations")
    config.attributes["connection"] = connection
    return config


_BEFORE_UPDATE_DELETE_TRUNCATE = 2 + 8 + 16 + 32  # bits of tgtype of a statement trigger
_EVER = ("O", "A")  # values of tgenabled: active in an ordinary session


def schema_faults(connection: Connection) -> Iterator[str]:
    """A message for each table, column, index or trigger that is missing, changed or added."""
    return _in_sqlite(connection) if connection.dialect.name == "sqlite" else _in_postgresql(connection)


def _in_sqlite(connection: Connection) -> Iterator[str]:
    for (message,) in connection.execute(text("PRAGMA integrity_check(10)")):  # a damaged index hides rows
        if message != "ok":
            yield f"the database file is damaged: {one_line(message)}"
    requested, result = _created_by_migrations(), _sqlite_schema(connection)
    for kind, name in sorted(requested.keys() | result.keys()):
        what = f"{kind} {one_line(name, 80)} of the database"
        if (kind, name) not in result:
            yield f"the {what} was taken out"
        elif (kind, name) not in requested:
            yield f"the {what} was put in"
        elif result[kind, name] != requested[kind, name]:
            yield f"the {what} is not as it was made"


@cache
def _created_by_migrations() -> dict[tuple[str, str], str]:
    engine = create_engine("sqlite://")
    try:
        with engine.connect() as connection, connection.begin():
            upgrade(connection)
            return _sqlite_schema(connection)
    finally:
        engine.dispose()


def _sqlite_schema(connection: Connection) -> dict[tuple[str, str], str]:
    listed = connection.execute(text("SELECT type, name, sql FROM sqlite_master"))
    # Without SQLite's own tables, and Alembic's, whose definition varies.
    return {
        (str(row.type), str(row.name)): " ".join(str(row.sql).split())
        for row in listed
        if VERSIONS not in str(row.sql) and not str(row.name).startswith("sqlite_")
    }


def _in_postgresql(connection: Connection) -> Iterator[str]:
    from alembic.autogenerate import compare_metadata
    from alembic.migration import MigrationContext

    ours = set(metadata.tables)
    options = {"include_name": lambda name, kind, _: kind != "table" or name in ours, "compare_type": True}
    context = MigrationContext.configure(connection, opts=options)
    for change in compare_metadata(context, metadata):
        yield f"the schema of the database is not as it was made; to be done: {one_line(change)}"
    yield from _postgresql_trigger_faults(connection)
    listed = connection.execute(text("SELECT tablename, rulename FROM pg_rules WHERE schemaname = current_schema()"))
    for row in listed:
        if row.tablename in ours:
            yield f"the rule {one_line(row.rulename, 80)} of the table {row.tablename} was put in"


def _postgresql_trigger_faults(connection: Connection) -> Iterator[str]:
    query = """SELECT relname, tgname, tgenabled, tgtype, prosrc FROM pg_trigger JOIN pg_class ON pg_class.oid = tgrelid
        JOIN pg_proc ON pg_proc.oid = tgfoid WHERE NOT tgisinternal AND relnamespace = current_schema()::regnamespace"""
    saved = False
    for row in connection.execute(text(query)):
        if (row.relname, row.tgname) == ("audit", "audit_append_only"):
            enabled = row.tgenabled.decode() if isinstance(row.tgenabled, bytes) else row.tgenabled
            saved = (
                enabled in _EVER
                and row.tgtype == _BEFORE_UPDATE_DELETE_TRUNCATE
                and " ".join(row.prosrc.split()) == "BEGIN RAISE EXCEPTION 'audit is append-only'; END"
            )
        elif row.relname in metadata.tables:
            yield f"the trigger {one_line(row.tgname, 80)} of the table {row.relname} was put in"
    if not saved:
        yield "the trigger by which the audit is append-only was taken out, changed or switched off"
