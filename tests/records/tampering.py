"""Stores to tamper with, who does it behind the program's back, and what `tsis.records.store.verify_store` says.

The forger uses nothing of the program: the chain is computed here anew from what the documentation says of it.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import sqlite3
import subprocess
import sys
import threading
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
from tests.present.test_lump_map import map_of
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    import random
    from collections.abc import Callable, Iterator, Mapping
    from pathlib import Path

    from tsis.records.store import Store


MOST_TRIES = 100


@dataclass(frozen=True, slots=True)
class Judgement:
    """How a tampering showed: in faults, in a refusal to open or read, not at all, or in another error."""

    faults: tuple[str, ...] = ()
    refusal: str = ""
    error: str = ""

    @property
    def found(self) -> bool:
        return bool(self.faults or self.refusal)


def make_stores(folder: Path) -> Stores:
    """An honest store with all kinds of records, an earlier copy, and another."""
    stores = Stores(folder / "store", folder / "earlier", folder / "other")
    with open_store(stores.store, actor="me") as store:
        fill(store, 0, targets=2)
    shutil.copytree(stores.store, stores.earlier)
    with open_store(stores.store, actor="me") as store:
        fill(store, 10, targets=1)
    with open_store(stores.other, actor="somebody else") as store:
        fill(store, 20, targets=3)
    return stores


def fill(store: Store, seed: int, *, targets: int = 1) -> None:
    """Add targets with presses, an estimate and a map each, and change some of it."""
    for number in range(seed, seed + targets):
        target = store.add_target(name=f"size {number}", truth={"diameter_mm": 8.0 + 0.01 * number})
        known = replace(sample_calibration(), name=f"bench {number}")
        presses = []
        for at in range(4):
            image = TactileImage(
                grey=levels(100 * number + at)[40:56, 60:80],
                full_scale=255.0,
                force_n=0.1 + at,
                mm_per_pixel=(0.1, 0.1) if at else None,
                settings={"exposure_ms": 1.0 + at},
                name=f"{at}.png",
            )
            taken = WHEN + timedelta(seconds=at + 60 * number)
            flags = ("moving",) if at == 1 else ()
            presses.append(store.add_press(target, image, taken=taken, calibration=known, flags=flags))
        made = sample_estimate()
        samples = {name: np.asarray(values)[:20] + number for name, values in made.samples.items()}
        found = replace(made, untrusted=replace(made.untrusted, samples=samples))
        store.add_estimate(target, found, kind="inclusion", presses=presses, probe="tsis-2011", calibration=known)
        store.add_map(target, map_of(number), presses=presses, probe="tsis-2011", calibration=known)
        store.edit_target(target, note="edited")
        store.edit_press(presses[0], force_n=0.5)


def tampered(
    template: Stores, folder: Path, kind: Callable[[Stores, random.Random], None], rng: random.Random
) -> Stores:
    """A copy of the stores with one tampering that changed something."""
    for _ in range(MOST_TRIES):
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(template.store, folder)
        stores = replace(template, store=folder)
        try:
            kind(stores, rng)
        except UnchangedError:
            continue
        return stores
    raise AssertionError(f"{kind.__name__} changed nothing in {MOST_TRIES} tries")


def judged(folder: Path) -> Judgement:
    """What opening and verifying say of a store."""
    try:
        return _opened(folder, "phantom")
    except RecordsError as error:
        refusal = str(error)
    except Exception as error:  # every kind: this is what must not happen
        return Judgement(error=f"{type(error).__name__}: {error}")
    if "it is one of subjects" not in refusal:
        return Judgement(refusal=refusal)
    return _opened(folder, "subject")


def _opened(folder: Path, kind: str) -> Judgement:
    with open_store(folder, kind=kind, create=False) as store:
        return Judgement(faults=verify_store(store).faults)


KEYS = {"store": "name", **dict.fromkeys(("targets", "calibrations", "frames", "presses", "estimates", "maps"), "id")}
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


def an_entry_changed(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        entry = forger.entry()
        name = rng.choice(list(entry))
        forger.change("audit", "number", entry["number"], {name: other_value(entry[name], rng)})


def an_entry_of_another_type(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        entry = forger.entry()
        name = rng.choice([name for name in entry if name != "number"])
        forger.change("audit", "number", entry["number"], {name: rng.choice([b"\xff", b"", "", b"\x00"])})


def an_entry_out(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        forger.delete("audit", "number", forger.entry()["number"])


def an_entry_in(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        entries = forger.rows("audit")
        at = rng.randrange(len(entries) + 1)
        new = {**rng.choice(entries), "number": at + 1}
        forger.connection.execute("DELETE FROM audit")
        for number, entry in enumerate([*entries[:at], new, *entries[at:]], start=1):
            forger.insert("audit", {**entry, "number": number})


def entries_reordered(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        one, two = rng.sample(forger.rows("audit"), 2)
        for kept, put in ((one, two), (two, one)):
            forger.change("audit", "number", kept["number"], {**put, "number": kept["number"]})


def entries_renumbered(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        out = forger.entry()["number"]
        forger.delete("audit", "number", out)
        last = forger.rows("audit")[-1]["number"]
        for number in range(out + 1, last + 1):
            forger.connection.execute("UPDATE audit SET number = ? WHERE number = ?", (number - 1, number))
        if rng.random() < 0.5:
            forger.connection.execute("UPDATE audit_head SET number = ?", (last - 1,))


def the_history_rewritten(stores: Stores, rng: random.Random) -> None:
    """A row, its entry, all hashes after it and the head: nothing in the database contradicts anything."""
    with forging(stores.store, rng) as forger:
        table, row = forger.some_row()
        key, kept = KEYS[table], {"store": ("name", "value")}.get(table, (KEYS[table], "frame", "file", "samples"))
        name = rng.choice([name for name in row if name not in kept] or ["value"])
        forger.change(table, key, row[key], {name: other_value(row[name], rng)})
        (new,) = [each for each in forger.rows(table) if each[key] == row[key]]
        entries = forger.rows("audit")
        (*_, last) = [each for each in entries if (each["kind"], each["row"]) == (table, row[key])]
        last["content"] = digest(new)
        forger.rechain(entries)


def an_entry_rewritten(stores: Stores, rng: random.Random) -> None:
    """Who or when, and all hashes after it."""
    with forging(stores.store, rng) as forger:
        entries = forger.rows("audit")
        entry = rng.choice(entries)
        name = rng.choice(["actor", "moment", "action"])
        entry[name] = other_value(entry[name], rng)
        forger.rechain(entries)


def the_end_cut_off(stores: Stores, rng: random.Random) -> None:
    """The last entries, what they entered, and the head."""
    with forging(stores.store, rng) as forger:
        entries = forger.rows("audit")
        left = entries[: -rng.randint(1, 6)]
        cut = entries[len(left) :]
        before = {(each["kind"], each["row"]) for each in left}
        for entry in reversed(cut):
            if (entry["kind"], entry["row"]) not in before:
                forger.delete(entry["kind"], KEYS[entry["kind"]], entry["row"])
        forger.rechain(left)


def the_head_changed(stores: Stores, rng: random.Random) -> None:
    with forging(stores.store, rng) as forger:
        (head,) = forger.rows("audit_head")
        kind = rng.randrange(4)
        if kind == 0:
            forger.connection.execute("DELETE FROM audit_head")
        elif kind == 1:
            forger.insert("audit_head", {**head, "id": 0})
        else:
            name = "number" if kind == 2 else "hash"
            forger.change("audit_head", "id", 1, {name: rng.choice([other_value(head[name], rng), b"\xff"])})


KINDS: dict[str, Callable[[Stores, random.Random], None]] = {
    "a value of any row changed": a_value,
    "a value of another type": a_value_of_another_type,
    "bytes that are no text": bytes_that_are_no_text,
    "a row deleted": a_row_out,
    "a row put in": a_row_in,
    "two rows swapped": rows_swapped,
    "an audit entry changed": an_entry_changed,
    "an audit entry of another type": an_entry_of_another_type,
    "an audit entry deleted": an_entry_out,
    "an audit entry put in": an_entry_in,
    "audit entries swapped": entries_reordered,
    "audit entries renumbered": entries_renumbered,
    "a row, its entry and all later hashes": the_history_rewritten,
    "who or when, and all later hashes": an_entry_rewritten,
    "the audit's end cut off with its rows": the_end_cut_off,
    "the audit's head changed": the_head_changed,
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


def empty(folder: Path, _rng: random.Random) -> None:
    open_store(folder).close()


def edited(folder: Path, rng: random.Random) -> None:
    with open_store(folder, actor="ñ") as store:
        fill(store, rng.randrange(100), targets=rng.randint(1, 3))


def two_writers(folder: Path, rng: random.Random) -> None:
    """Who verifies meanwhile sees no fault either."""
    open_store(folder).close()
    seed = rng.randrange(100)
    faults: list[str] = []

    def work(of: int) -> None:
        with open_store(folder) as store:
            fill(store, of)

    writers = [threading.Thread(target=work, args=(seed + 200 * at,)) for at in range(2)]
    for writer in writers:
        writer.start()
    with open_store(folder) as store:
        while any(writer.is_alive() for writer in writers):
            faults += verify_store(store).faults
    if faults:
        raise AssertionError(f"a store that was written to meanwhile had the faults {faults}")


def killed_writer(folder: Path, rng: random.Random) -> None:
    """One that was killed in the midst of a save."""
    command = [sys.executable, "-m", "tests.records.writer", str(folder), "-", str(rng.randrange(100)), "100000"]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
        assert writer.stdout is not None
        for _ in range(rng.randint(1, 30)):
            writer.stdout.readline()
        writer.kill()


def killed_before_the_anchor(folder: Path, rng: random.Random) -> None:
    """One that was killed between row and anchor; another went on."""
    with open_store(folder) as store:
        fill(store, 1)
        shutil.copy(folder / "audit-anchor.json", folder / "lagging")
        store.add_target()
        (folder / "lagging").replace(folder / "audit-anchor.json")
    if rng.random() < 0.5:
        with open_store(folder) as store:
            fill(store, 2)


def refused_writes(folder: Path, rng: random.Random) -> None:
    """Some of what was asked of it could not be done."""
    with open_store(folder) as store:
        fill(store, rng.randrange(100))
        target = store.target(1)
        for changes in ({"name": "late"}, {"name": "too late"}):
            try:
                store.edit_target(target, **changes)
            except RecordsError:
                continue


HONEST: dict[str, Callable[[Path, random.Random], None]] = {
    "empty": empty,
    "filled and edited": edited,
    "two writers, verified meanwhile": two_writers,
    "a writer killed in a save": killed_writer,
    "killed before the anchor": killed_before_the_anchor,
    "refused edits": refused_writes,
}
