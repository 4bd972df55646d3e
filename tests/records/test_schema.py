"""A store has one schema, made whole or not at all; one of another schema is refused and left alone."""

from __future__ import annotations

import hashlib
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from typing import TYPE_CHECKING

import pytest
from tests.records.conftest import Place
from tests.records.tampering import fill

from tsis.errors import RecordsError
from tsis.records import schema
from tsis.records.store import verify_store

if TYPE_CHECKING:
    from pathlib import Path

STATEMENTS = len(schema.metadata.tables) + sum(len(table.indexes) for table in schema.metadata.tables.values()) + 2
KILLED = """
import os, signal, sys
from sqlalchemy import event
from sqlalchemy.engine import Engine
from tsis.records.store import open_store
left = int(sys.argv[2])
@event.listens_for(Engine, "before_cursor_execute")
def counted(connection, cursor, statement, *_):
    global left
    if statement.lstrip().startswith("CREATE"):
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        left -= 1
open_store(sys.argv[1])
"""


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE store SET value = '2' WHERE name = 'schema'",
        "UPDATE store SET value = '' WHERE name = 'schema'",
        "UPDATE store SET value = '1''; DROP TABLE audit; --' WHERE name = 'schema'",
        "DELETE FROM store WHERE name = 'schema'",
    ],
)
@pytest.mark.parametrize("create", [True, False])
def test_a_store_of_another_schema_is_refused_and_left_alone(tmp_path: Path, statement: str, create: bool) -> None:
    place, file = Place(tmp_path / "store"), tmp_path / "store" / "records.sqlite3"
    with place.open() as store:
        fill(store, 1)
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(statement)
    before = hashlib.sha256(file.read_bytes()).hexdigest()
    with pytest.raises(
        RecordsError, match=r"must have schema 1; it has .* \(was it written by another release"
    ) as caught:
        place.open(create=create)
    assert "\n" not in str(caught.value)
    assert hashlib.sha256(file.read_bytes()).hexdigest() == before


def test_a_step_that_fails_leaves_no_store(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as broken:
        for dialect, statements in schema._APPEND_ONLY.items():
            broken.setitem(schema._APPEND_ONLY, dialect, (*statements, "SELECT nothing"))
        with pytest.raises(RecordsError, match="nothing that was stored before is lost"):
            place.open()
    with pytest.raises(RecordsError, match="it is empty"):
        place.open(create=False)
    with place.open() as store:
        fill(store, 1)
        assert verify_store(store).sound


@pytest.mark.system
@pytest.mark.parametrize("at", range(0, STATEMENTS, 3))
def test_a_program_that_is_killed_while_it_begins_a_store_leaves_none(tmp_path: Path, at: int) -> None:
    place = Place(tmp_path / "store")
    ended = subprocess.run([sys.executable, "-c", KILLED, str(place.folder), str(at)], check=False)
    assert ended.returncode == -signal.SIGKILL
    with pytest.raises(RecordsError, match="it is empty"):
        place.open(create=False)
    with place.open() as store:
        fill(store, 1)
        assert verify_store(store).sound


@pytest.mark.system
def test_programs_that_begin_a_store_at_the_same_moment(place: Place) -> None:
    command = [sys.executable, "-m", "tests.records.writer", str(place.folder), place.database or "-"]
    running = [subprocess.Popen([*command, str(seed), "3"], stdout=subprocess.PIPE, text=True) for seed in range(2)]
    said = [one.communicate()[0] for one in running]
    assert [one.returncode for one in running] == [0, 0], said
    with place.open() as store:
        assert [each.presses for each in store.targets()] == [3, 3]
        assert verify_store(store).sound
