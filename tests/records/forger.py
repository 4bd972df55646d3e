"""Somebody who changes a store behind the program's back, with SQLite and files alone, and knows how the audit is made.

Nothing of the program is used: the chain is computed here anew from what the documentation says of it.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from contextlib import closing, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import random
    from collections.abc import Iterator, Mapping
    from pathlib import Path

KEYS = {"store": "name", "targets": "id", "calibrations": "id", "frames": "id", "presses": "id", "estimates": "id"}
FIRST = "0" * 64


@dataclass(frozen=True, slots=True)
class Stores:
    """A store to tamper with, an earlier copy of it, and another store of the same kind."""

    store: Path
    earlier: Path
    other: Path

    def files(self) -> list[Path]:
        """Frames, calibrations and samples of the store."""
        return sorted((self.store / "files").glob("*/*"))


class Forger:
    """A connection that no trigger stops: they are taken away first and put back as they were."""

    def __init__(self, connection: sqlite3.Connection, rng: random.Random) -> None:
        self.connection, self.rng = connection, rng

    def rows(self, table: str) -> list[dict[str, Any]]:
        """Every row in the order of its key."""
        cursor = self.connection.execute(f"SELECT * FROM {table} ORDER BY 1")
        return [dict(zip([each[0] for each in cursor.description], row, strict=True)) for row in cursor]

    def some_row(self) -> tuple[str, dict[str, Any]]:
        """Any row of any recorded table."""
        table = self.rng.choice(list(KEYS))
        return table, self.rng.choice(self.rows(table))

    def entry(self) -> dict[str, Any]:
        """Any entry of the audit."""
        return self.rng.choice(self.rows("audit"))

    def change(self, table: str, key: str, of: Any, values: Mapping[str, Any]) -> None:
        """Set columns of a row; `UnchangedError` when they hold the same afterwards."""
        before = self.rows(table)
        assigned = ", ".join(f'"{name}" = ?' for name in values)
        self.connection.execute(f'UPDATE {table} SET {assigned} WHERE "{key}" = ?', (*values.values(), of))
        if [repr(row) for row in self.rows(table)] == [repr(row) for row in before]:
            raise UnchangedError

    def delete(self, table: str, key: str, of: Any) -> None:
        self.connection.execute(f'DELETE FROM {table} WHERE "{key}" = ?', (of,))

    def insert(self, table: str, row: Mapping[str, Any]) -> None:
        names = ", ".join(f'"{name}"' for name in row)
        marks = ", ".join("?" * len(row))
        self.connection.execute(f"INSERT INTO {table} ({names}) VALUES ({marks})", tuple(row.values()))

    def rechain(self, entries: list[dict[str, Any]], *, head: bool = True) -> None:
        """Write the whole audit anew, with numbers and hashes that follow one another, and its head."""
        self.connection.execute("DELETE FROM audit")
        before = FIRST
        for number, entry in enumerate(entries, start=1):
            linked = {**entry, "number": number, "previous": before}
            linked.pop("hash", None)
            before = digest(linked)
            self.insert("audit", {**linked, "hash": before})
        if head:
            self.connection.execute("UPDATE audit_head SET number = ?, hash = ?", (len(entries), before))


class UnchangedError(Exception):
    """The tampering left everything as it was, or the database refused it: another must be tried."""


@contextmanager
def forging(folder: Path, rng: random.Random) -> Iterator[Forger]:
    """Change the database of a store; triggers are back when the block ends, spelt as they were."""
    with closing(sqlite3.connect(folder / "records.sqlite3", isolation_level=None)) as connection:
        query = "SELECT name, sql FROM sqlite_master WHERE type = 'trigger'"
        triggers = connection.execute(query).fetchall()
        for name, _ in triggers:
            connection.execute(f"DROP TRIGGER {name}")
        try:
            yield Forger(connection, rng)
        except sqlite3.IntegrityError as error:
            raise UnchangedError from error
        for _, sql in triggers:
            connection.execute(sql)


def digest(values: Mapping[str, Any]) -> str:
    held = {name: value for name, value in values.items() if value is not None}
    text = json.dumps(held, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode()).hexdigest()


def other_value(value: Any, rng: random.Random) -> Any:
    """Something else of the same type."""
    if value is None:
        return rng.choice(["", "[]", "x", 1.5])
    if isinstance(value, int):
        return value + rng.choice([-1, 1, 1000])
    if isinstance(value, float):
        return rng.choice([value + 1e-9, value * (1 + 1e-15) + 1e-300, -value - 1.0, 0.0])
    if not value:
        return "x"
    at = rng.randrange(len(value))
    letter = "1" if value[at] != "1" else "2"
    return rng.choice([value[:at] + letter + value[at + 1 :], value[:at] + value[at + 1 :], value + " ", ""])
