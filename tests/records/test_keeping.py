"""What was taken and estimated here and now: kept whole under its target, or refused with what is stored."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.records.sample import levels, sample_calibration, sample_estimate

from tsis.errors import InputError, RecordsError
from tsis.model.image import TactileImage
from tsis.records.importing import SavableResult, require_savable, save_results, saved_notes
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from pathlib import Path


def frame(number: int, name: str = "") -> TactileImage:
    return TactileImage(grey=levels(number), force_n=1.0, mm_per_pixel=(0.1, 0.1), name=name)


def keepable() -> SavableResult:
    return SavableResult(
        kind="inclusion",
        estimate=sample_estimate(),
        probe="tsis-2011",
        calibration=sample_calibration(),
        frames={"target": [frame(0), frame(1)], "plain": [frame(2)], "untouched": [frame(3)]},
        options={"prior": {"depth_mm": [4.0, 12.0]}},
        name="knot",
        truth={"diameter_mm": 10.0},
    )


def test_presses_calibration_and_estimate_come_back_as_they_were(tmp_path: Path) -> None:
    kept = keepable()
    with open_store(tmp_path / "records") as store:
        said = save_results(store, kept)
        target = store.target(said["target"])
        presses = store.presses(target)
        assert [press.role for press in presses] == ["target", "target", "plain", "untouched"]
        assert sorted(presses, key=lambda press: press.taken) == list(presses)
        for press, number in zip(presses, range(4), strict=True):
            np.testing.assert_array_equal(store.levels(press.frame), levels(number))
        (stored,) = store.estimates(target)
        assert stored.id == said["estimate"]
        assert set(stored.presses) == {press.id for press in presses[:3]}  # an estimate rests on no untouched frame
        assert stored.options == kept.options
        assert (target.name, dict(target.truth)) == ("knot", {"diameter_mm": 10.0})
        assert said["store"] == str((tmp_path / "records").resolve())
        assert verify_store(store).sound


def test_a_subject_gets_no_truth(tmp_path: Path) -> None:
    with open_store(tmp_path / "subjects", kind="subject") as store:
        said = save_results(store, replace(keepable(), name=""))
        assert dict(store.target(said["target"]).truth) == {}
        assert said["notes"] == []


def test_keeping_under_a_phantom_with_another_truth_says_so(tmp_path: Path) -> None:
    with open_store(tmp_path / "records") as store:
        store.add_target(number=7, truth={"diameter_mm": 3.0})
        for number, notes in ((7, 1), (8, 0), (8, 0)):
            kept = save_results(store, keepable(), number=number)
            assert kept["target"] == number
            assert len(kept["notes"]) == notes
            first, *more = saved_notes(kept)
            assert first == f"Saved as target {number} in {tmp_path / 'records'}."
            assert more == kept["notes"]
        assert [(dict(each.target.truth), each.estimates) for each in store.targets()] == [
            ({"diameter_mm": 3.0}, 1),
            ({"diameter_mm": 10.0}, 2),
        ]


def test_what_could_not_be_stored_as_a_whole_says_how_much_was(tmp_path: Path) -> None:
    kept = keepable()
    broken = replace(kept, frames={"target": [frame(0)], "palin": [frame(1)]})
    with open_store(tmp_path / "records") as store:
        with pytest.raises(RecordsError, match=r"; 1 of 2 presses are stored in target 5$"):
            save_results(store, broken, number=5)
        assert len(store.presses(store.target(5))) == 1
        assert store.estimates(store.target(5)) == ()


def test_frames_that_no_store_takes_are_refused_before_anything_is_computed() -> None:
    require_savable([frame(0, "a" * 200)])
    with pytest.raises(InputError, match=r"must have at most 200 characters, to be saved; 'a{40}'\.\.\. has 201"):
        require_savable([frame(0), frame(0, "a" * 201)])
    between = replace(frame(0, "coloured"), grey=levels(0) * 0.5 + 0.25)
    with pytest.raises(InputError, match="'coloured' must hold the grey levels that the camera gave"):
        require_savable([between])
