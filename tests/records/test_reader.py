"""What is read of a store is one state of it, and the estimate in force supersedes what it was made from."""

from __future__ import annotations

import itertools
from contextlib import contextmanager
from dataclasses import replace
from datetime import datetime, timedelta
from typing import TYPE_CHECKING, Any

import pytest
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate, sample_record

from tsis.errors import InputError
from tsis.model.image import TactileImage
from tsis.records import store as store_module
from tsis.records.database import Database
from tsis.records.reader import in_lineage

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.records.conftest import Place

    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, Target


def estimated(store: Store, target: Target, seed: int, supersedes: StoredEstimate | None = None) -> StoredEstimate:
    """A press more, and an estimate that rests on it."""
    image = TactileImage(grey=levels(seed)[:8, :10], full_scale=255.0)
    press = store.add_press(target, image, taken=WHEN + timedelta(seconds=seed))
    return store.add_estimate(
        target,
        sample_estimate(),
        kind="inclusion",
        presses=[press],
        probe="tsis-2011",
        calibration=sample_calibration(),
        supersedes=supersedes,
    )


def test_estimates_rest_on_presses_that_were_read_with_them(place: Place, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever another enters between two questions to the database, after every one of them."""
    reading = Database.reading
    with place.open() as store, place.open() as other:
        target = store.add_target()
        estimated(store, target, 0)
        seeds = iter(range(1, 100))
        entering = False

        @contextmanager
        def raced(self: Database) -> Iterator[Any]:
            nonlocal entering
            with reading(self) as connection:
                yield connection
            if self is store.database and not entering:
                entering = True
                estimated(other, target, next(seeds))
                entering = False

        with monkeypatch.context() as racing:
            racing.setattr(Database, "reading", raced)
            target_record = store.record(target)
        assert next(seeds) > 2  # another did enter something
        for stored in target_record.estimates:
            assert [target_record.press(identity).id for identity in stored.presses] == list(stored.presses)
        assert len(store.estimates(target)) > len(target_record.estimates)


def test_a_clock_that_was_set_back_puts_no_old_estimate_in_force(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    target = store.add_target()
    first = estimated(store, target, 0)

    class Clock(datetime):
        @classmethod
        def now(cls, tz: Any = None) -> Clock:
            return super().now(tz) - timedelta(hours=1)

    monkeypatch.setattr(store_module, "datetime", Clock)
    again = estimated(store, target, 1, supersedes=first)
    assert again.made < first.made
    assert [stored.id for stored in store.record(target).estimates] == [first.id, again.id]
    assert store.estimates(target)[-1].id == again.id


def test_presses_are_counted_without_being_read(store: Store) -> None:
    given = sample_record()
    target = store.import_target(given).target
    empty = store.add_target()
    assert (store.press_count(target), store.press_count(empty)) == (len(given.presses), 0)


def test_a_press_is_found_by_its_identity_and_its_target(store: Store) -> None:
    one, other = store.add_target(), store.add_target()
    estimated(store, one, 1)
    (press,) = store.presses(one)
    assert store.press(one, press.id) == press
    for target, identity in ((other, press.id), (one, press.id[:-1]), (one, ""), (one, "' OR ''='")):
        with pytest.raises(InputError, match=f"press must be one of target {target.number}"):
            store.press(target, identity)


def test_the_number_of_entries_tells_every_change(place: Place) -> None:
    with place.open() as store, place.open() as other:
        seen = [store.entries()]
        target = other.add_target()
        seen.append(store.entries())
        estimated(other, target, 1)
        seen.append(store.entries())
        other.edit_target(target, note="changed")
        seen.append(store.entries())
        assert seen == sorted(set(seen))
        store.targets()
        store.record(target)
        assert store.entries() == seen[-1]


def made(name: str, minutes: int, supersedes: str | None = None) -> StoredEstimate:
    (stored,) = sample_record().estimates
    return replace(stored, id=name, made=WHEN + timedelta(minutes=minutes), supersedes=supersedes)


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ([made("a", 3), made("b", 1), made("c", 2)], "bca"),
        ([made("a", 0), made("b", -60, "a")], "ab"),
        ([made("a", 0), made("b", -60, "a"), made("c", -120, "b"), made("d", 1)], "abcd"),
        ([made("b", 0, "of another store"), made("a", 0)], "ab"),
        ([made("a", 0, "b"), made("b", 1, "a")], "ab"),  # nobody but a forger makes it so
    ],
)
def test_each_comes_after_what_it_supersedes(given: list[StoredEstimate], wanted: str) -> None:
    for some in itertools.permutations(given):
        assert "".join(stored.id for stored in in_lineage(some)) == wanted
