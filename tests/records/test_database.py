"""Databases of moved, replaced and read-only folders: nothing is acknowledged that is not kept, nothing is touched."""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from tests.records.sample import WHEN, levels
from tests.records.tampering import fill

from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records.blobs import Blobs
from tsis.records.database import DATABASE_FILE
from tsis.records.store import FILES, open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


MOVED = r"the store in '.*opened' was moved or replaced since it was opened; nothing was stored"


def _image(seed: int) -> TactileImage:
    return TactileImage(grey=levels(seed)[:8, :10], full_scale=255.0)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "opened"


@pytest.fixture
def store(folder: Path) -> Iterator[Store]:
    with open_store(folder) as opened:
        yield opened


@pytest.fixture
def held(store: Store) -> tuple[Target, StoredPress]:
    target = store.add_target(name="before")
    return target, store.add_press(target, _image(1), taken=WHEN)


def _away(folder: Path) -> Path:
    return folder.rename(folder.with_name("away"))


def _renamed(folder: Path) -> None:
    _away(folder)


def _deleted(folder: Path) -> None:
    shutil.rmtree(folder)


def _emptied(folder: Path) -> None:
    _away(folder)
    folder.mkdir()


def _replaced_by_a_copy(folder: Path) -> None:
    shutil.copytree(_away(folder), folder)


def _replaced_by_another_store(folder: Path) -> None:
    _away(folder)
    with open_store(folder) as other:
        other.add_target(name="another")


@pytest.mark.parametrize("end", [_renamed, _deleted, _emptied, _replaced_by_a_copy, _replaced_by_another_store])
def test_nothing_is_acknowledged_once_the_folder_is_gone(
    store: Store, held: tuple[Target, StoredPress], folder: Path, end: Callable[[Path], None]
) -> None:
    target, press = held
    end(folder)
    files = sorted(folder.rglob("*"))
    with pytest.raises(RecordsError, match=MOVED):
        store.add_press(target, _image(2), taken=WHEN)
    with pytest.raises(RecordsError, match=MOVED):
        store.edit_target(target, name="after")
    with pytest.raises(RecordsError, match=MOVED):
        store.edit_press(press, note="after")
    assert sorted(folder.rglob("*")) == files  # nor was anything left in what took its place


def test_put_back_it_goes_on(store: Store, held: tuple[Target, StoredPress], folder: Path) -> None:
    away = _away(folder)
    with pytest.raises(RecordsError, match=MOVED):
        store.edit_target(held[0], name="lost")
    away.rename(folder)
    store.add_press(held[0], _image(2), taken=WHEN)
    assert store.edit_target(held[0], name="kept").name == "kept"
    with open_store(folder, create=False) as again:
        assert (again.target(1).name, len(again.presses(again.target(1)))) == ("kept", 2)
        assert verify_store(again).sound


def test_a_folder_that_goes_while_it_is_written_to_is_noticed_before_the_commit(
    store: Store, held: tuple[Target, StoredPress], folder: Path
) -> None:
    with pytest.raises(RecordsError, match=MOVED), store.database.writing():
        away = _away(folder)
    away.rename(folder)
    assert store.target(1) == held[0]


def test_no_connection_is_kept_to_the_file_that_took_its_place(
    store: Store, held: tuple[Target, StoredPress], folder: Path
) -> None:
    away = _away(folder)
    folder.mkdir()
    with store.database.reading(), pytest.raises(RecordsError, match=MOVED), store.database.reading():
        pass  # the second needs a connection of its own
    assert not (folder / DATABASE_FILE).exists()
    folder.rmdir()
    away.rename(folder)
    with store.database.reading():
        store.edit_target(held[0], name="kept")
    with open_store(folder, create=False) as again:
        assert again.target(1).name == "kept"


def test_missing_files_are_told_and_their_folder_is_not_made_anew(
    store: Store, held: tuple[Target, StoredPress], folder: Path
) -> None:
    shutil.rmtree(folder / FILES)
    with pytest.raises(RecordsError, match="must be written into"):
        store.add_press(held[0], _image(2), taken=WHEN)
    with pytest.raises(RecordsError, match="a stored file must be there, and is missing"):
        store.levels(held[1].frame)
    with pytest.raises(RecordsError):
        Blobs(folder / FILES).put(b"content", "json")
    assert not (folder / FILES).exists()


ROOT = Path(__file__).parents[2]
READ = """
import json, sys
from tsis.errors import RecordsError
from tsis.records.target import write_bundle
from tsis.records.store import open_store, verify_store
try:
    with open_store(sys.argv[1], create=False) as store:
        target = store.target(1)
        write_bundle(store.record(target), sys.argv[2])
        found = verify_store(store)
        try:
            store.add_target()
        except RecordsError as error:
            refused = str(error)
        told = {"targets": len(store.targets()), "faults": found.faults, "rows": found.rows, "refused": refused}
except RecordsError as error:
    told = {"error": str(error)}
print(json.dumps(told))
"""
needs_mounts = pytest.mark.skipif(
    shutil.which("unshare") is None or os.geteuid() != 0, reason="needs unshare, and root to mount"
)


def content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def sealed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A store of which the program is told that nothing can be written there."""
    with open_store(tmp_path / "store") as store:
        fill(store, 1)
    monkeypatch.setattr("tsis.records.store.only_readable", lambda _: True)
    return tmp_path / "store"


@pytest.mark.parametrize("create", [True, False])
def test_it_is_read_and_verified_and_nothing_is_touched(sealed: Path, create: bool) -> None:
    before = content(sealed)
    with open_store(sealed, create=create) as store:
        target_record = store.record(store.target(1))
        assert [target_record.levels(press).shape for press in target_record.presses] == [(16, 20)] * 4
        assert len(target_record.estimates) == 1
        found = verify_store(store)
        assert (found.faults, found.notes) == ((), ())
        assert found.rows > 10
        with pytest.raises(RecordsError, match=r"to be added to.*copy the whole folder"):
            store.add_target()
        with pytest.raises(RecordsError, match=r"to be added to.*copy the whole folder"):
            store.edit_target(target_record.target, name="b")
    assert content(sealed) == before


def test_tampering_shows_there_as_well(sealed: Path) -> None:
    with closing(sqlite3.connect(sealed / "records.sqlite3")) as connection, connection:
        connection.execute("UPDATE presses SET force_n = 9")
    with open_store(sealed, create=False) as store:
        assert any("this row is not as it was stored" in fault for fault in verify_store(store).faults)


def test_what_is_in_the_log_is_seen(sealed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Somebody else writes there meanwhile."""
    with monkeypatch.context() as allowed:
        allowed.setattr("tsis.records.store.only_readable", lambda _: False)
        writing = open_store(sealed)
    with writing:
        target = writing.add_target(name="logged")
        assert (sealed / "records.sqlite3-wal").stat().st_size > 0
        with open_store(sealed) as store:
            assert store.target(target.number).name == "logged"
            later = writing.add_target()
            assert store.target(later.number) == later
            assert verify_store(store).sound


def read_on_a_medium(folder: Path, out: Path) -> dict[str, object]:
    """What a program finds in a folder that is mounted to be read only."""
    mount = f"mount --bind {folder} {folder} && mount -o remount,ro,bind {folder}"
    done = subprocess.run(
        ["unshare", "-m", "sh", "-c", f'{mount} && exec {sys.executable} -c "$1" {folder} {out}', "sh", READ],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    if "mount:" in done.stderr:
        pytest.skip(f"no mount is allowed here: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    result: dict[str, object] = json.loads(done.stdout)
    return result


@pytest.mark.system
@needs_mounts
def test_a_real_medium(tmp_path: Path) -> None:
    with open_store(tmp_path / "store") as store:
        fill(store, 1)
        rows = verify_store(store).rows
    before = content(tmp_path / "store")
    result = read_on_a_medium(tmp_path / "store", tmp_path / "bundle")
    assert (result["targets"], result["faults"], result["rows"]) == (1, [], rows)
    assert "copy the whole folder" in str(result["refused"])
    assert (tmp_path / "bundle" / "manifest.json").is_file()
    assert content(tmp_path / "store") == before


@pytest.mark.system
@needs_mounts
def test_a_real_medium_with_a_log_that_was_never_taken_in(tmp_path: Path) -> None:
    with open_store(tmp_path / "living") as store:
        store.add_press(store.add_target(), TactileImage(grey=levels(0), full_scale=255.0), taken=WHEN)
        shutil.copytree(tmp_path / "living", tmp_path / "store")
    (tmp_path / "store" / "records.sqlite3-shm").unlink()
    assert (tmp_path / "store" / "records.sqlite3-wal").stat().st_size > 0
    result = read_on_a_medium(tmp_path / "store", tmp_path / "bundle")
    assert "copy the whole folder" in str(result["error"])
    assert "\n" not in str(result["error"])
