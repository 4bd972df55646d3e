"""Kinds of tampering with a store: functions of stores and of chance, each of which changes something for certain."""

from __future__ import annotations

import json
import shutil
import sqlite3
from contextlib import closing
from typing import TYPE_CHECKING

from tests.records import audit_tamperings as audit
from tests.records.forger import KEYS, UnchangedError, forging, other_value

if TYPE_CHECKING:
    import random
    from collections.abc import Callable
    from pathlib import Path

    from tests.records.forger import Stores


def a_value(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        name = rng.choice(list(row))
        forger.change(table, KEYS[table], row[KEYS[table]], {name: other_value(row[name], rng)})


def a_value_of_another_type(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        name = rng.choice(list(row))
        alien = rng.choice([b"\xff\x00", b"", "text", None, float("inf"), float("-inf"), 2**62, "\ufffd\x00"])
        forger.change(table, KEYS[table], row[KEYS[table]], {name: alien})


def bytes_that_are_no_text(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        name = rng.choice([name for name, value in row.items() if isinstance(value, str)])
        forger.connection.execute(
            f'UPDATE {table} SET "{name}" = CAST(? AS TEXT) WHERE "{KEYS[table]}" = ?',
            (b"\xff\xfe" + rng.randbytes(3), row[KEYS[table]]),
        )


def a_row_out(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        forger.delete(table, KEYS[table], row[KEYS[table]])


def a_row_in(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        new: dict[str, object] = {KEYS[table]: rng.randbytes(16).hex()}
        if table == "targets":
            new["number"] = rng.randint(100, 999)
        forger.insert(table, row | new)


def rows_swapped(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        table = rng.choice([table for table in KEYS if len(forger.rows(table)) > 1])
        key = KEYS[table]
        one, two = rng.sample(forger.rows(table), 2)
        parked = {name: value for name, value in one.items() if name not in (key, "number")}
        swapped = {name: value for name, value in two.items() if name not in (key, "number")}
        forger.change(table, key, one[key], swapped)
        forger.change(table, key, two[key], parked)


def the_kind_of_store(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        forger.change("store", "name", "kind", {"value": "subject"})
        if rng.random() < 0.5:
            forger.connection.execute("UPDATE targets SET kind = 'subject', truth = '{}'")


def the_terms_of_the_store(stores: Stores, rng: random.Random) -> None:
    """What the store says of itself: none of it is left, or one thing less."""
    with forging(stores.store, rng) as forger:
        if rng.random() < 0.5:
            forger.delete("store", "name", rng.choice(forger.rows("store"))["name"])
            return
        forger.connection.execute("DELETE FROM store")
        if rng.random() < 0.5:
            forger.connection.execute("DELETE FROM audit_head")


def the_schema(stores: Stores, rng: random.Random) -> None:
    statements = [
        "DROP TRIGGER audit_no_update",
        "DROP TRIGGER audit_no_delete",
        "DROP INDEX presses_of_a_target",
        "DROP INDEX estimates_of_a_target",
        "DROP TABLE audit",
        "DROP TABLE estimates",
        "ALTER TABLE presses DROP COLUMN note",
        "ALTER TABLE presses ADD COLUMN more TEXT",
        "ALTER TABLE presses RENAME COLUMN role TO rôle",
        "ALTER TABLE targets RENAME TO targets_2",
        "CREATE TABLE more (x)",
        "CREATE VIEW more AS SELECT * FROM targets",
        "CREATE TRIGGER more AFTER INSERT ON presses BEGIN DELETE FROM presses; END",
        "UPDATE store SET value = '2' WHERE name = 'schema'",
        "UPDATE store SET value = x'ff' WHERE name = 'schema'",
        "DELETE FROM store WHERE name = 'schema'",
        "INSERT INTO store VALUES ('schemas', '1')",
        "DROP TABLE store",
    ]
    with closing(sqlite3.connect(stores.store / "records.sqlite3", isolation_level=None)) as connection:
        connection.execute("PRAGMA foreign_keys=OFF")
        connection.execute(rng.choice(statements))


def bytes_of_the_database(stores: Stores, rng: random.Random) -> None:
    """Damage in the file itself, where SQLite keeps something."""
    file = stores.store / "records.sqlite3"
    content, before = bytearray(file.read_bytes()), _all_rows(file)
    at = rng.choice([at for at, byte in enumerate(content) if byte and at > 4096])  # behind the first page
    content[at : at + 16] = rng.randbytes(16)
    file.write_bytes(content)
    if _all_rows(file) == before:
        raise UnchangedError  # bytes that nothing uses any more


def _all_rows(file: Path) -> list[str] | None:
    """What can be read of every table and index; None where something cannot."""
    with closing(sqlite3.connect(file)) as connection:
        try:
            return [*connection.iterdump(), *map(str, connection.execute("PRAGMA integrity_check"))]
        except (sqlite3.Error, ValueError):
            return None


def a_file_changed(stores: Stores, rng: random.Random) -> None:
    path = rng.choice(stores.files())
    content = bytearray(path.read_bytes())
    at = rng.randrange(len(content))
    kind = rng.randrange(3)
    if kind == 0:
        content[at] ^= rng.randint(1, 255)
    elif kind == 1:
        del content[at:]
    else:
        content += b"\0"
    path.write_bytes(content)


def a_file_out(stores: Stores, rng: random.Random) -> None:
    path = rng.choice(stores.files())
    path.unlink()
    if rng.random() < 0.2:
        path.mkdir()


def files_swapped(stores: Stores, rng: random.Random) -> None:
    ending = rng.choice([".png", ".json", ".samples"])
    one, two = rng.sample([path for path in stores.files() if path.suffix == ending], 2)
    first, second = one.read_bytes(), two.read_bytes()
    one.write_bytes(second)
    two.write_bytes(first)


def an_older_database(stores: Stores, _rng: random.Random) -> None:
    _put_database(stores.earlier, stores.store)


def the_database_of_another(stores: Stores, _rng: random.Random) -> None:
    _put_database(stores.other, stores.store)


def the_files_of_another(stores: Stores, rng: random.Random) -> None:
    shutil.rmtree(stores.store / "files")
    shutil.copytree(stores.other / "files", stores.store / "files")
    if rng.random() < 0.5:
        shutil.copy(stores.other / "audit-anchor.json", stores.store)


def the_anchor(stores: Stores, rng: random.Random) -> None:
    path = stores.store / "audit-anchor.json"
    document = json.loads(path.read_text())
    kind = rng.randrange(7)
    if kind == 0:
        path.unlink()
    elif kind == 6:
        path.write_text("{}")
    elif kind == 1:
        shutil.copy(stores.other / path.name, path)
    elif kind == 2:
        path.write_bytes(rng.randbytes(50))
    else:
        name = ("number", "hash", "store")[kind - 3]
        document[name] = other_value(document[name], rng)
        path.write_text(json.dumps(document))


def _put_database(of: Path, into: Path) -> None:
    for each in into.glob("records.sqlite3*"):
        each.unlink()
    shutil.copy(of / "records.sqlite3", into)


KINDS: dict[str, Callable[[Stores, random.Random], None]] = {
    "a value of any row changed": a_value,
    "a value of another type": a_value_of_another_type,
    "bytes that are no text": bytes_that_are_no_text,
    "a row deleted": a_row_out,
    "a row put in": a_row_in,
    "two rows swapped": rows_swapped,
    "an audit entry changed": audit.an_entry_changed,
    "an audit entry of another type": audit.an_entry_of_another_type,
    "an audit entry deleted": audit.an_entry_out,
    "an audit entry put in": audit.an_entry_in,
    "audit entries swapped": audit.entries_reordered,
    "audit entries renumbered": audit.entries_renumbered,
    "a row, its entry and all later hashes": audit.the_history_rewritten,
    "who or when, and all later hashes": audit.an_entry_rewritten,
    "the audit's end cut off with its rows": audit.the_end_cut_off,
    "the audit's head changed": audit.the_head_changed,
    "the kind of the store changed": the_kind_of_store,
    "what the store says of itself taken out": the_terms_of_the_store,
    "the schema changed": the_schema,
    "bytes of the database file": bytes_of_the_database,
    "a file changed": a_file_changed,
    "a file deleted": a_file_out,
    "two files swapped": files_swapped,
    "the database put back to an older copy": an_older_database,
    "the database of another store": the_database_of_another,
    "the files of another store": the_files_of_another,
    "the anchor changed or deleted": the_anchor,
}
