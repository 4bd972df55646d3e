"""Which target frames go to, what is saved here and now, and what a second import adds."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.records.folders import SIZE_8, demo_levels, make_demo, save
from tests.records.sample import levels, sample_calibration, sample_estimate

from tsis.calibration.file import calibration_sha256, write_calibration
from tsis.calibration.frames import load_calibration
from tsis.errors import FileInputError, InputError, RecordsError
from tsis.files.atomic import Disk
from tsis.model.image import TactileImage
from tsis.records.importing import (
    ImportProgress,
    SavableResult,
    import_batches,
    require_savable,
    save_results,
    save_snapshot_to_store,
    saved_notes,
)
from tsis.records.sources import ImportOptions, find_import_batches, stored_calibration
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store


HARD = {"diameter_mm": 10.0, "depth_mm": 5.0, "young_kpa": 100.0}


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Store]:
    """Where an estimate costs nothing."""

    monkeypatch.setattr("tsis.records.recomputation.estimate_stored", lambda *_: sample_estimate())
    with open_store(tmp_path / "phantoms") as opened:
        yield opened


@pytest.fixture
def two(tmp_path: Path) -> list[Path]:
    """Two phantoms pressed with one seed, so that they share every frame but those of the phantom itself."""
    one = make_demo(tmp_path / "d1", phantom="hardness-100", truth=HARD, pressed=0)
    return [one, make_demo(tmp_path / "d2", phantom="size-8", truth=SIZE_8, pressed=20)]


@pytest.mark.parametrize("together", [True, False])
@pytest.mark.parametrize("apart", [True, False])
def test_two_phantoms_of_one_seed_are_two_targets_with_their_own_truth(
    store: Store, two: list[Path], *, together: bool, apart: bool
) -> None:
    for paths in [two] if together else [[two[0]], [two[1]]]:
        assert all(
            each.new for each in import_batches(store, find_import_batches(paths, ImportOptions()), difference=apart)
        )
    first, second = (store.target(number) for number in (1, 2))
    assert (first.name, dict(first.truth)) == ("hardness-100", HARD)
    assert (second.name, dict(second.truth)) == ("size-8", SIZE_8)
    one, other = store.presses(first), store.presses(second)
    assert len(one) == len(other) == 4
    assert len({press.id for press in (*one, *other)}) == 8
    assert len({press.frame for press in (*one, *other)}) == 6  # what they share is one file, pressed in both
    assert [len(store.estimates(target)) for target in (first, second)] == [1, 1]
    assert verify_store(store).sound


def test_the_same_folders_again_add_nothing(store: Store, two: list[Path]) -> None:
    import_batches(store, find_import_batches(two, ImportOptions()))
    head = verify_store(store).head
    for paths in (two, two[::-1], [two[1]]):
        for each in import_batches(store, find_import_batches(paths, ImportOptions())):
            assert (each.new, each.added, each.present, each.estimates, each.batch.notes) == (False, 0, 4, 0, ())
            assert each.target.name == each.batch.name
    assert verify_store(store).head == head


def test_a_new_target_is_new_though_every_frame_is_known(store: Store, two: list[Path]) -> None:
    for number in (1, 2):
        (entered,) = import_batches(store, find_import_batches([two[0]], ImportOptions()), difference=True)
        assert (entered.target.number, entered.new, entered.added, entered.present) == (number, True, 4, 0)


@pytest.mark.parametrize("after", range(5))
def test_a_demo_that_was_cut_short_goes_on_beside_one_that_shares_its_frames(
    store: Store, two: list[Path], monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    import_batches(store, find_import_batches([two[0]], ImportOptions()))
    whole, count = store.add_press, 0

    def pulled_out(*arguments: Any, **options: Any) -> Any:
        nonlocal count
        if count == after:
            raise RecordsError("pulled out")
        count += 1
        return whole(*arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(store, "add_press", pulled_out)
        if after < 4:
            with pytest.raises(RecordsError, match=f"{after} of 4 presses are stored"):
                import_batches(store, find_import_batches([two[1]], ImportOptions()))
    (entered,) = import_batches(store, find_import_batches([two[1]], ImportOptions()))
    own = [each for each in store.targets() if each.target.id == entered.target.id]
    assert [each.presses for each in own] == [4]
    assert dict(entered.target.truth) == SIZE_8
    assert len(store.presses(store.target(1))) == 4


def test_a_new_target_that_was_cut_short_says_how_to_go_on(
    store: Store, two: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, stored = store.add_press, list[Any]()

    def pulled_out(*arguments: Any, **options: Any) -> Any:
        if stored:
            raise RecordsError("pulled out")
        stored.append(whole(*arguments, **options))
        return stored[0]

    monkeypatch.setattr(store, "add_press", pulled_out)
    with pytest.raises(RecordsError, match=r"the last in target 1 \(go on with --target 1 for its files\)"):
        import_batches(store, find_import_batches([two[0]], ImportOptions()), difference=True, tally=ImportProgress())


def test_no_empty_target_is_left_where_nothing_could_be_stored(
    store: Store, two: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_: Disk, __: Any, ___: bytes) -> None:
        raise OSError(28, "No space left on device")

    looked = find_import_batches(two, ImportOptions())
    monkeypatch.setattr(Disk, "write", full)
    with pytest.raises(RecordsError, match=r"No space left on device .*; 0 of 8 presses are stored"):
        import_batches(store, looked)
    assert store.targets() == ()


def test_another_truth_of_a_named_target_is_said(store: Store, two: list[Path]) -> None:
    import_batches(store, find_import_batches([two[0]], ImportOptions()))
    (entered,) = import_batches(store, find_import_batches([two[1]], ImportOptions()), target=1)
    assert any("target 1 has another truth than these frames came with" in note for note in entered.batch.notes)


def test_what_is_said_otherwise_of_a_press_that_is_there_is_told(tmp_path: Path, store: Store) -> None:
    for number in range(3):
        save(tmp_path, number)
    import_batches(store, find_import_batches([tmp_path / "Target3"], ImportOptions()))
    (same,) = import_batches(store, find_import_batches([tmp_path / "Target3"], ImportOptions()))
    assert same.batch.notes == ()
    said = ImportOptions(role="plain", mm_per_pixel=(0.1, 0.1), calibration=sample_calibration())
    (again,) = import_batches(store, find_import_batches([tmp_path / "Target3"], said))
    assert [note.split(" that ")[0] for note in again.batch.notes] == [
        "role of 3",
        "mm_per_pixel of 3",
        "calibration of 3",
    ]
    assert "tsis records edit 3 --press" in again.batch.notes[0]
    assert "--target new" in again.batch.notes[1]
    assert {press.role for press in store.presses(store.target(3))} == {"target"}


def test_another_packing_of_the_same_file_is_the_same_press(
    tmp_path: Path, store: Store, two: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    save(tmp_path / "snapshots", 1)
    paths = [*two, tmp_path / "snapshots"]
    before = import_batches(store, find_import_batches(paths, ImportOptions()))
    frames = {press.frame for each in before for press in each.presses}
    monkeypatch.setattr("tsis.records.blobs.QUICK_PNG", 9)
    looked = find_import_batches(paths, ImportOptions())
    assert not frames & {each.frame for batch in looked for each in batch.presses}
    after = import_batches(store, looked)
    assert [(each.new, each.added) for each in after] == [(False, 0)] * 3
    assert [each.target.id for each in after] == [each.target.id for each in before]


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rounds=st.lists(st.sets(st.integers(0, 5), min_size=1), min_size=1, max_size=4))
def test_images_join_a_target_only_where_it_holds_all_of_them_or_nothing_else(
    tmp_path: Path, rounds: list[set[int]]
) -> None:
    folder = tmp_path / str(len(list(tmp_path.iterdir())))
    folder.mkdir()
    model: list[set[int]] = []
    with open_store(folder / "store") as store:
        for numbers in rounds:
            paths = [folder / f"press-{number}.png" for number in sorted(numbers)]
            for number, path in zip(sorted(numbers), paths, strict=True):
                cv2.imwrite(str(path), demo_levels(number))
                os.utime(path, (1e9, 1e9 + number))
            (entered,) = import_batches(store, find_import_batches(paths, ImportOptions()))
            fitting = [each for each in model if numbers <= each or each <= numbers]
            most = max((len(each & numbers) for each in fitting), default=0)
            own = next((each for each in fitting if len(each & numbers) == most), None)
            assert entered.new == (own is None)
            if own is None:
                model.append(own := set(numbers))
            own |= numbers
            assert entered.target.number == 1 + next(at for at, each in enumerate(model) if each is own)
        for number, expected in enumerate(model, start=1):
            names = {press.name for press in store.presses(store.target(number))}
            assert names == {f"press-{one}.png" for one in expected}


def test_a_calibration_that_is_damaged_is_not_taken_for_one_that_is_not_there(tmp_path: Path, store: Store) -> None:
    known = sample_calibration()
    save(tmp_path, 1, calibration={"name": "bench", "sha256": calibration_sha256(known)})
    import_batches(store, find_import_batches([tmp_path / "Target3"], ImportOptions(calibration=known)))
    held = stored_calibration(store, calibration_sha256(known))
    assert held is not None
    assert calibration_sha256(held) == calibration_sha256(known)
    assert stored_calibration(store, calibration_sha256(replace(known, name="other"))) is None
    for path in (store.folder / "files").glob("*/*.json"):
        path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(RecordsError, match="does not match its name"):
        stored_calibration(store, calibration_sha256(known))


def test_it_is_kept_as_an_import_brings_it(tmp_path: Path) -> None:
    saved = save(tmp_path / "camera", 1)
    with open_store(tmp_path / "here") as here, open_store(tmp_path / "imported") as imported:
        said = save_snapshot_to_store(here, saved.sidecar, role="plain", probe="tsis-domed", calibration=None)
        (entered,) = import_batches(
            imported, find_import_batches([tmp_path / "camera"], ImportOptions(role="plain", probe="tsis-domed"))
        )
        (press,), (other,) = here.presses(here.target(3)), imported.presses(entered.target)
        assert (said["target"], said["press"]) == (3, press.id)
        assert said["store"] == str((tmp_path / "here").resolve())
        for name in ("role", "probe", "frame", "taken", "force_n", "flags", "calibration", "settings"):
            assert getattr(press, name) == getattr(other, name), name


def test_the_calibration_tells_the_probe_and_is_kept_with_it(tmp_path: Path) -> None:
    known = sample_calibration()
    write_calibration(known, tmp_path / "calibration.json")
    with_it = load_calibration(tmp_path / "calibration.json")
    saved = save(tmp_path / "camera", 1, calibration=with_it.citation())
    with open_store(tmp_path / "records") as store:
        said = save_snapshot_to_store(store, saved.sidecar, role="target", probe="tsis-domed", calibration=with_it)
        (press,) = store.presses(store.target(3))
        assert press.probe == known.probe == "tsis-2011"
        assert calibration_sha256(store.calibration(press.calibration or "")) == with_it.identity
        assert said["notes"] == []


def test_a_sidecar_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with open_store(tmp_path / "records") as store:
        with pytest.raises(FileInputError, match=r"absent\.json"):
            save_snapshot_to_store(store, tmp_path / "absent.json", role="target", probe="", calibration=None)
        assert store.targets() == ()


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
