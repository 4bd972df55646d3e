"""A store that an earlier release wrote is opened by this one: all of it, at once or not at all."""

from __future__ import annotations

import errno
import hashlib
import math
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from alembic import op
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import inspect
from tests.records.old_store import ENTRIES, HEAD, IDENTITY, make_old
from tests.records.place import Place
from tests.records.sample import WHEN, levels, sample_calibration

from tsis.calibration.file import calibration_sha256
from tsis.errors import RecordsError
from tsis.files import _atomic as durable
from tsis.model import TactileImage
from tsis.records.store import Database, verify_store
from tsis.records.store import _tables as tables
from tsis.records.store._audit import AuditHead
from tsis.records.store._upgrade import readable_revisions

if TYPE_CHECKING:
    from pathlib import Path

COPY = "records-of-schema-1.sqlite3"
STATEMENTS = 4  # of the step to schema 2
KILLED = """
import os, signal, sys
from alembic import op
from tsis.files import DISK
from tsis.records.store import open_store
folder, at = sys.argv[1:]
left = 0 if at == "copied" else int(at)
execute, rename = op.execute, DISK.rename
def counted(*statement):
    global left
    if left == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    left -= 1
    execute(*statement)
def renamed(draft, path):
    if at == "copied":
        os.kill(os.getpid(), signal.SIGKILL)
    rename(draft, path)
op.execute, DISK.rename = counted, renamed
open_store(folder)
"""


@pytest.fixture
def old(place: Place) -> Place:
    make_old(place)
    return place


@pytest.fixture
def old_file(tmp_path: Path) -> Place:
    place = Place(tmp_path / "old")
    make_old(place)
    return place


def schema(folder: Path, file: str = "records.sqlite3") -> tuple[str, bool, bool]:
    """Schema that a SQLite file says it has, whether it has the columns of schema 2, and its indexes."""
    with closing(sqlite3.connect(folder / file)) as connection:
        ((version,),) = connection.execute("SELECT version_num FROM alembic_version").fetchall()
        columns = {row[1] for row in connection.execute("PRAGMA table_info(presses)")}
        indexes = {row[0] for row in connection.execute("SELECT name FROM sqlite_master WHERE type = 'index'")}
    return version, {"flags", "note"} <= columns, {"presses_of_a_target", "estimates_of_a_target"} <= indexes


OLD, NEW = ("1", False, False), ("2", True, True)


def test_every_old_record_reads_as_it_was(old: Place) -> None:
    with old.open(create=False, kind="phantom") as store:
        assert store.identity == IDENTITY
        target = store.target(4)
        assert (target.name, target.note, target.version) == ("größe-10b", "first line\nsecond; it's", 2)
        assert target.truth == {"diameter_mm": 10.0, "depth_mm": 0.1}
        plain, pressed = store.presses(target)
        assert (plain.role, plain.force_n, plain.full_scale, plain.calibration) == ("plain", 0.1, 255.0, None)
        assert (pressed.role, pressed.force_n, pressed.full_scale) == ("target", 1.1, 4095.0)
        assert pressed.calibration == calibration_sha256(sample_calibration())
        assert pressed.settings == {"exposure_ms": 1 / 3, "until": math.inf, "name": "é"}
        assert (pressed.taken, pressed.mm_per_pixel, pressed.axis_px) == (
            WHEN + timedelta(seconds=1),
            (0.12, 0.14),
            (3.5, 2.5),
        )
        assert [(each.flags, each.note) for each in (plain, pressed)] == [((), "")] * 2
        np.testing.assert_array_equal(store.levels(plain.frame), np.arange(48).reshape(6, 8))
        np.testing.assert_array_equal(store.levels(pressed.frame), np.arange(48).reshape(6, 8) * 4095 // 255)
        (estimate,) = store.estimates(target)
        assert estimate.presses == (plain.id, pressed.id)
        assert estimate.options == {"prior": {"depth_mm": [4.0, 12.0]}}
        assert [values.size for values in estimate.estimate.samples.values()] == [5, 5, 5]
        found = verify_store(store)
        assert found.faults == ()
        assert found.head == AuditHead(number=ENTRIES, hash=HEAD)


def test_a_migrated_store_takes_new_records(old: Place) -> None:
    with old.open() as store:
        target = store.target(4)
        image = TactileImage(grey=levels(0), full_scale=255.0)
        kept = store.add_press(target, image, taken=WHEN + timedelta(hours=1), flags=("moving",), note="new")
        store.edit_press(store.presses(target)[0], note="seen again")
    with old.open() as store:
        assert kept in store.presses(target)
        assert [each.note for each in store.presses(target)].count("seen again") == 1
        assert verify_store(store).sound


def test_a_copy_of_the_old_file_stays_and_a_second_opening_changes_nothing(old_file: Place) -> None:
    old_file.open().close()
    assert schema(old_file.folder) == NEW
    assert schema(old_file.folder, COPY) == OLD
    with closing(sqlite3.connect(old_file.folder / COPY)) as copy:
        assert copy.execute("SELECT count(*), max(hash) FROM audit WHERE number = 11").fetchone() == (1, HEAD)
        assert copy.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    before = {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in old_file.folder.glob("*.sqlite3")}
    old_file.open().close()
    assert {path: (path.read_bytes(), path.stat().st_mtime_ns) for path in before} == before


@pytest.mark.system
@pytest.mark.parametrize("at", ["copied", *map(str, range(STATEMENTS))])
def test_a_program_that_is_killed_while_it_migrates_leaves_the_old_schema(old_file: Place, at: str) -> None:
    ended = subprocess.run([sys.executable, "-c", KILLED, str(old_file.folder), at], check=False)
    assert ended.returncode == -signal.SIGKILL
    assert schema(old_file.folder) == OLD
    with old_file.open() as store:
        assert verify_store(store).head == AuditHead(number=ENTRIES, hash=HEAD)
        assert verify_store(store).sound
    assert schema(old_file.folder) == NEW
    assert schema(old_file.folder, COPY) == OLD
    assert sorted(path.name for path in old_file.folder.glob(".*")) == []


@pytest.mark.parametrize("at", range(STATEMENTS))
def test_a_step_that_fails_leaves_the_old_schema(old: Place, at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    execute = op.execute

    def failing(statement: str) -> None:
        execute("SELECT nothing" if len(done) == at else statement)
        done.append(statement)

    with monkeypatch.context() as broken:
        broken.setattr(op, "execute", failing)
        with pytest.raises(
            RecordsError, match=r"nothing that was stored before is lost|must be a database that is whole"
        ):
            old.open()
    if old.database is None:
        assert schema(old.folder) == OLD
    with old.open() as store:
        assert verify_store(store).sound
        assert len(store.presses(store.target(4))) == 2


def test_without_room_for_the_copy_nothing_is_migrated(old_file: Place) -> None:
    (old_file.folder / COPY).mkdir()
    with pytest.raises(RecordsError, match="a copy of the old records must be written"):
        old_file.open()
    assert schema(old_file.folder) == OLD
    assert list(old_file.folder.glob(".*")) == []


@pytest.mark.parametrize("step", ["sync", "rename", "sync_folder"])
def test_a_copy_that_cannot_be_finished_leaves_no_draft(
    old_file: Place, step: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as broken:
        broken.setattr(durable.DISK, step, full)
        with pytest.raises(RecordsError, match="a copy of the old records must be written"):
            Database(None, old_file.folder).migrate()
    assert schema(old_file.folder) == OLD
    assert list(old_file.folder.glob(".*")) == []
    with old_file.open() as store:
        assert verify_store(store).sound
    assert schema(old_file.folder, COPY) == OLD


@pytest.mark.parametrize("version", ["3", "", "1'; DROP TABLE audit; --"])
def test_a_store_of_a_newer_release_is_refused_and_left_alone(old_file: Place, version: str) -> None:
    file = old_file.folder / "records.sqlite3"
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("PRAGMA journal_mode=WAL")
        connection.execute("UPDATE alembic_version SET version_num = ?", (version,))
    before = hashlib.sha256(file.read_bytes()).hexdigest()
    with pytest.raises(RecordsError, match="update tsis") as caught:
        old_file.open()
    assert "\n" not in str(caught.value)
    assert hashlib.sha256(file.read_bytes()).hexdigest() == before
    assert not (old_file.folder / COPY).exists()


@pytest.mark.system
def test_programs_that_migrate_at_the_same_moment(old: Place) -> None:
    command = [sys.executable, "-m", "tests.records.writer", str(old.folder), old.database or "-"]
    running = [subprocess.Popen([*command, str(seed), "3"], stdout=subprocess.PIPE, text=True) for seed in range(2)]
    said = [one.communicate()[0] for one in running]
    assert [one.returncode for one in running] == [0, 0], said
    if old.database is None:
        assert schema(old.folder, COPY) == OLD
    with old.open() as store:
        assert sorted(each.presses for each in store.targets()) == [2, 3, 3]
        assert verify_store(store).sound


def test_the_readable_schemas_are_those_of_the_scripts() -> None:
    config = Config()
    config.set_main_option("script_location", "tsis.records:migrations")
    steps = ScriptDirectory.from_config(config).walk_revisions()
    assert readable_revisions() == tuple(step.revision for step in steps)


def test_the_migrations_make_what_the_tables_say(place: Place) -> None:
    with place.open() as store, store.database.reading() as connection:
        looked = inspect(connection)
        made: dict[str, Any] = {}
        for name in set(looked.get_table_names()) - {"alembic_version"}:
            columns = {each["name"]: each["nullable"] for each in looked.get_columns(name)}
            indexes = {
                each["name"]: tuple(each["column_names"]) for each in looked.get_indexes(name) if not each["unique"]
            }
            unique = {tuple(each["column_names"]) for each in looked.get_unique_constraints(name)}
            keys = {(each["constrained_columns"][0], each["referred_table"]) for each in looked.get_foreign_keys(name)}
            made[name] = (columns, indexes, unique, keys, looked.get_pk_constraint(name)["constrained_columns"])
        options = {"compare_type": place.database is not None}  # SQLite reflects DOUBLE PRECISION as REAL
        changes = compare_metadata(MigrationContext.configure(connection, opts=options), tables.metadata)
    expected = {
        name: (
            {column.name: column.nullable for column in table.columns},
            {str(index.name): tuple(column.name for column in index.columns) for index in table.indexes},
            {(column.name,) for column in table.columns if column.unique},
            {(key.parent.name, key.column.table.name) for key in table.foreign_keys},
            [column.name for column in table.primary_key],
        )
        for name, table in tables.metadata.tables.items()
    }
    assert made == expected
    assert changes == []
