"""Changes of records as a page makes them: what was read, what is there, and who was faster."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.records.sample import sample_record

from tsis.console.pages.records import AT_ONCE, UNKNOWN_FLAG, flags_of, read_target
from tsis.console.pages.target import changed, edit_press, edit_target, truth_text
from tsis.errors import InputError
from tsis.model.image import TactileImage
from tsis.records.store import open_store, verify_store
from tsis.records.values import parse_force, parse_truth

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "store") as opened:
        opened.import_target(sample_record())
        yield opened


def test_the_slower_of_two_is_told_what_the_faster_changed(store: Store) -> None:
    mine = theirs = store.target(3)
    store.edit_target(theirs, name="theirs", truth={"depth_mm": 6.0})
    result = edit_target(store, mine, {"name": "mine"})
    assert "somebody else has changed it" in result.refused
    assert result.differences == (
        "Name: was “size-10”, is “theirs” now.",
        "Truth: was “depth_mm=5, diameter_mm=10, young_kpa=80”, is “depth_mm=6” now.",
    )
    assert result.record == store.target(3)
    again = edit_target(store, result.record, {"name": "mine"})
    assert (again.refused, again.record.name, again.record.version) == ("", "mine", 3)
    assert verify_store(store).sound


def test_a_press_that_was_changed_meanwhile_is_not_written_over(store: Store) -> None:
    target = store.target(3)
    press = store.press(target, "press-1")
    store.edit_press(press, force_n=None, flags=())
    result = edit_press(store, target, press, {"force_n": 1.5})
    assert result.differences == ("Force: was “1 N”, is not measured now.", "Flags: was “moving”, is empty now.")
    assert store.press(target, "press-1").force_n is None


def test_only_what_differs_is_a_change(store: Store) -> None:
    target = store.target(3)
    assert changed(target, {"name": "size-10", "note": "new", "truth": dict(target.truth)}) == {"note": "new"}


def test_truth_as_text_is_read_back_as_it_was() -> None:
    truth = {"diameter_mm": 10.0, "depth_mm": 4.25, "young_kpa": 100 / 3, "other": -1e-7}
    assert parse_truth(truth_text(truth).splitlines()) == truth


@pytest.mark.parametrize("text", ["half", "1,5", "0x1", "--", "1 N"])
def test_a_force_that_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="force must be a number of newtons, or nothing; got"):
        parse_force(text, called="force", nothing="")


@pytest.mark.parametrize("text", ["nan", "inf", "-1", "101", "1e400"])
def test_a_force_outside_its_range_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="force must"):
        parse_force(text, called="force", nothing="")


def test_a_page_of_a_target_is_a_sheet_of_its_presses(store: Store) -> None:
    target = store.target(3)
    first = store.press(target, "press-0")
    image = TactileImage(grey=store.levels(first.frame).astype(float), full_scale=255.0)
    for _ in range(AT_ONCE):
        store.add_press(target, image, taken=first.taken)
    observed = read_target(store, "3", 10**9)
    assert (observed.total, observed.offset, len(observed.presses)) == (AT_ONCE + 4, AT_ONCE, 4)
    assert [press.id for press in observed.presses] == [press.id for press in store.presses(target)[AT_ONCE:]]
    assert observed.record.estimates[0].id == "estimate-a"


def test_of_a_subject_pages_show_the_pseudonym_and_known_flags(tmp_path: Path) -> None:
    target_record = sample_record(kind="subject")
    with open_store(tmp_path / "subjects", kind="subject") as store:
        store.import_target(target_record)
        target = store.target(3)
        store.edit_target(target, note="Jane Doe")
        store.edit_press(store.press(target, "press-1"), flags=("moving", "Jane Doe"))
        observed = read_target(store, "3", 0)
        flagged = store.press(observed.target, "press-1")
    assert observed.private
    assert (observed.record.target.name, observed.record.target.note) == ("size-10", "")
    assert flags_of(flagged, private=True) == ("moving", UNKNOWN_FLAG)
    assert flags_of(flagged, private=False) == ("moving", "Jane Doe")
    assert [estimate.id for estimate in observed.record.estimates] == ["estimate 1"]
