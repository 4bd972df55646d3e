"""What was changed behind the program's back is found, and nothing is said of what was not."""

from __future__ import annotations

import itertools
import json
import random
import shutil
import sqlite3
import threading
from contextlib import closing
from typing import TYPE_CHECKING

import psycopg
import pytest
from tests.endurance import scaled
from tests.records.conftest import Place
from tests.records.tampering import (
    HONEST,
    KINDS,
    Judgement,
    Stores,
    fill,
    forging,
    judged,
    make_stores,
    other_value,
    tampered,
)

from tsis.errors import RecordsError, TsisError
from tsis.records.audit import has_entry
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from pathlib import Path

    from tests.records.postgres_server import Server

# What must be said, of the kinds that always show in the same way.
SAID = {
    "a row deleted": "this row was taken out",
    "a row put in": "this row was put in beside the audit",
    "an audit entry changed": "audit entr",
    "an audit entry deleted": "must follow entry",
    "a row, its entry and all later hashes": "the anchor tells",
    "who or when, and all later hashes": "the anchor tells",
    "the audit's end cut off with its rows": "the anchor tells",
    "the audit's head changed": "the audit must end at",
    "the kind of the store changed": "store kind: this row is not as it was stored",
    "a file changed": "its content does not match its name",
    "two files swapped": "its content does not match its name",
    "the database put back to an older copy": "the anchor tells",
    "the database of another store": "the folder of the store",
}


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Stores:
    return make_stores(tmp_path_factory.mktemp("stores"))


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_tampered_with_is_found(template: Stores, tmp_path: Path, kind: str) -> None:
    for trial in range(2):
        tampered(template, tmp_path / "trial", KINDS[kind], random.Random(f"{kind}-{trial}"))
        found = judged(tmp_path / "trial")
        assert found.error == ""
        assert found.found, f"trial {trial} was missed"
        said = [*found.faults, found.refusal]
        assert all("\n" not in sentence for sentence in said)
        if kind in SAID:
            assert any(SAID[kind] in sentence for sentence in said), said


@pytest.mark.parametrize("history", [name for name in HONEST if name != "a writer killed in a save"])
def test_nothing_is_said_of_an_honest_store(tmp_path: Path, history: str) -> None:
    HONEST[history](tmp_path / "store", random.Random(1))
    assert judged(tmp_path / "store") == Judgement()


@pytest.mark.slow
def test_hundreds_of_tamperings_are_found(template: Stores, tmp_path: Path) -> None:
    for trial, kind in zip(range(scaled(400)), itertools.cycle(KINDS), strict=False):
        tampered(template, tmp_path / "trial", KINDS[kind], random.Random(f"2-{trial}"))
        found = judged(tmp_path / "trial")
        assert found.found, (trial, kind)
        assert all("\n" not in said and len(said) < 1000 for said in (*found.faults, found.refusal)), found


@pytest.mark.slow
def test_dozens_of_honest_stores_are_not_suspected(tmp_path: Path) -> None:
    for number, name in zip(range(scaled(70)), itertools.cycle(HONEST), strict=False):
        HONEST[name](tmp_path / str(number), random.Random(f"2-{number}"))
        assert judged(tmp_path / str(number)) == Judgement(), name


@pytest.mark.parametrize("table", ["targets", "calibrations", "frames", "presses", "estimates", "maps"])
def test_every_column_is_watched(template: Stores, tmp_path: Path, table: str) -> None:
    shutil.copytree(template.store, tmp_path / "store")
    with forging(tmp_path / "store", random.Random(1)) as forger:
        first = forger.rows(table)[0]
    for name, value in first.items():
        other = value + 1000 if isinstance(value, int) else other_value(value, random.Random(2))
        with closing(sqlite3.connect(tmp_path / "store" / "records.sqlite3")) as connection, connection:
            change = f'UPDATE {table} SET "{name}" = ? WHERE rowid = (SELECT rowid FROM {table} WHERE id = ?)'
            connection.execute(change, (other, first["id"]))
        with open_store(tmp_path / "store") as store:
            assert any(table in fault for fault in verify_store(store).faults), name
        with closing(sqlite3.connect(tmp_path / "store" / "records.sqlite3")) as connection, connection:
            shown = first["id"] if name != "id" else other
            connection.execute(f'UPDATE {table} SET "{name}" = ? WHERE id = ?', (value, shown))
    assert judged(tmp_path / "store") == Judgement()


def test_nothing_is_added_to_an_audit_that_was_rewritten(template: Stores, tmp_path: Path) -> None:
    """Else the next anchor would vouch for what was forged."""
    stores = tampered(template, tmp_path / "trial", KINDS["a row, its entry and all later hashes"], random.Random(3))
    before = (stores.store / "audit-anchor.json").read_bytes()
    with open_store(stores.store) as store:
        with pytest.raises(RecordsError, match="it was cut off or rewritten"):
            store.add_target()
        assert not verify_store(store).sound
    assert (stores.store / "audit-anchor.json").read_bytes() == before


def test_a_folder_whose_database_was_lost_is_not_begun_anew(template: Stores, tmp_path: Path) -> None:
    shutil.copytree(template.store, tmp_path / "store")
    (tmp_path / "store" / "records.sqlite3").unlink()
    with pytest.raises(RecordsError, match="take the database from a backup"):
        open_store(tmp_path / "store")
    anchor = json.loads((tmp_path / "store" / "audit-anchor.json").read_text())
    assert anchor["number"] > 0


def test_the_head_that_was_written_down_shows_that_all_was_put_back(template: Stores, tmp_path: Path) -> None:
    """The whole folder, anchor and all, is the one thing that a store cannot know of itself."""
    shutil.copytree(template.store, tmp_path / "store")
    with open_store(tmp_path / "store") as store:
        written_down = verify_store(store).head
    shutil.rmtree(tmp_path / "store")
    shutil.copytree(template.earlier, tmp_path / "store")
    with open_store(tmp_path / "store") as store:
        found = verify_store(store)
        assert found.sound
        assert found.head.number < written_down.number
        with store.database.reading() as connection:
            assert not has_entry(connection, written_down)


def test_a_lost_anchor_leaves_a_trace(template: Stores, tmp_path: Path) -> None:
    """Once somebody went on without it, the new anchor vouches for what it cannot know."""
    folder = tmp_path / "store"
    shutil.copytree(template.store, folder)
    (folder / "audit-anchor.json").unlink()
    with open_store(folder, actor="me") as store:
        lost = verify_store(store)
        assert not lost.sound
        store.add_target()
        store.add_target()
        found = verify_store(store)
        assert found.sound
        assert found.head.number == lost.head.number + 3  # two targets, and once that it was missing
        (note,) = found.notes
        assert note.startswith(f"audit entry {lost.head.number + 1} tells that the anchor was missing when me went on")
        assert found.unanchored == 0


@pytest.mark.parametrize("content", ["{}", "", "[]", '{"store":1,"number":1,"hash":"x"}', "{" * 100_000])
def test_a_damaged_anchor_is_told_and_nothing_is_added(template: Stores, tmp_path: Path, content: str) -> None:
    folder = tmp_path / "store"
    shutil.copytree(template.store, folder)
    (folder / "audit-anchor.json").write_text(content)
    with open_store(folder, create=False) as store:
        assert any("the anchor of the audit" in fault for fault in verify_store(store).faults)
        assert store.targets()
        before = len(store.targets())
        with pytest.raises(RecordsError, match=r"must be there and whole.*move it away") as caught:
            store.add_target()
        assert "\n" not in str(caught.value)
        assert len(store.targets()) == before
        (folder / "audit-anchor.json").unlink()
        store.add_target()
        assert verify_store(store).sound
        assert len(verify_store(store).notes) == 1


def test_without_the_audits_head_nothing_is_added(template: Stores, tmp_path: Path) -> None:
    shutil.copytree(template.store, tmp_path / "store")
    with forging(tmp_path / "store", random.Random(1)) as forger:
        forger.connection.execute("DELETE FROM audit_head")
    with open_store(tmp_path / "store") as store:
        with pytest.raises(RecordsError, match=r"which entry of the audit is the last.*tsis records verify"):
            store.add_target()
        assert any("the audit must end at" in fault for fault in verify_store(store).faults)


@pytest.mark.parametrize("also", [(), ("DELETE FROM audit_head",)])
def test_a_store_that_says_nothing_of_itself_is_refused(
    template: Stores, tmp_path: Path, also: tuple[str, ...]
) -> None:
    shutil.copytree(template.store, tmp_path / "store")
    with forging(tmp_path / "store", random.Random(1)) as forger:
        for statement in ("DELETE FROM store", *also):
            forger.connection.execute(statement)
    with pytest.raises(RecordsError, match=r"must say what store it is; got \{\} \(take it from a backup\)"):
        open_store(tmp_path / "store")


def test_an_edit_does_not_vouch_for_what_was_tampered_with(template: Stores, tmp_path: Path) -> None:
    shutil.copytree(template.store, tmp_path / "store")
    with closing(sqlite3.connect(tmp_path / "store" / "records.sqlite3")) as connection, connection:
        connection.execute("UPDATE presses SET force_n = 0.25")
    with open_store(tmp_path / "store") as store:
        (press, *_) = store.presses(store.target(1))
        with pytest.raises(RecordsError, match="changed behind the program's back"):
            store.edit_press(press, note="x")
        assert any(press.id in fault for fault in verify_store(store).faults)


def test_the_hashes_are_what_the_documentation_says(template: Stores, tmp_path: Path) -> None:
    """A chain that another program writes anew from the same entries ends in the same hash."""
    shutil.copytree(template.store, tmp_path / "store")
    with open_store(tmp_path / "store") as store:
        head = verify_store(store).head
    with forging(tmp_path / "store", random.Random(1)) as forger:
        forger.rechain(forger.rows("audit"))
    with open_store(tmp_path / "store") as store:
        found = verify_store(store)
    assert found.sound
    assert found.head == head


@pytest.mark.parametrize("statement", ["UPDATE audit SET actor = 'x'", "DELETE FROM audit"])
def test_the_audit_is_append_only(template: Stores, tmp_path: Path, statement: str) -> None:
    shutil.copytree(template.store, tmp_path / "store")
    with (
        closing(sqlite3.connect(tmp_path / "store" / "records.sqlite3")) as connection,
        pytest.raises(sqlite3.IntegrityError, match="append-only"),
    ):
        connection.execute(statement)


@pytest.mark.parametrize("kind", ["a value of another type", "bytes that are no text", "the schema changed"])
def test_garbage_is_one_sentence_wherever_it_is_read(template: Stores, tmp_path: Path, kind: str) -> None:
    sentences = []
    for trial in range(12):
        tampered(template, tmp_path / "trial", KINDS[kind], random.Random(f"read-{trial}"))
        try:
            with open_store(tmp_path / "trial") as store:
                for summary in store.targets():
                    target_record = store.record(summary.target)
                    for press in target_record.presses:
                        target_record.image(press)
                store.edit_target(store.target(1), note="x")
                store.add_target()
        except TsisError as error:
            sentences.append(str(error))
    assert sentences
    assert not any("\n" in sentence for sentence in sentences)


def test_who_verifies_while_another_writes_sees_one_state(tmp_path: Path) -> None:
    open_store(tmp_path).close()
    done = threading.Event()

    def write() -> None:
        with open_store(tmp_path) as writing:
            for _ in range(60):
                writing.add_target()
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    heads = []
    with open_store(tmp_path) as store:
        while not done.is_set():
            found = verify_store(store)
            assert found.faults == ()
            heads.append(found.head.number)
    writer.join()
    assert heads == sorted(heads)


@pytest.mark.system
@pytest.mark.parametrize(
    ("statements", "said"),
    [
        (["UPDATE presses SET force_n = 'NaN'"], "is not as it was stored"),
        (["UPDATE presses SET force_n = 'Infinity'"], "is not as it was stored"),
        (["UPDATE targets SET name = 'x'"], "is not as it was stored"),
        (["ALTER TABLE presses DROP COLUMN note"], "note"),
        (["ALTER TABLE presses ALTER COLUMN role DROP NOT NULL"], "role"),
        (["DROP INDEX presses_of_a_target"], "presses_of_a_target"),
        (["DROP TRIGGER audit_append_only ON audit"], "append-only"),
        (["ALTER TABLE audit DISABLE TRIGGER ALL"], "append-only"),
        (
            [
                "CREATE OR REPLACE FUNCTION audit_append_only() RETURNS trigger AS "
                "$$ BEGIN RETURN NULL; END $$ LANGUAGE plpgsql"
            ],
            "append-only",
        ),
        (["CREATE RULE lost AS ON INSERT TO presses DO INSTEAD NOTHING"], "rule lost"),
        (["DELETE FROM audit_head"], "the audit must end at"),
        (["ALTER TABLE audit DISABLE TRIGGER ALL", "DELETE FROM audit WHERE number = 5"], "must follow entry 4"),
        (["DROP TABLE audit"], "audit"),
        (["UPDATE store SET value = '9' WHERE name = 'schema'"], "must have schema 1; it has '9'"),
    ],
)
def test_tampering_in_postgresql_is_found(tmp_path: Path, postgres: Server, statements: list[str], said: str) -> None:
    place = Place(tmp_path / "store", postgres.new_database())
    assert place.database is not None
    with place.open() as store:
        fill(store, 1)
        assert verify_store(store).sound
    with psycopg.connect(place.database, autocommit=True) as other:
        for statement in statements:
            other.execute(statement)
    try:
        with place.open(create=False) as store:
            sentences = verify_store(store).faults
    except RecordsError as error:
        sentences = (str(error),)
    assert any(said in sentence for sentence in sentences), sentences
    assert all("\n" not in sentence for sentence in sentences)
