"""Targets are archived, deleted and restored; what was deleted long ago is erased, and the audit says so."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING

import pytest
from sqlalchemy import text
from tests.records.sample import WHEN, levels, sample_record

from tsis.errors import InputError, RecordsError
from tsis.model.image import TactileImage
from tsis.records.reader import ARCHIVED, DELETED
from tsis.records.store import UNDO_DAYS, verify_store

if TYPE_CHECKING:
    from tsis.records.store import Store

LATER = timedelta(days=UNDO_DAYS, hours=1)


def image(seed: int) -> TactileImage:
    return TactileImage(grey=levels(seed)[:8, :10], full_scale=255.0, force_n=0.7)


def numbers(store: Store) -> list[int]:
    return [item.target.number for item in store.targets()]


def made_long_ago(store: Store) -> None:
    """Files that nobody is about to cite again."""
    for name, ending in store.blobs.names():
        os.utime(store.blobs.path(name, ending), (1e9, 1e9))


def test_an_archived_target_is_hidden_and_can_be_restored(store: Store) -> None:
    first, second = store.add_target(name="a"), store.add_target(name="b")
    assert store.state(first) is None
    state = store.set_state(first, ARCHIVED)
    assert state is not None
    assert (state.name, store.state(first)) == (ARCHIVED, state)
    assert numbers(store) == [second.number]
    assert [item.target.number for item in store.targets(hidden=True)] == [1, 2]
    store.add_press(first, image(1), taken=WHEN)  # an archive may grow
    assert store.set_state(first, "") is None
    assert numbers(store) == [1, 2]
    assert verify_store(store).sound
    with pytest.raises(InputError, match="state of a target"):
        store.set_state(first, "burnt")


def test_a_deleted_target_takes_no_press_until_it_is_restored(store: Store) -> None:
    target = store.add_target()
    store.set_state(target, DELETED)
    assert numbers(store) == []
    with pytest.raises(RecordsError, match=r"target 1 must not be deleted to be added to; it was deleted on .* \(rest"):
        store.add_press(target, image(1), taken=WHEN)
    assert store.erase_expired() == 0  # within the time of undo
    store.set_state(target, "")
    store.add_press(target, image(1), taken=WHEN)
    assert numbers(store) == [1]
    assert store.add_target().number == 2


def test_what_was_deleted_long_ago_is_erased_and_what_others_cite_stays(store: Store) -> None:
    erased = store.import_target(sample_record()).target
    stays = store.add_target(name="stays")
    shared = store.add_press(erased, image(1), taken=WHEN)
    press = store.add_press(stays, image(1), taken=WHEN)  # of the same frame
    assert shared.frame == press.frame
    before = {name for name, _ in store.blobs.names()}
    count = store.press_count(erased)
    made_long_ago(store)
    store.set_state(erased, DELETED)
    assert store.erase_expired(now=datetime.now(UTC) + LATER) == 1
    assert [item.target.number for item in store.targets(hidden=True)] == [stays.number]
    assert store.presses(stays) == (press,)
    assert store.levels(press.frame).shape == (8, 10)
    verification = verify_store(store)
    assert (verification.faults, verification.unnamed) == ((), 0)
    assert len(before) - len({name for name, _ in store.blobs.names()}) == count - 1 + 1  # its frames, its samples
    with store.database.reading() as connection:
        tombstone = connection.execute(text("SELECT value FROM store WHERE name LIKE 'state of target %'")).scalar_one()
        actions = set(connection.execute(text("SELECT action FROM audit WHERE kind = 'targets'")).scalars())
    assert f'"number": {erased.number}, "presses": {count}' in tombstone
    assert "erase" in actions
    assert store.erase_expired(now=datetime.now(UTC) + LATER) == 0


def test_an_erased_target_that_is_put_back_behind_the_programs_back_is_a_fault(store: Store) -> None:
    target = store.add_target()
    store.set_state(target, DELETED)
    with store.database.reading() as connection:
        row = connection.execute(text("SELECT * FROM targets")).one()._asdict()
    store.erase_expired(now=datetime.now(UTC) + LATER)
    with store.database.writing() as connection:
        names = ", ".join(row)
        connection.execute(text(f"INSERT INTO targets ({names}) VALUES ({', '.join(f':{name}' for name in row)})"), row)
    assert verify_store(store).faults == (f"targets {target.id}: this row is not as it was stored",)


def test_a_file_that_was_saved_again_this_moment_stays(store: Store) -> None:
    target = store.add_target()
    press = store.add_press(target, image(1), taken=WHEN)
    made_long_ago(store)
    store.blobs.put(store.blobs.get(press.frame, "png"), "png")  # by another program, whose row comes next
    store.set_state(target, DELETED)
    store.erase_expired(now=datetime.now(UTC) + LATER)
    assert [name for name, _ in store.blobs.names()] == [press.frame]


def test_a_target_that_is_unknown_has_no_state(store: Store) -> None:
    target = store.add_target()
    with pytest.raises(RecordsError):
        store.set_state(replace(target, id="0" * 32), DELETED)
