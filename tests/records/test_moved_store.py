"""A store whose folder is moved, deleted or replaced under a running program takes nothing more until it is back."""

from __future__ import annotations

import shutil
from typing import TYPE_CHECKING

import pytest
from tests.records.sample import WHEN, levels

from tsis.errors import RecordsError
from tsis.model.image import TactileImage
from tsis.records.blobs import Blobs
from tsis.records.database import DATABASE_FILE
from tsis.records.store import FILES, open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

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
