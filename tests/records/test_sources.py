"""Image files, recordings, snapshots and folders of ``tsis demo`` are read, and believed as far as their hashes go."""

from __future__ import annotations

import csv
import json
import os
import time
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from tests.instrument.scripted_camera import END, ScriptedCamera
from tests.records.folders import WHEN, demo_levels, frame, make_demo, save, write
from tests.records.sample import sample_calibration, sample_record
from tests.waiting import HANGS_S

from tsis.calibration.file import calibration_sha256
from tsis.errors import FileInputError, InputError, RecordsError, TsisError
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.recording import FrameFolder, FurtherColumns, LosslessVideo, record
from tsis.records.importing import ImportProgress, import_batches
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store, verify_store
from tsis.records.target import write_bundle

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    from tsis.records.store import Store


WRITTEN = datetime(2026, 11, 20, 8, tzinfo=UTC)


def grey(number: int) -> NDArray[np.uint8]:
    return np.random.default_rng(number).integers(0, 256, (12, 20)).astype(np.uint8)


def image(folder: Path, number: int) -> Path:
    path = folder / f"press-{number}.png"
    cv2.imwrite(str(path), grey(number))
    os.utime(path, (WRITTEN.timestamp(), WRITTEN.timestamp()))
    return path


def test_images_come_in_with_what_was_said(tmp_path: Path) -> None:
    paths = [image(tmp_path, number) for number in range(2)]
    said = ImportOptions(role="plain", force_n=(0.5, 1.0), mm_per_pixel=(0.1, 0.2), probe="tsis-2011")
    with open_store(tmp_path / "store") as store:
        (entered,) = import_batches(store, find_import_batches(paths, said))
        for number, press in enumerate(sorted(store.presses(entered.target), key=lambda press: press.name)):
            np.testing.assert_array_equal(store.levels(press.frame), grey(number))
            assert (press.role, press.force_n, press.mm_per_pixel) == ("plain", (0.5, 1.0)[number], (0.1, 0.2))
            assert (press.name, press.probe, press.taken) == (paths[number].name, "tsis-2011", WRITTEN)
            assert len(press.settings["sha256"]) == 64


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rounds=st.lists(st.lists(st.integers(0, 5), min_size=1, max_size=8), min_size=1, max_size=4))
def test_whatever_is_imported_how_often_each_file_is_one_press(tmp_path: Path, rounds: list[list[int]]) -> None:
    folder = tmp_path / str(len(list(tmp_path.iterdir())))
    folder.mkdir()
    with open_store(folder / "store") as store:
        for numbers in rounds:
            import_batches(
                store, find_import_batches([image(folder, number) for number in numbers], ImportOptions()), target=1
            )
        names = sorted(press.name for press in store.presses(store.target(1)))
    assert names == sorted({f"press-{number}.png" for numbers in rounds for number in numbers})


def test_colours_are_refused_with_what_to_do(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "colour.png"), np.random.default_rng(1).integers(0, 256, (12, 20, 3)).astype(np.uint8))
    with pytest.raises(FileInputError, match="save it as a grey PNG file"):
        find_import_batches([tmp_path / "colour.png"], ImportOptions())


def test_grey_that_was_saved_as_colour_keeps_its_levels(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "grey.png"), np.repeat(grey(3)[..., None], 3, axis=2))
    with open_store(tmp_path / "store") as store:
        (entered,) = import_batches(store, find_import_batches([tmp_path / "grey.png"], ImportOptions()))
        np.testing.assert_array_equal(store.levels(store.presses(entered.target)[0].frame), grey(3))


def test_forces_that_fit_no_count_are_refused(tmp_path: Path) -> None:
    paths = [image(tmp_path, number) for number in range(3)]
    with pytest.raises(InputError, match="once for each of 3; got 2"):
        find_import_batches(paths, ImportOptions(force_n=(0.5, 1.0)))
    with pytest.raises(InputError, match="force_n must lie in"):
        find_import_batches(paths, ImportOptions(force_n=(1e6,)))


ENDED = datetime(2026, 11, 22, 10, 0, tzinfo=UTC)
BEGUN, BEGUN_S = datetime(2026, 11, 22, 9, 0, tzinfo=UTC), 1000.0
FRAMES = 4


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A recording that says that it began at a certain time."""
    folder = record_into(tmp_path / "recording", FrameFolder)
    os.utime(folder / "frames.csv", (ENDED.timestamp(), ENDED.timestamp()))
    told(folder, begun=BEGUN.isoformat(), begun_s=BEGUN_S)
    return folder


def record_into(folder: Path, sink: Callable[[Path], FrameFolder | LosslessVideo]) -> Path:
    """A recording by the program's own recorder, with a force of each frame but the last."""
    folder.mkdir()
    camera, begun = ScriptedCamera(), False

    def feed() -> bool:
        nonlocal begun
        if not begun:
            begun = True
            for number in range(FRAMES):
                camera.script.put(frame(number))
            camera.script.put(END)
        return False

    beside = FurtherColumns(
        names=("force_n", "force_error_n"),
        of=lambda arrival: ("", "") if arrival.frame.sequence == FRAMES - 1 else (f"{arrival.frame.sequence - 1}", "0"),
    )
    with Acquisition(lambda: camera, reconnect=False, lost_after_s=HANGS_S) as acquisition:
        record(acquisition, sink(folder), folder, stopped=feed, beside=beside)
    return folder


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "frames.csv").open(newline="") as index:
        return list(csv.DictReader(index))


def write_rows(folder: Path, given: list[dict[str, str]]) -> None:
    with (folder / "frames.csv").open("w", newline="") as index:
        writer = csv.DictWriter(index, given[0])
        writer.writeheader()
        writer.writerows(given)


def test_a_recording_comes_in_with_its_times_and_forces(tmp_path: Path, recorded: Path) -> None:
    with open_store(tmp_path / "store") as store:
        (entered,) = import_batches(store, find_import_batches([recorded], ImportOptions(mm_per_pixel=(0.1, 0.1))))
        assert (entered.new, entered.added) == (True, FRAMES)
        presses = store.presses(entered.target)
        assert [press.settings["sequence"] for press in presses] == [str(number) for number in range(FRAMES)]
        assert [press.force_n for press in presses] == [0.0, 0.0, 1.0, None]  # a press does not pull
        arrived = [float(row["arrived_s"]) for row in rows(recorded)]
        for number, (press, then) in enumerate(zip(presses, arrived, strict=True)):
            np.testing.assert_array_equal(store.levels(press.frame), frame(number).pixels)
            assert (BEGUN - press.taken) / timedelta(seconds=1) == pytest.approx(BEGUN_S - then, abs=2e-6)
        (again,) = import_batches(store, find_import_batches([recorded], ImportOptions()))
        assert (again.target, again.added, again.present) == (entered.target, 0, FRAMES)


def told(folder: Path, **changes: Any) -> None:
    document = json.loads((folder / "recording.json").read_text()) | changes
    kept = {name: value for name, value in document.items() if value is not ...}
    (folder / "recording.json").write_text(json.dumps(kept))


def test_the_recorder_tells_when_it_began(tmp_path: Path) -> None:
    before, before_s = datetime.now(UTC), time.monotonic()
    folder = record_into(tmp_path / "now", FrameFolder)
    after = datetime.now(UTC)
    (found,) = find_import_batches([folder], ImportOptions())
    for press, row in zip(found.presses, rows(folder), strict=True):
        assert before <= press.taken <= after
        away = (press.taken - before) / timedelta(seconds=1) - (float(row["arrived_s"]) - before_s)
        assert abs(away) < 0.1  # the two clocks were read one after the other


def test_a_recording_stays_the_same_one_when_its_files_are_copied(tmp_path: Path, recorded: Path) -> None:
    with open_store(tmp_path / "store") as store:
        (before,) = import_batches(store, find_import_batches([recorded], ImportOptions()))
        os.utime(recorded / "frames.csv", (1e9, 1e9))
        (again,) = find_import_batches([recorded], ImportOptions())
        assert [each.taken for each in again.presses] == [press.taken for press in before.presses]


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"begun": "noon"}, "begun must be a date"),
        ({"begun": "2026-11-22T10:00:00"}, "time zone"),
        ({"begun_s": "x"}, "begun_s must be a number"),
        ({"begun": ...}, "must tell when it began"),
        ({"begun_s": ...}, "must tell when it began"),
        ({"begun_s": 1e300}, "times of a recording must lie within it"),
    ],
)
def test_a_beginning_that_is_none_is_refused(recorded: Path, changes: dict[str, Any], sentence: str) -> None:
    told(recorded, **changes)
    with pytest.raises(FileInputError, match=sentence):
        find_import_batches([recorded], ImportOptions())


def test_a_recording_that_was_cut_short_comes_in_and_says_so(recorded: Path) -> None:
    (recorded / "recording.json").unlink()
    (found,) = find_import_batches([recorded], ImportOptions())
    assert len(found.presses) == FRAMES
    assert "cut short" in found.notes[0]
    assert found.presses[-1].taken == ENDED


def test_a_video_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match="record without --video"):
        find_import_batches([record_into(tmp_path / "video", LosslessVideo)], ImportOptions())


@pytest.mark.parametrize(
    ("column", "value", "sentence"),
    [
        ("kept_in", "../../etc/passwd", "must name files of its own"),
        ("kept_in", "", "must name files of its own"),
        ("kept_in", "absent.png", "does not exist"),
        ("kept_in", "frame-000000.png", "must name every frame once"),
        ("arrived_s", "", "must hold a finite arrived_s; line 3"),
        ("arrived_s", "nan", "must hold a finite arrived_s"),
        ("arrived_s", "-1e300", "times of a recording must lie within it"),
        ("force_n", "1e999", "must hold a finite force_n"),
        ("force_n", "500", "force_n must lie in"),
    ],
)
def test_an_index_that_tells_nonsense_is_refused(recorded: Path, column: str, value: str, sentence: str) -> None:
    changed = rows(recorded)
    changed[1][column] = value
    write_rows(recorded, changed)
    with pytest.raises(ValueError, match=sentence):
        find_import_batches([recorded], ImportOptions())


def test_an_index_of_fewer_frames_than_the_report_is_refused(recorded: Path) -> None:
    write_rows(recorded, rows(recorded)[:-1])
    with pytest.raises(FileInputError, match=r"must tell of the 4 frames of the report; it tells of 3"):
        find_import_batches([recorded], ImportOptions())


@pytest.mark.parametrize("content", [b"", b"number\n", b"\xff\xfe", b"a,b\n1,2\n", b'"'])
def test_an_index_that_is_none_is_refused(recorded: Path, content: bytes) -> None:
    (recorded / "frames.csv").write_bytes(content)
    with pytest.raises(FileInputError, match=r"frames\.csv"):
        find_import_batches([recorded], ImportOptions())


def test_a_report_of_another_format_is_refused(recorded: Path) -> None:
    document = json.loads((recorded / "recording.json").read_text()) | {"version": 9}
    (recorded / "recording.json").write_text(json.dumps(document))
    with pytest.raises(FileInputError, match="must be of tsis-recording 1; got 'tsis-recording' 9"):
        find_import_batches([recorded], ImportOptions())


@pytest.fixture
def demo(tmp_path: Path) -> Path:
    return make_demo(tmp_path / "tsis-demo")


def changed(folder: Path, *place: str | int, to: Any) -> None:
    document = json.loads((folder / "result.json").read_text())
    inner = document
    for step in place[:-1]:
        inner = inner[step]
    if to is ...:
        del inner[place[-1]]
    else:
        inner[place[-1]] = to
    write(folder, document)


PROVENANCE = ("estimate", "provenance")


def test_presses_get_their_roles_and_the_phantom_its_truth(demo: Path) -> None:
    (found,) = find_import_batches([demo], ImportOptions())
    roles = [(press.name, press.role) for press in found.presses]
    assert roles == [
        ("target-0.5N.png", "target"),
        ("target-1N.png", "target"),
        ("reference-1N.png", "plain"),
        ("untouched.png", "untouched"),
    ]
    assert (found.name, found.truth) == ("size-8", {"diameter_mm": 8.0, "depth_mm": 5.0, "young_kpa": 80.0})
    assert found.estimate is not None
    assert found.estimate.probe == "tsis-domed"
    taken = [press.taken for press in found.presses]
    assert taken == sorted(set(taken))


def test_plain_tissue_has_no_truth(demo: Path) -> None:
    changed(demo, "simulated", "phantom", "inclusion", to=None)
    (found,) = find_import_batches([demo], ImportOptions())
    assert found.truth == {}


def test_a_frame_that_is_not_the_estimated_one_is_refused(demo: Path) -> None:
    cv2.imwrite(str(demo / "target-1N.png"), demo_levels(7))
    with pytest.raises(FileInputError, match=r"target-1N\.png.*must be the frame that was estimated"):
        find_import_batches([demo], ImportOptions())


def test_virtual_presses_stay_out_of_a_store_of_subjects(demo: Path, tmp_path: Path) -> None:
    with (
        open_store(tmp_path / "subjects", kind="subject") as store,
        pytest.raises(InputError, match="must go into a store of phantoms"),
    ):
        import_batches(store, find_import_batches([demo], ImportOptions()))


def test_the_folder_of_another_command_says_what_to_do(demo: Path) -> None:
    changed(demo, "command", to="examine")
    with pytest.raises(FileInputError, match="repeat the command with --save"):
        find_import_batches([demo], ImportOptions())


@pytest.mark.parametrize(
    ("place", "to", "sentence"),
    [
        (("command",), ..., "must be of tsis demo"),
        (("estimate",), ..., "it holds no 'estimate'"),
        (("estimate",), None, "must be as tsis demo wrote it"),
        (("simulated", "phantom"), [], "must be as tsis demo wrote it"),
        (("simulated", "phantom", "inclusion", "depth_mm"), "deep", "inclusion.depth_mm must be a number"),
        ((*PROVENANCE, "images"), [], "must tell of a press on the phantom"),
        ((*PROVENANCE, "images", 0, "name"), "../../etc/passwd", "must name files of its own"),
        ((*PROVENANCE, "images", 0, "name"), "absent.png", "does not exist"),
        ((*PROVENANCE, "images", 0, "force_n"), -3.0, "force_n must lie in"),
        ((*PROVENANCE, "images", 0, "mm_per_pixel"), [0.0, 0.1], "mm_per_pixel must lie in"),
        ((*PROVENANCE, "images", 0, "settings"), "x", "must be as tsis demo wrote it"),
        ((*PROVENANCE, "probe", "name"), "tsis-dommed", "did you mean 'tsis-domed'"),
        ((*PROVENANCE, "prior", "depth_mm"), [12.0, 4.0], "the high end of depth_mm"),
        ((*PROVENANCE, "prior"), None, "must be as tsis demo wrote it"),
    ],
)
def test_a_result_that_tells_nonsense_is_refused(
    demo: Path, place: tuple[str | int, ...], to: Any, sentence: str
) -> None:
    changed(demo, *place, to=to)
    with pytest.raises(ValueError, match=sentence) as refused:
        find_import_batches([demo], ImportOptions())
    assert "\n" not in str(refused.value)


def test_a_changed_calibration_is_refused(demo: Path) -> None:
    content = (demo / "calibration.json").read_text()
    (demo / "calibration.json").write_text(content.replace("2.0", "3.0", 1))
    with pytest.raises(Exception, match="does not match its hash"):
        find_import_batches([demo], ImportOptions())


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


SAID: dict[str, Any] = {
    "--role": {"role": "plain"},
    "--force-n": {"force_n": (1.2,)},
    "--scale-mm": {"mm_per_pixel": (0.1, 0.1)},
    "--probe": {"probe": "tsis-2011"},
    "--calibration": {"calibration": sample_calibration()},
    "--taken": {"taken": WHEN},
}


@pytest.mark.parametrize("option", SAID)
def test_what_a_demo_or_a_bundle_says_itself_is_not_said_again(tmp_path: Path, demo: Path, option: str) -> None:
    write_bundle(sample_record(), tmp_path / "bundle.zip")
    write_bundle(sample_record(), tmp_path / "bundle")
    sources = {"tsis-demo": "a folder of tsis demo", "bundle.zip": "a bundle", "bundle": "a bundle"}
    for name, kind in sources.items():
        with pytest.raises(InputError, match=f"{option} must not be given for .*{name}', {kind}, which says it itself"):
            find_import_batches([tmp_path / name], ImportOptions(**SAID[option]))


@pytest.mark.parametrize("option", ["--force-n", "--taken"])
def test_a_snapshot_and_a_recording_say_force_and_time_themselves(tmp_path: Path, recorded: Path, option: str) -> None:
    save(tmp_path / "shots", 1)
    for source in (tmp_path / "shots", recorded):
        with pytest.raises(InputError, match=f"{option} must not be given for "):
            find_import_batches([source], ImportOptions(**SAID[option]))


def test_a_snapshot_of_another_role_refuses_it(tmp_path: Path) -> None:
    saved = save(tmp_path, 1)
    rewrite(saved.sidecar, role="untouched")
    with pytest.raises(InputError, match=r"--role must not be given for .*, a snapshot of role 'untouched', which"):
        find_import_batches([tmp_path], ImportOptions(role="plain"))
    for role in (None, "untouched"):
        (found,) = find_import_batches([tmp_path], ImportOptions(role=role))
        assert found.presses[0].role == "untouched"
