"""A target of another store is entered as it is: whole, once, and without undoing what was edited here."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING

import numpy as np
import pytest
from sqlalchemy import select
from tests.records.sample import sample_record

from tsis.errors import RecordsError
from tsis.files.json_values import to_json_value
from tsis.records import schema as tables
from tsis.records.store import open_store, verify_store
from tsis.records.target import read_bundle, write_bundle
from tsis.records.values import estimate_to_json

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.records.store import Store
    from tsis.records.values import TargetRecord


def require_equal(one: TargetRecord, other: TargetRecord, *, but_frames: bool = False) -> None:
    assert to_json_value(one.target) == to_json_value(other.target)
    for mine, theirs in zip(one.presses, other.presses, strict=True):
        np.testing.assert_array_equal(one.levels(mine), other.levels(theirs))
        expected = replace(mine, frame=theirs.frame) if but_frames else mine
        assert to_json_value(expected) == to_json_value(theirs)
    for mine_made, theirs_made in zip(one.estimates, other.estimates, strict=True):
        assert estimate_to_json(mine_made) == estimate_to_json(theirs_made)
        for name, values in mine_made.estimate.samples.items():
            np.testing.assert_array_equal(values, theirs_made.estimate.samples[name])
    assert sorted(one.calibrations) == sorted(other.calibrations)


@pytest.mark.parametrize("full_scale", [255.0, 4095.0])
def test_everything_keeps_its_identity_and_value(store: Store, full_scale: float) -> None:
    given = sample_record(full_scale=full_scale)
    taken = store.import_target(given)
    assert (taken.new, taken.presses, taken.estimates, taken.present, taken.differing) == (True, 4, 1, 0, 0)
    require_equal(given, store.record(store.target(3)), but_frames=True)
    found = verify_store(store)
    assert found.sound
    assert found.unnamed == 0


def test_a_bundle_of_one_store_is_the_same_target_in_another(tmp_path: Path, store: Store) -> None:
    target = store.import_target(sample_record()).target
    write_bundle(store.record(target), tmp_path / "target-3.zip")
    with open_store(tmp_path / "other") as other:
        taken = other.import_target(read_bundle(tmp_path / "target-3.zip"))
        require_equal(store.record(target), other.record(taken.target))
        assert verify_store(other).sound


def test_a_second_time_nothing_is_added(store: Store) -> None:
    store.import_target(sample_record())
    before = verify_store(store).head
    taken = store.import_target(sample_record())
    assert (taken.new, taken.presses, taken.estimates, taken.present) == (False, 0, 0, 5)
    assert verify_store(store).head == before


def test_what_came_later_finds_its_place_and_what_was_edited_here_stays(store: Store) -> None:
    later = sample_record()
    store.import_target(replace(later, presses=later.presses[:3], estimates=()))
    store.edit_press(store.presses(store.target(3))[0], force_n=0.75)
    store.edit_target(store.target(3), name="mine")
    taken = store.import_target(later)
    assert (taken.new, taken.presses, taken.estimates, taken.present, taken.differing) == (False, 1, 1, 3, 1)
    assert taken.target.name == "mine"
    assert [press.force_n for press in store.presses(store.target(3))] == [0.75, 1.0, 0.7, 1.0]
    assert verify_store(store).sound


def test_frames_that_another_library_packed_otherwise_are_the_same(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = store.import_target(sample_record()).target
    store.edit_press(store.presses(target)[0], note="edited")  # two presses of one frame, one of them only in the store
    write_bundle(store.record(target), tmp_path / "bundle")
    given = read_bundle(tmp_path / "bundle")
    monkeypatch.setattr("tsis.records.blobs.QUICK_PNG", 9)
    taken = store.import_target(given)
    assert (taken.new, taken.presses, taken.present, taken.differing) == (False, 0, 5, 0)
    assert verify_store(store).unnamed == 0
    with open_store(tmp_path / "other") as other:
        first = other.import_target(given)
        monkeypatch.setattr("tsis.records.blobs.QUICK_PNG", 1)
        assert {press.frame for press in other.presses(first.target)}.isdisjoint(
            press.frame for press in store.presses(target)
        )
        again = other.import_target(given)
        assert (again.presses, again.present, again.differing) == (0, 5, 0)
        found = verify_store(other)
        assert (found.sound, found.unnamed) == (True, 0)
        require_equal(given, other.record(first.target), but_frames=True)


def test_a_frame_of_other_levels_differs(store: Store) -> None:
    given = sample_record()
    store.import_target(given)
    other = replace(given, read=lambda name: 255 - given.read(name))
    assert store.import_target(other).differing == len(given.presses)


@pytest.mark.parametrize("reverse", [False, True])
def test_estimates_come_after_what_they_supersede_however_they_are_handed_in(store: Store, reverse: bool) -> None:
    given = sample_record()
    (first,) = given.estimates
    later = replace(first, id="estimate-b", supersedes=first.id, made=first.made - timedelta(hours=1))
    estimates = (later, first) if reverse else (first, later)
    taken = store.import_target(replace(given, estimates=estimates))
    assert [stored.id for stored in store.estimates(taken.target)] == ["estimate-a", "estimate-b"]


def test_a_taken_number_gives_way_to_a_free_one(store: Store) -> None:
    mine = store.add_target(number=3, name="mine")
    taken = store.import_target(sample_record())
    assert (taken.target.number, taken.target.id) == (4, "target-a")
    assert store.target(3) == mine
    assert store.import_target(sample_record()).target.number == 4


def test_the_audit_tells_an_import_from_what_was_measured_here(store: Store) -> None:
    store.add_target()
    store.import_target(sample_record())
    with store.database.reading() as connection:
        entries = connection.execute(select(tables.audit_table.c.action, tables.audit_table.c.kind)).all()
    imported = [kind for action, kind in entries if action == "import"]
    assert sorted(imported) == ["calibrations", "estimates", *["frames"] * 4, *["presses"] * 4, "targets"]


def test_phantoms_and_subjects_are_kept_apart(store: Store) -> None:
    with pytest.raises(RecordsError, match=r"a store of phantoms must hold nothing else.*--kind subject"):
        store.import_target(sample_record(kind="subject"))
    assert store.targets() == ()


def test_all_of_it_or_nothing(store: Store) -> None:
    given = sample_record()
    (estimate,) = given.estimates
    with pytest.raises(RecordsError):
        store.import_target(replace(given, estimates=(replace(estimate, supersedes="of another store"),)))
    assert store.targets() == ()
    assert verify_store(store).sound


def test_an_identity_that_is_another_targets_here_is_refused(store: Store) -> None:
    store.import_target(sample_record())
    given = sample_record()
    other = replace(given.target, id="target-b", number=9)
    presses = tuple(replace(press, target="target-b") for press in given.presses)
    with pytest.raises(RecordsError, match="must be of this target; here it is of another"):
        store.import_target(replace(given, target=other, presses=presses, estimates=()))
    assert [each.target.number for each in store.targets()] == [3]


def test_presses_are_found_by_their_frames_however_many_are_asked_for(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tsis.records.reader.MOST_AT_ONCE", 3)
    store.import_target(sample_record())
    presses = store.presses(store.target(3))
    unknown = [f"{number:064x}" for number in range(5)]
    expected = [press.frame for press in presses[:3]]
    found = store.presses_of_frames([*unknown, *expected])
    assert {press.id for press in found} == {press.id for press in presses[:3]}
    assert store.presses_of_frames(unknown) == store.presses_of_frames([]) == ()
