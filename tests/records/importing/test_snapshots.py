"""Snapshots of ``tsis acquire`` get into a store as they were taken, each once."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.records.importing.snapshot_folder import WHEN, frame, save
from tests.records.sample import sample_calibration

from tsis.calibration.file import calibration_sha256
from tsis.errors import FileInputError, InputError, RecordsError, TsisError
from tsis.records.importing import ImportProgress, import_batches
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tsis.records.store import Store


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with open_store(tmp_path / "phantoms") as opened:
        yield opened


def rewrite(sidecar: Path, **changes: Any) -> None:
    document = json.loads(sidecar.read_text()) | changes
    sidecar.write_text(json.dumps({name: value for name, value in document.items() if value is not Ellipsis}))


def test_a_folder_comes_in_with_all_that_its_sidecars_say(tmp_path: Path, store: Store) -> None:
    for number in range(3):
        save(tmp_path, number, force_n=0.1 * number)
    save(tmp_path, 9, target=4, force_n=None)
    entered = import_batches(
        store, find_import_batches([tmp_path], ImportOptions(role="plain", mm_per_pixel=(0.1, 0.2)))
    )
    assert [(each.target.number, each.new, each.added, each.present) for each in entered] == [
        (3, True, 3, 0),
        (4, True, 1, 0),
    ]
    presses = store.presses(store.target(3))
    for number, press in enumerate(presses):
        np.testing.assert_array_equal(store.levels(press.frame), frame(number).pixels)
        assert (press.role, press.mm_per_pixel, press.flags) == ("plain", (0.1, 0.2), ("moving",))
        assert press.taken == WHEN + timedelta(seconds=number)
        assert press.force_n == pytest.approx(0.1 * number)
        assert press.settings["exposure_ms"] == 10.0
        assert press.settings["camera"] == "scripted"
    assert store.presses(store.target(4))[0].force_n is None
    assert verify_store(store).sound


def test_a_camera_of_twelve_bits_keeps_its_full_scale(tmp_path: Path, store: Store) -> None:
    save(tmp_path, 1, full_scale=4095.0)
    import_batches(store, find_import_batches([tmp_path], ImportOptions()))
    (press,) = store.presses(store.target(3))
    assert press.full_scale == 4095.0
    np.testing.assert_array_equal(store.levels(press.frame), frame(1, full_scale=4095.0).pixels)


def test_again_it_is_there_already_whichever_of_its_files_is_named(tmp_path: Path, store: Store) -> None:
    saved = save(tmp_path, 1)
    for paths in ([tmp_path], [saved.sidecar], [saved.raw], [saved.colour, saved.raw, saved.sidecar, tmp_path]):
        import_batches(store, find_import_batches(paths, ImportOptions()))
    assert len(store.presses(store.target(3))) == 1
    import_batches(store, find_import_batches([tmp_path], ImportOptions()), target=8)
    assert len(store.presses(store.target(8))) == 1  # another target was asked for by name


def test_apart_means_a_new_target_whatever_the_files_say(tmp_path: Path, store: Store) -> None:
    save(tmp_path, 1)
    (entered,) = import_batches(store, find_import_batches([tmp_path], ImportOptions()), difference=True)
    assert (entered.target.number, entered.new) == (1, True)
    (again,) = import_batches(store, find_import_batches([tmp_path], ImportOptions()), difference=True)
    assert (again.target.number, again.new, again.present) == (2, True, 0)


def test_equal_frames_of_one_folder_are_presses_of_their_own(tmp_path: Path, store: Store) -> None:
    names = {save(tmp_path / "a", 1).raw.name for _ in range(2)}  # the same moment gives another name
    assert len(names) == 2
    entered = import_batches(store, find_import_batches([tmp_path / "a"], ImportOptions()))
    assert entered[0].added == 2
    assert import_batches(store, find_import_batches([tmp_path / "a"], ImportOptions()))[0].present == 2


def test_a_cited_calibration_is_asked_for_found_or_refused(tmp_path: Path, store: Store) -> None:
    known = sample_calibration()
    save(tmp_path, 1, calibration={"name": "bench", "sha256": calibration_sha256(known)})
    (alone,) = find_import_batches([tmp_path], ImportOptions())
    assert "is not in this store: give its file by --calibration" in alone.notes[0]
    assert alone.presses[0].calibration is None
    (found,) = find_import_batches([tmp_path], ImportOptions(calibration_of={calibration_sha256(known): known}.get))
    assert found.presses[0].calibration is known
    assert found.presses[0].probe == "tsis-2011"
    (given,) = find_import_batches([tmp_path], ImportOptions(calibration=known))
    assert given.notes == ()
    import_batches(store, [given])
    assert calibration_sha256(
        store.calibration(store.presses(store.target(3))[0].calibration or "")
    ) == calibration_sha256(known)
    with pytest.raises(InputError, match=r"must be the one that .* cites"):
        find_import_batches([tmp_path], ImportOptions(calibration=replace(known, name="other")))


def test_a_snapshot_that_was_cut_short_is_left_out_and_said(tmp_path: Path) -> None:
    save(tmp_path, 1)
    (tmp_path / "Target3" / "Target3-112226-093059.json").touch()
    (found,) = find_import_batches([tmp_path], ImportOptions())
    assert len(found.presses) == 1
    assert "1 snapshots in" in found.notes[0]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"version": 2}, "version must be 1"),
        ({"target": 0}, "target must lie in"),
        ({"target": "../3"}, "target must be a whole number"),
        ({"sha256": {"-raw.bmp": "0" * 64}}, "does not match its sidecar"),
        ({"sha256": {"-raw.exe": "0" * 64}}, "must tell of a raw frame"),
        ({"sha256": None}, "must be as tsis acquire wrote it"),
        ({"taken": "yesterday"}, "taken must be a date and time"),
        ({"taken": "2026-11-22T09:30:00"}, "taken must have a time zone"),
        ({"taken": ...}, "it holds no 'taken'"),
        ({"full_scale": 1e9}, "full_scale must lie in"),
        ({"full_scale": 7.0}, "must hold the grey levels"),
        ({"settings": [1, 2]}, "must be as tsis acquire wrote it"),
        ({"settings": {"deep": 2**70}}, "at most 64 bits"),
        ({"settings": {"$number": "nan"}}, "none of them '$number'"),
        ({"force": {"force_n": 1e9}}, "force_n must lie in"),
        ({"force": "strong"}, "must be as tsis acquire wrote it"),
        ({"flags": [{"name": "\x1b[2J"}]}, "flag must be printable"),
        ({"flags": 5}, "must be as tsis acquire wrote it"),
        ({"calibration": "bench"}, "must cite its calibration by its SHA-256"),
    ],
)
def test_a_sidecar_that_tells_nonsense_is_refused_before_anything_is_stored(
    tmp_path: Path, store: Store, changes: dict[str, Any], sentence: str
) -> None:
    save(tmp_path, 1)
    rewrite(save(tmp_path, 2).sidecar, **changes)
    with pytest.raises(FileInputError) as refused:
        import_batches(store, find_import_batches([tmp_path], ImportOptions()))
    assert sentence in str(refused.value)
    assert store.targets() == ()


def test_a_link_instead_of_a_frame_is_refused(tmp_path: Path) -> None:
    saved, other = save(tmp_path, 1), save(tmp_path / "else", 1)
    saved.raw.unlink()
    saved.raw.symlink_to(other.raw)
    with pytest.raises(FileInputError, match="it is a link that leads elsewhere"):
        find_import_batches([tmp_path], ImportOptions())


def test_a_frame_that_changes_between_looking_and_storing_is_noticed(tmp_path: Path, store: Store) -> None:
    save(tmp_path, 1)
    saved, other = save(tmp_path, 2), save(tmp_path / "else", 3)
    looked = find_import_batches([tmp_path], ImportOptions())
    saved.raw.write_bytes(other.raw.read_bytes())
    with pytest.raises(RecordsError) as result:
        import_batches(store, looked)
    assert "it was changed meanwhile; 1 of 2 presses are stored and stay" in str(result.value)
    assert len(store.presses(store.target(3))) == 1
    assert verify_store(store).sound


def test_an_import_that_ends_early_goes_on_where_it_ended(
    tmp_path: Path, store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    for number in range(4):
        save(tmp_path, number)
    looked, whole = find_import_batches([tmp_path], ImportOptions()), store.add_press
    stored: list[Any] = []

    def pulled_out(*arguments: Any, **options: Any) -> Any:
        if len(stored) == 2:
            raise KeyboardInterrupt
        stored.append(whole(*arguments, **options))
        return stored[-1]

    monkeypatch.setattr(store, "add_press", pulled_out)
    tally = ImportProgress()
    with pytest.raises(KeyboardInterrupt):
        import_batches(store, looked, tally=tally)
    assert tally.message == "2 of 4 presses are stored and stay (the same import goes on from there)"
    monkeypatch.undo()
    (entered,) = import_batches(store, find_import_batches([tmp_path], ImportOptions()))
    assert (entered.added, entered.present) == (2, 2)
    assert [press.settings["sequence"] for press in store.presses(entered.target)] == [0, 1, 2, 3]


@pytest.mark.parametrize("name", ["absent", "absent.json", "absent.png", "absent.zip"])
def test_what_is_not_there_is_one_sentence(tmp_path: Path, name: str) -> None:
    with pytest.raises(TsisError, match="absent"):
        find_import_batches([tmp_path / name], ImportOptions())


def test_a_folder_of_nothing_that_is_known_says_what_may_be_imported(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    with pytest.raises(FileInputError, match="must be a folder that tsis wrote"):
        find_import_batches([tmp_path], ImportOptions())


def test_an_unknown_role_is_refused_at_once(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no role of a press is called 'palin'; did you mean 'plain'"):
        find_import_batches([tmp_path], ImportOptions(role="palin"))
