"""The tables of a store, and whether a database has them.

Times are ISO 8601 in UTC, nested values canonical JSON, both as text: the same in every database.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

from sqlalchemy import (
    Column,
    Double,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    Table,
    Text,
    UniqueConstraint,
    create_engine,
    inspect,
    select,
    text,
)

from tsis.errors import RecordsError
from tsis.files.reading import one_line

if TYPE_CHECKING:
    from collections.abc import Iterator

    from sqlalchemy import Connection


SCHEMA = ("schema", "1")  # name and value in the store table; a store of another schema is refused
metadata = MetaData()


def _columns(kind: Any, *names: str) -> Iterator[Column[Any]]:
    """Columns of one type that hold a value in every row."""
    return (Column(name, kind, nullable=False) for name in names)


store_table = Table("store", metadata, Column("name", Text, primary_key=True), Column("value", Text, nullable=False))

target_table = Table(
    "targets",
    metadata,
    Column("id", Text, primary_key=True),
    Column("number", Integer, nullable=False, unique=True),
    *_columns(Text, "kind", "name", "note", "truth", "made"),
    Column("version", Integer, nullable=False),
)

calibration_table = Table(
    "calibrations",
    metadata,
    Column("id", Text, primary_key=True),  # SHA-256 of its content, by which results cite it
    *_columns(Text, "file", "name", "probe", "made"),  # the SHA-256 of its file, and its fields
)

frame_table = Table(
    "frames",
    metadata,
    Column("id", Text, primary_key=True),  # SHA-256 of its file
    *_columns(Integer, "rows", "columns", "bytes"),
)

press_table = Table(
    "presses",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    *_columns(Text, "role", "taken"),
    Column("frame", Text, ForeignKey("frames.id"), nullable=False),
    Column("full_scale", Double, nullable=False),
    *(Column(name, Double) for name in ("force_n", "mm_per_pixel_x", "mm_per_pixel_y")),
    *_columns(Double, "axis_px_x", "axis_px_y"),
    Column("probe", Text, nullable=False),
    Column("calibration", Text, ForeignKey("calibrations.id")),
    *_columns(Text, "settings", "name", "flags", "note"),
    Column("version", Integer, nullable=False),
    Index("presses_of_a_target", "target", "taken", "id"),
)

estimate_table = Table(
    "estimates",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    *_columns(Text, "kind", "made", "probe", "presses"),
    Column("calibration", Text, ForeignKey("calibrations.id"), nullable=False),
    *_columns(Text, "options", "environment"),
    Column("supersedes", Text, ForeignKey("estimates.id")),
    *_columns(Text, "document", "samples"),  # the estimate without its samples, and the SHA-256 of their file
    Index("estimates_of_a_target", "target", "made", "id"),
)

map_table = Table(
    "maps",
    metadata,
    Column("id", Text, primary_key=True),
    Column("target", Text, ForeignKey("targets.id"), nullable=False),
    *_columns(Text, "made", "probe", "presses"),
    Column("calibration", Text, ForeignKey("calibrations.id"), nullable=False),
    *_columns(Text, "options", "environment"),
    Column("supersedes", Text, ForeignKey("maps.id")),
    Column("file", Text, nullable=False),  # the SHA-256 of the file that holds the map
    Index("maps_of_a_target", "target", "made", "id"),
)

audit_table = Table(
    "audit",
    metadata,
    Column("number", Integer, primary_key=True, autoincrement=False),
    # Table and key of a row, the digest of its new content, and the hashes of the previous entry and of this one.
    *_columns(Text, "moment", "actor", "action", "kind", "row", "content", "previous", "hash"),
    Index("audit_of_a_row", "kind", "row", "number"),
)

audit_head_table = Table(
    "audit_head",
    metadata,
    Column("id", Integer, primary_key=True),
    Column("number", Integer, nullable=False),
    Column("hash", Text, nullable=False),
)

RECORDED = {
    table.name: table
    for table in (store_table, target_table, calibration_table, frame_table, press_table, estimate_table, map_table)
}

_APPEND_ONLY = {
    "sqlite": (
        "CREATE TRIGGER audit_no_update BEFORE UPDATE ON audit BEGIN SELECT RAISE(ABORT, 'audit is append-only'); END",
        "CREATE TRIGGER audit_no_delete BEFORE DELETE ON audit BEGIN SELECT RAISE(ABORT, 'audit is append-only'); END",
    ),
    "postgresql": (
        """CREATE FUNCTION audit_append_only() RETURNS trigger AS
        $$ BEGIN RAISE EXCEPTION 'audit is append-only'; END $$ LANGUAGE plpgsql""",
        """CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON audit
        FOR EACH STATEMENT EXECUTE FUNCTION audit_append_only()""",
    ),
}


def has_schema(connection: Connection) -> bool:
    """Whether a database holds a store of any schema."""
    return bool(inspect(connection).has_table(store_table.name))


def require_schema(connection: Connection, name: str) -> None:
    """Raise `RecordsError` for a store whose schema is another than that of this release."""
    schema, version = SCHEMA
    stored = connection.execute(select(store_table.c.value).where(store_table.c.name == schema)).scalar()
    if stored != version:
        raise RecordsError(
            f"{name} must have schema {version}; it has {'none' if stored is None else repr(stored)[:60]} (was it "
            "written by another release of tsis? then export its targets as bundles there, and import them here)"
        )


def create_schema(connection: Connection) -> None:
    """Make the tables, and the triggers by which the audit is append-only, within the transaction of ``connection``."""
    metadata.create_all(connection, checkfirst=False)
    for statement in _APPEND_ONLY[connection.dialect.name]:
        connection.execute(text(statement))


def schema_faults(connection: Connection) -> Iterator[str]:
    """A message for each table, column, index or trigger that is missing, changed or added."""
    if connection.dialect.name == "sqlite":
        for (message,) in connection.execute(text("PRAGMA integrity_check(10)")):  # a damaged index hides rows
            if message != "ok":
                yield f"the database file is damaged: {one_line(message)}"
        yield from _differences(_created_in_sqlite(), _sqlite_schema(connection))
    else:
        yield from _differences(_requested_in_postgresql(connection), _postgresql_schema(connection))
        yield from _postgresql_trigger_faults(connection)
        yield from _postgresql_rule_faults(connection)


def _differences(requested: dict[tuple[str, str], str], present: dict[tuple[str, str], str]) -> Iterator[str]:
    for kind, name in sorted(requested.keys() | present.keys()):
        what = f"{kind} {one_line(name, 80)} of the database"
        if (kind, name) not in present:
            yield f"the {what} was taken out"
        elif (kind, name) not in requested:
            yield f"the {what} was put in"
        elif present[kind, name] != requested[kind, name]:
            yield f"the {what} is not as it was made"


@cache
def _created_in_sqlite() -> dict[tuple[str, str], str]:
    engine = create_engine("sqlite://")
    try:
        with engine.connect() as connection, connection.begin():
            create_schema(connection)
            return _sqlite_schema(connection)
    finally:
        engine.dispose()


def _sqlite_schema(connection: Connection) -> dict[tuple[str, str], str]:
    listed = connection.execute(text("SELECT type, name, sql FROM sqlite_master"))
    return {
        (str(row.type), str(row.name)): " ".join(str(row.sql).split())
        for row in listed
        if not str(row.name).startswith("sqlite_")
    }


def _requested_in_postgresql(connection: Connection) -> dict[tuple[str, str], str]:
    """What `_postgresql_schema` gives for tables as they were made."""
    definitions: dict[tuple[str, str], str] = {}
    for name, table in metadata.tables.items():
        definitions["table", name] = str([column.name for column in table.primary_key])
        for column in table.columns:
            kind = column.type.compile(connection.dialect)
            definitions["column", f"{name}.{column.name}"] = f"{kind}{'' if column.nullable else ' NOT NULL'}"
        for key in table.foreign_keys:
            definitions["foreign key", f"{name}.{key.parent.name}"] = key.target_fullname
        for index in table.indexes:
            definitions["index", str(index.name)] = str([name, *(column.name for column in index.columns)])
        for constraint in table.constraints:
            if isinstance(constraint, UniqueConstraint):
                definitions["unique column", f"{name}.{', '.join(column.name for column in constraint.columns)}"] = ""
    return definitions


def _postgresql_schema(connection: Connection) -> dict[tuple[str, str], str]:
    """The definition of each part of the store's tables, by kind and name; other tables may be in the database."""
    inspector, definitions = inspect(connection), dict[tuple[str, str], str]()
    for name in set(inspector.get_table_names()) & set(metadata.tables):
        definitions["table", name] = str(inspector.get_pk_constraint(name)["constrained_columns"])
        for column in inspector.get_columns(name):
            kind = column["type"].compile(connection.dialect)
            definitions["column", f"{name}.{column['name']}"] = f"{kind}{'' if column['nullable'] else ' NOT NULL'}"
        for key in inspector.get_foreign_keys(name):
            cited = ", ".join(f"{key['referred_table']}.{column}" for column in key["referred_columns"])
            definitions["foreign key", f"{name}.{', '.join(key['constrained_columns'])}"] = cited
        for index in inspector.get_indexes(name):
            if not index.get("duplicates_constraint"):
                unique = ["unique"] if index["unique"] else []
                definitions["index", str(index["name"])] = str([name, *index["column_names"], *unique])
        for constraint in inspector.get_unique_constraints(name):
            definitions["unique column", f"{name}.{', '.join(constraint['column_names'])}"] = ""
    return definitions


def _postgresql_rule_faults(connection: Connection) -> Iterator[str]:
    listed = connection.execute(text("SELECT tablename, rulename FROM pg_rules WHERE schemaname = current_schema()"))
    for row in listed:
        if row.tablename in metadata.tables:
            yield f"the rule {one_line(row.rulename, 80)} of the table {row.tablename} was put in"


_BEFORE_UPDATE_DELETE_TRUNCATE = 2 + 8 + 16 + 32  # bits of tgtype of a statement trigger
_EVER = ("O", "A")  # values of tgenabled: active in an ordinary session


def _postgresql_trigger_faults(connection: Connection) -> Iterator[str]:
    query = """SELECT relname, tgname, tgenabled, tgtype, prosrc FROM pg_trigger JOIN pg_class ON pg_class.oid = tgrelid
        JOIN pg_proc ON pg_proc.oid = tgfoid WHERE NOT tgisinternal AND relnamespace = current_schema()::regnamespace"""
    sound = False
    for row in connection.execute(text(query)):
        if (row.relname, row.tgname) == ("audit", "audit_append_only"):
            enabled = row.tgenabled.decode() if isinstance(row.tgenabled, bytes) else row.tgenabled
            sound = (
                enabled in _EVER
                and row.tgtype == _BEFORE_UPDATE_DELETE_TRUNCATE
                and " ".join(row.prosrc.split()) == "BEGIN RAISE EXCEPTION 'audit is append-only'; END"
            )
        elif row.relname in metadata.tables:
            yield f"the trigger {one_line(row.tgname, 80)} of the table {row.relname} was put in"
    if not sound:
        yield "the trigger by which the audit is append-only was taken out, changed or switched off"
