"""Whether a database still has the tables, indexes and triggers that the migrations made: who tampers may take some."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import create_engine, text

from tsis.instrument.file_bytes import one_line
from tsis.records.tables import metadata
from tsis.records.upgrade import VERSIONS, upgraded

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sqlalchemy import Connection

_BEFORE_UPDATE_DELETE_TRUNCATE = 2 + 8 + 16 + 32  # bits of tgtype, of a trigger once a statement
_EVER = ("O", "A")  # tgenabled: in an ordinary session


def schema_faults(connection: Connection) -> Iterator[str]:
    """One sentence for each table, column, index or trigger that is absent, changed or put in."""
    return _in_sqlite(connection) if connection.dialect.name == "sqlite" else _in_postgresql(connection)


def _in_sqlite(connection: Connection) -> Iterator[str]:
    for (said,) in connection.execute(text("PRAGMA integrity_check(10)")):  # an index that lacks a row hides it
        if said != "ok":
            yield f"the database file is damaged: {one_line(said)}"
    wanted, found = _made_by_migrations(), _sqlite_schema(connection)
    for kind, name in sorted(wanted.keys() | found.keys()):
        what = f"{kind} {one_line(name, 80)} of the database"
        if (kind, name) not in found:
            yield f"the {what} was taken out"
        elif (kind, name) not in wanted:
            yield f"the {what} was put in"
        elif found[kind, name] != wanted[kind, name]:
            yield f"the {what} is not as it was made"


@cache
def _made_by_migrations() -> dict[tuple[str, str], str]:
    engine = create_engine("sqlite://")
    try:
        with engine.connect() as connection, connection.begin():
            upgraded(connection)
            return _sqlite_schema(connection)
    finally:
        engine.dispose()


def _sqlite_schema(connection: Connection) -> dict[tuple[str, str], str]:
    listed = connection.execute(text("SELECT type, name, sql FROM sqlite_master"))
    # SQLite's own tables hold nothing of ours, and Alembic's is not always spelt the same.
    return {
        (str(row.type), str(row.name)): " ".join(str(row.sql).split())
        for row in listed
        if VERSIONS not in str(row.sql) and not str(row.name).startswith("sqlite_")
    }


def _in_postgresql(connection: Connection) -> Iterator[str]:
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
    kept = False
    for row in connection.execute(text(query)):
        if (row.relname, row.tgname) == ("audit", "audit_append_only"):
            enabled = row.tgenabled.decode() if isinstance(row.tgenabled, bytes) else row.tgenabled
            kept = (
                enabled in _EVER
                and row.tgtype == _BEFORE_UPDATE_DELETE_TRUNCATE
                and " ".join(row.prosrc.split()) == "BEGIN RAISE EXCEPTION 'audit is append-only'; END"
            )
        elif row.relname in metadata.tables:
            yield f"the trigger {one_line(row.tgname, 80)} of the table {row.relname} was put in"
    if not kept:
        yield "the trigger by which the audit is append-only was taken out, changed or switched off"
