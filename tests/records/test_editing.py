"""What people wrote can be changed by whoever has read it as it is; what was measured cannot."""

from __future__ import annotations

from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING

import pytest
from tests.records.sample import WHEN, levels

from tsis.errors import InputError, StaleRecordError
from tsis.model.image import TactileImage
from tsis.records.store import verify_store

if TYPE_CHECKING:
    from tsis.records.store import Store

HOUR = timedelta(hours=1)


def image() -> TactileImage:
    return TactileImage(grey=levels(0)[:8, :10], full_scale=255.0, force_n=0.7, settings={"roi": (0, 8)})


def test_an_edit_of_what_somebody_else_has_changed_is_refused(store: Store) -> None:
    read_by_both = store.add_target(name="a")
    press = store.add_press(read_by_both, image(), taken=WHEN)
    store.edit_target(read_by_both, name="b")
    with pytest.raises(StaleRecordError, match="somebody else has changed it since version 1"):
        store.edit_target(read_by_both, name="c")
    assert store.target(1).name == "b"
    edited = store.edit_press(press, force_n=1.0, flags=("moving",))
    with pytest.raises(StaleRecordError):
        store.edit_press(press, note="late")
    assert store.presses(read_by_both) == (edited,)
    assert verify_store(store).sound


def test_what_may_not_be_changed_is_not(store: Store) -> None:
    press = store.add_press(store.add_target(), image(), taken=WHEN)
    with pytest.raises(InputError, match="no field of a press that may be changed is called 'frame'"):
        store.edit_press(press, frame="0" * 64)


def test_only_what_was_named_is_changed(store: Store) -> None:
    """Whatever else the record that is handed in says."""
    target = store.add_target(name="a", note="n")
    press = store.add_press(target, image(), taken=WHEN)
    forged = replace(press, taken=WHEN - HOUR, name="other", full_scale=4095.0, probe="p", force_n=3.0)
    edited = store.edit_press(forged, note="x")
    assert edited == replace(press, note="x", version=2) == store.presses(target)[0]
    renamed = store.edit_target(replace(target, number=77, note="other"), name="b")
    assert renamed == replace(target, name="b", version=2) == store.target(1)
    for edit in (lambda: store.edit_target(renamed), lambda: store.edit_press(edited)):
        with pytest.raises(InputError, match="must change something; got nothing"):
            edit()
    assert store.target(1).version == 2
    assert verify_store(store).sound


@pytest.mark.parametrize(
    "truth",
    [
        {"diameter_mm": -1.0},
        {"depth_mm": 0.0},
        {"young_kpa": 2e6},
        {"diameter_mm": 10.0, "depth_mm": float("inf")},
    ],
)
def test_no_target_is_entered_with_what_no_inclusion_has(store: Store, truth: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r"truth\['\w+'\] must lie in"):
        store.add_target(truth=truth)
    target = store.add_target(truth={"diameter_mm": 0.1, "offset_x_mm": -3.0})
    with pytest.raises(InputError, match=r"truth\['\w+'\] must lie in"):
        store.edit_target(target, truth=truth)
    assert store.target(target.number) == target


def test_names_are_one_line_and_notes_may_be_more(store: Store) -> None:
    with pytest.raises(InputError, match="name must be one line"):
        store.add_target(name="two\nlines")
    target = store.add_target(name="one line", note="two\nlines")
    with pytest.raises(InputError, match="name must be one line"):
        store.edit_target(target, name="two\nlines")
    assert store.edit_target(target, note="three\nof\nthem").name == "one line"
