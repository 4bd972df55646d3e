"""Stored estimates made again: the same bit for bit, or different and told why."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.records.pressed_object import stored_object
from tests.records.sample import WHEN, levels, sample_calibration, sample_estimate

import tsis.hardness
from tsis.errors import InputError, RecordsError
from tsis.hardness.posterior import DRIFT_SD, HardnessPrior
from tsis.hardness.reading import BLUR_MM
from tsis.inclusion import InclusionPrior
from tsis.model.estimate import Estimate
from tsis.model.image import TactileImage
from tsis.records.provenance import environment
from tsis.records.recomputation import recompute, require_options
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store


NOW = datetime.now(UTC)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "phantoms") as opened:
        yield opened


def changed_estimator(monkeypatch: pytest.MonkeyPatch, *, by_kpa: float, flag: str = "") -> None:
    """The estimator as a later release might have it."""
    before = tsis.hardness.estimate

    def after(*arguments: Any, **options: Any) -> Estimate:
        found = before(*arguments, **options)
        moved = {name: values + by_kpa for name, values in found.samples.items()}
        flags = (*found.flags, flag) if flag else found.flags
        posterior = replace(found.untrusted, samples=moved)
        return replace(found, untrusted=posterior, flags=flags, trusted=found.trusted and not flag)

    monkeypatch.setattr(tsis.hardness, "estimate", after)


def of_another_time(monkeypatch: pytest.MonkeyPatch, **different: Any) -> None:
    monkeypatch.setattr("tsis.records.recomputation.environment", lambda: environment() | different)


def test_right_away_it_is_the_same_bit_for_bit_and_nothing_is_stored(store: Store) -> None:
    target = stored_object(store)
    (again,) = recompute(store, target)
    assert again.same
    assert again.message == "Nothing changed: bit for bit the same."
    assert again.causes == again.notes == again.flags_gained == again.flags_lost == ()
    assert [(shift.moved, shift.low_shift, shift.high_shift) for shift in again.shifts] == [(0.0, 0.0, 0.0)]
    before, after = again.before.estimate, again.after.estimate
    assert isinstance(before, Estimate)
    assert isinstance(after, Estimate)
    for name, values in before.samples.items():
        np.testing.assert_array_equal(after.samples[name], values)
    assert not again.stored
    assert len(store.estimates(target)) == 1


def test_another_estimator_is_told_with_how_far_it_moved_and_why(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    target = stored_object(store)
    sd = store.estimates(target)[0].estimate.sd["young_kpa"]
    changed_estimator(monkeypatch, by_kpa=2 * sd)
    libraries = environment()["libraries"] | {"numpy": "99.1"}
    of_another_time(monkeypatch, code_sha256="f" * 64, libraries=libraries)
    (again,) = recompute(store, target)
    (shift,) = again.shifts
    assert (shift.moved, shift.low_shift, shift.high_shift) == pytest.approx((2.0, 2.0, 2.0))
    assert again.causes == (
        f"the code changed ({environment()['code_sha256'][:12]} -> ffffffffffff)",
        f"numpy {environment()['libraries']['numpy']} -> 99.1",
    )
    first, second = store.estimates(target)
    assert second.supersedes == first.id
    assert second.id == again.after.id
    assert second.environment["libraries"]["numpy"] == "99.1"
    assert verify_store(store).sound


def test_an_estimate_that_lost_its_trust_says_so_without_shifts(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    target = stored_object(store)
    changed_estimator(monkeypatch, by_kpa=1.0, flag="model_does_not_hold")
    (again,) = recompute(store, target)
    assert again.flags_gained == ("model_does_not_hold",)
    assert again.before.estimate.trusted
    assert not again.after.estimate.trusted
    assert again.stored
    assert again.shifts == ()


def test_the_same_result_of_other_code_is_the_same_and_not_stored(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = stored_object(store)
    of_another_time(monkeypatch, python="4.0.0")
    (again,) = recompute(store, target)
    assert again.same
    assert "Bit for bit the same" in again.message
    assert f"python {environment()['python']} -> 4.0.0" in again.message
    assert len(store.estimates(target)) == 1


def test_a_change_without_a_known_cause_points_at_the_machine(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    target = stored_object(store)
    changed_estimator(monkeypatch, by_kpa=1e-9)
    (again,) = recompute(store, target)
    assert not again.same
    assert again.causes == ()
    assert "look at the processor" in again.message


def test_another_default_prior_is_the_cause(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    target = stored_object(store)
    assert "prior" not in store.estimates(target)[0].options

    @dataclass(frozen=True, slots=True, kw_only=True)
    class Narrow(HardnessPrior):
        young_kpa: tuple[float, float] = (10.0, 200.0)

    monkeypatch.setattr("tsis.hardness.estimation.HardnessPrior", Narrow)
    (again,) = recompute(store, target)
    assert not again.same
    assert again.causes == ("the default prior changed: young_kpa",)


def test_a_prior_that_was_written_down_is_taken_whatever_is_the_default_now(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = stored_object(store, prior=asdict(HardnessPrior()), blur_mm=BLUR_MM, drift_sd=DRIFT_SD)
    whole = tsis.hardness.estimate

    def of_another_release(*arguments: Any, **options: Any) -> Estimate:
        others: dict[str, Any] = {"prior": HardnessPrior(young_kpa=(10.0, 200.0)), "blur_mm": 0.1, "drift_sd": 0.1}
        return whole(*arguments, **others | options)

    monkeypatch.setattr(tsis.hardness, "estimate", of_another_release)
    (again,) = recompute(store, target)
    assert again.same
    assert again.message == "Nothing changed: bit for bit the same."


def test_an_edited_force_is_an_input_that_changed(store: Store) -> None:
    target = stored_object(store)
    press = store.presses(target)[1]
    store.edit_press(press, force_n=1.3)
    (again,) = recompute(store, target)
    assert not again.same
    assert f"the inputs changed: force_n of {press.name}: 1.2 -> 1.3" in again.causes
    assert not again.after.estimate.trusted
    assert again.shifts == ()
    assert again.stored
    (settled,) = recompute(store, target)
    assert settled.same
    assert settled.message == "Nothing changed: bit for bit the same."


def test_a_press_that_is_no_longer_one_on_the_target_is_left_out(store: Store) -> None:
    target = stored_object(store)
    press = store.presses(target)[0]
    store.edit_press(press, role="untouched")
    (again,) = recompute(store, target)
    assert "the inputs changed: 2 -> 1 frames of 'presses'" in again.causes


def test_a_dry_run_stores_nothing(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    target = stored_object(store)
    head = verify_store(store).head
    changed_estimator(monkeypatch, by_kpa=5.0)
    (again,) = recompute(store, target, dry_run=True)
    assert not again.same
    assert not again.stored
    assert verify_store(store).head == head


def test_a_calibration_that_expired_since_is_used_and_said(store: Store) -> None:
    target = stored_object(store, made=NOW - timedelta(days=9), expires=NOW + timedelta(days=1))
    (before,) = store.estimates(target)
    (fresh,) = recompute(store, target)
    assert fresh.notes == ()
    later = datetime.now(UTC) + timedelta(days=400)

    class Clock(datetime):
        @classmethod
        def now(cls, tz: Any = None) -> Any:
            return later

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("tsis.records.recomputation.datetime", Clock)
        (again,) = recompute(store, target)
    assert again.same
    assert before.made < later
    assert again.notes == (
        f"the calibration 'bench' has expired since (on {NOW + timedelta(days=1):%Y-%m-%d}); "
        "it was good when the estimate was made",
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"magic": True}, "options of an estimate of hardness must have no names but prior, radius_mm"),
        ({"prior": {"gone": 3}}, "prior must have no names but young_kpa, .*; got 'gone'"),
    ],
)
def test_options_that_no_estimate_takes_are_refused_by_name(store: Store, options: dict[str, Any], says: str) -> None:
    target = stored_object(store, **options)
    with pytest.raises(InputError, match=says):
        recompute(store, target)


def test_every_field_of_a_prior_is_taken() -> None:
    prior = asdict(InclusionPrior(tissue_young_kpa=6.0))
    require_options("inclusion", {"prior": prior})
    require_options("inclusion", {"prior": prior, "strain": "finite"})


def test_wrong_values_of_a_stored_prior_are_one_sentence(store: Store) -> None:
    target = stored_object(store, prior={"young_kpa": [1000.0, 10.0], "poisson": [0.45, 0.495]})
    with pytest.raises(InputError, match="young_kpa must be a range that ascends"):
        recompute(store, target)


def test_the_last_of_each_kind_is_made_again_and_the_one_in_force_stays(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = stored_object(store)
    press = store.add_press(target, TactileImage(grey=levels(1), force_n=0.7, mm_per_pixel=(0.1, 0.1)), taken=WHEN)
    asked = []

    def inclusion(images: Any, **_: Any) -> Estimate:
        asked.append(len(images))
        return sample_estimate()

    monkeypatch.setattr("tsis.inclusion.estimate", inclusion)
    known = sample_calibration()
    old = replace(sample_estimate(), presence=0.5)
    for _ in range(2):
        store.add_estimate(target, old, kind="inclusion", presses=[press], probe="tsis-2011", calibration=known)
    found = recompute(store, target)
    assert [each.before.kind for each in found] == ["hardness", "inclusion"]
    assert asked == [1]
    assert store.record(target).estimate is not None
    assert [each.kind for each in store.estimates(target)] == ["hardness", "inclusion", "inclusion", "inclusion"]
    assert store.estimates(target)[-1].supersedes == store.estimates(target)[-2].id


def test_without_an_estimate_there_is_nothing_to_make_again(store: Store) -> None:
    with pytest.raises(RecordsError, match="target 1 must have an estimate or a map to be made again; it has none"):
        recompute(store, store.add_target())


def test_a_damaged_frame_is_not_estimated_from(store: Store) -> None:
    target = stored_object(store)
    path = store.blobs.path(store.presses(target)[0].frame, "png")
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RecordsError, match="does not match its name"):
        recompute(store, target)
