"""A backup is one state of a store, verified, and is a store itself."""

from __future__ import annotations

import stat
from typing import TYPE_CHECKING

import pytest
from tests.records.sample import WHEN, levels, sample_record

from tsis.errors import FileInputError, RecordsError
from tsis.model.image import TactileImage
from tsis.records.store import Store, back_up_store, open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def filled(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "store") as store:
        store.import_target(sample_record())
        yield store


def contents(store: Store) -> list[object]:
    return [(item, store.presses(item.target), store.estimates(item.target)) for item in store.targets()]


def test_a_backup_holds_what_the_store_held(filled: Store, tmp_path: Path) -> None:
    counts: list[tuple[int, int]] = []
    before = str(contents(filled))
    result = back_up_store(filled, tmp_path / "backup", progress=lambda done, total: counts.append((done, total)))
    assert result.sound
    assert counts[-1] == (2 * result.files, 2 * result.files)
    filled.add_target(name="later")
    with open_store(tmp_path / "backup", create=False) as copy:
        assert str(contents(copy)) == before
        assert copy.identity == filled.identity
        assert verify_store(copy).sound
        back_up_store(copy, tmp_path / "restored")  # to restore is the same the other way round
    with open_store(tmp_path / "restored", create=False) as restored:
        assert str(contents(restored)) == before
        restored.add_target()
        assert verify_store(restored).sound
    for path in (tmp_path / "backup").rglob("*"):
        assert stat.S_IMODE(path.stat().st_mode) & 0o077 == 0, path


def test_what_is_added_meanwhile_does_not_spoil_it(filled: Store, tmp_path: Path) -> None:
    image = TactileImage(grey=levels(7)[:8, :10], full_scale=255.0, force_n=0.7)

    def add(done: int, _: int) -> None:
        if done == 1:
            filled.add_press(filled.targets()[0].target, image, taken=WHEN)

    result = back_up_store(filled, tmp_path / "backup", progress=add)
    assert (result.sound, result.unanchored, result.unnamed) == (True, 0, 0)
    assert verify_store(filled).files == result.files + 1


def test_a_damaged_store_gives_no_backup_that_looks_sound(filled: Store, tmp_path: Path) -> None:
    name, ending = next(iter(filled.blobs.names()))
    filled.blobs.path(name, ending).write_bytes(b"other")
    with pytest.raises(RecordsError, match="must be as it was stored"):
        back_up_store(filled, tmp_path / "backup")
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


def test_a_row_that_was_changed_beside_the_audit_is_named(filled: Store, tmp_path: Path) -> None:
    with filled.database.writing() as connection:
        connection.exec_driver_sql("UPDATE targets SET name = 'other'")
    with pytest.raises(RecordsError, match=r"must be as its audit says; .*: this row is not as it was stored"):
        back_up_store(filled, tmp_path / "backup")
    assert [path.name for path in tmp_path.iterdir()] == ["store"]


def test_a_name_that_is_taken_is_refused(filled: Store, tmp_path: Path) -> None:
    (tmp_path / "backup").mkdir()
    with pytest.raises(FileInputError, match="must be a new folder"):
        back_up_store(filled, tmp_path / "backup")
