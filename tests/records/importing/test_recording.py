"""Recordings of ``tsis acquire`` get into a store frame by frame."""

from __future__ import annotations

import csv
import json
import os
import time
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.instrument.scripted_camera import END, ScriptedCamera
from tests.records.importing.snapshot_folder import frame
from tests.waiting import HANGS_S

from tsis.errors import FileInputError
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.recording import FrameFolder, FurtherColumns, LosslessVideo, record
from tsis.records.importing import import_batches
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

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
