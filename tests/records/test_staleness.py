"""Results whose presses were edited since: named with what changed, and only then."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import pytest
from tests.present.test_lump_map import map_of
from tests.records.pressed_object import stored_object
from tests.records.sample import WHEN, sample_record

from tsis.records.recomputation import recompute
from tsis.records.staleness import changed_inputs, stale_results
from tsis.records.store import open_store
from tsis.records.values import StoredMap

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store
    from tsis.records.values import TargetRecord


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "phantoms") as opened:
        yield opened


def named(record: TargetRecord) -> list[tuple[int, str, Any, Any]]:
    """Number of the press, name, value before and value now of each changed input."""
    (stored,) = record.active_results
    return [(item.number, item.name, item.before, item.after) for item in changed_inputs(record, stored)]


def inclusion(*, names: bool = True) -> TargetRecord:
    """The sample with what the estimate tells of its presses."""
    record = sample_record()
    presses = tuple(replace(press, name=press.name if names else "") for press in record.presses)
    lists = {
        kind: [{"name": press.name, "force_n": press.force_n} for press in presses if press.role == role]
        for kind, role in (("images", "target"), ("reference", "plain"))
    }
    (stored,) = record.estimates
    estimate = replace(stored.estimate, provenance=lists)
    return replace(record, presses=presses, estimates=(replace(stored, estimate=estimate),))


def edited(record: TargetRecord, number: int, **changes: Any) -> TargetRecord:
    presses = list(record.presses)
    presses[number - 1] = replace(presses[number - 1], version=2, **changes)
    return replace(record, presses=tuple(presses))


def test_an_edited_force_is_told_until_the_estimate_is_made_again(store: Store) -> None:
    target = stored_object(store)
    assert store.stale_results(target) == ()
    press = store.presses(target)[1]
    press = store.edit_press(press, note="read again")
    assert store.edited_targets() == store.edited_targets(target) == {target.id}
    assert store.stale_results(target) == (), "a note is no input"
    press = store.edit_press(press, force_n=1.4)
    (stale,) = store.stale_results(target)
    assert stale.message() == (
        f"The presses have changed since the hardness was estimated: force_n 1.2 -> 1.4 of press {press.id[:8]}; make "
        "it again with tsis records recompute 1."
    )
    (again,) = recompute(store, target, dry_run=True)
    assert any("force_n" in cause and "1.2 -> 1.4" in cause for cause in again.causes)
    store.edit_press(press, force_n=1.2)
    assert store.stale_results(target) == (), "it is as it was"
    store.edit_press(store.presses(target)[1], force_n=1.4)
    (again,) = recompute(store, target)
    assert again.stored
    assert store.stale_results(target) == ()


def test_force_and_role_of_an_inclusion_are_told_by_press() -> None:
    record = inclusion()
    assert named(record) == []
    assert named(edited(record, 1, note="left")) == []
    assert named(edited(record, 2, force_n=1.2)) == [(2, "force_n", 1.0, 1.2)]
    assert named(edited(record, 3, role="target")) == [(3, "role", "plain", "target")]
    assert named(edited(record, 2, role="untouched", force_n=0.0)) == [(2, "role", "target", "untouched")]
    swapped = edited(edited(record, 1, role="plain"), 3, role="target")
    assert named(swapped) == [(1, "role", "target", "plain"), (3, "role", "plain", "target")]


def test_presses_without_names_are_told_by_their_order() -> None:
    record = inclusion(names=False)
    assert named(edited(record, 1, role="plain")) == [(1, "role", "target", "plain")]
    assert named(edited(record, 4, force_n=2.0)) == [(4, "force_n", 1.0, 2.0)]


def test_a_force_that_the_calibration_gave_is_no_change(monkeypatch: pytest.MonkeyPatch) -> None:
    record = edited(inclusion(), 2, force_n=None)
    assert named(record) == [(2, "force_n", 1.0, None)], "this calibration gives no force"

    def by_line(_: object, frames: list[Any], **__: object) -> tuple[list[Any], None]:
        return [replace(frame, force_n=1.0) for frame in frames], None

    monkeypatch.setattr("tsis.calibration.frames.apply_calibration", by_line)
    assert named(record) == []


def test_an_estimate_that_does_not_tell_its_forces_is_not_called_stale() -> None:
    record = edited(sample_record(), 2, force_n=1.2)
    assert named(record) == []
    assert stale_results(record) == ()


def test_of_many_changes_three_are_named() -> None:
    record = inclusion()
    for number in range(1, 5):
        record = edited(record, number, force_n=5.0)
    (stale,) = stale_results(record)
    assert stale.message(numbered=True) == (
        "The presses have changed since the inclusion was estimated: force_n 0.7 -> 5 of press 1, force_n 1 -> 5 of "
        "press 2, force_n 0.7 -> 5 of press 3, and 1 more; make it again with tsis records recompute 3."
    )


def test_force_and_role_of_a_map_are_told_by_press() -> None:
    record = sample_record(estimated=False)
    told = [{"name": press.name, "force_n": press.force_n, "role": press.role} for press in record.presses]
    stored = StoredMap(
        estimate=replace(map_of(3), provenance={"images": told}),
        made=WHEN,
        probe="tsis-2011",
        presses=tuple(press.id for press in record.presses),
        calibration="0" * 64,
    )
    record = edited(replace(record, maps=(stored,)), 2, force_n=None)
    assert named(record) == [(2, "force_n", 1.0, None)], "a map takes no force of a calibration"
    assert named(edited(record, 3, role="target"))[1:] == [(3, "role", "plain", "target")]
    (stale,) = stale_results(record)
    assert stale.message().startswith("The presses have changed since the map was made: force_n 1 -> none of press ")
