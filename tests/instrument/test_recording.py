"""Recordings of a scripted camera: every frame and its index come back, and what ended them is said."""

from __future__ import annotations

import csv
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.instrument.scripted_camera import BREAK, END, ScriptedCamera
from tests.waiting import HANGS_S, until

from tsis.errors import FileInputError
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.camera import Frame
from tsis.instrument.drivers.files import ImageFiles, VideoFile
from tsis.instrument.recording import FrameFolder, FurtherColumns, LosslessVideo, read_recording_index, record

if TYPE_CHECKING:
    from pathlib import Path


def _noise(sequence: int, *, full_scale: float = 255.0) -> Frame:
    levels = np.random.default_rng(sequence).integers(0, int(full_scale) + 1, (16, 24))
    kind: Any = np.uint8 if full_scale == 255 else np.uint16
    return Frame(pixels=levels.astype(kind), sequence=sequence, time_s=sequence / 30, full_scale=full_scale)


def _recorded(tmp_path: Path, sequences: list[int | str], sink: Any = None, **options: Any) -> tuple[Any, Path]:
    """Record what a scripted camera delivers after the recording has begun."""
    camera = ScriptedCamera()
    asked = False

    def feed() -> bool:
        nonlocal asked
        if not asked:
            asked = True
            for item in sequences:
                camera.script.put(item if isinstance(item, str) else _noise(item))
        return False

    with Acquisition(lambda: camera, reconnect=False, lost_after_s=HANGS_S) as acquisition:
        report = record(acquisition, sink or FrameFolder(tmp_path), tmp_path, stopped=feed, **options)
    return report, tmp_path


def test_a_folder_gives_back_every_frame_and_its_index(tmp_path: Path) -> None:
    report, folder = _recorded(tmp_path, [0, 1, 4, END])
    assert (report.kept, report.missed, report.overrun, report.ended_by) == (3, 2, 0, "")
    source = ImageFiles(folder)
    source.open()
    source.start()
    for stored, sequence in zip(source.frames(), (0, 1, 4), strict=True):
        np.testing.assert_array_equal(stored.pixels, _noise(sequence).pixels)
    with (folder / "frames.csv").open() as index:
        rows = list(csv.DictReader(index))
    assert [int(row["sequence"]) for row in rows] == [0, 1, 4]
    assert [row["kept_in"] for row in rows] == [f"frame-{number:06d}.png" for number in range(3)]
    result = json.loads((folder / "recording.json").read_text())
    assert result["report"]["kept"] == 3
    assert result["camera"] == "scripted"


def test_a_video_is_lossless(tmp_path: Path) -> None:
    report, folder = _recorded(tmp_path, [0, 1, 2, 3, END], LosslessVideo(tmp_path, frames_per_s=30.0))
    assert (report.kept, report.ended_by) == (4, "")
    video = VideoFile(folder / "frames.mkv")
    video.open()
    video.start()
    for stored, sequence in zip(video.frames(), range(4), strict=True):
        np.testing.assert_array_equal(stored.pixels, _noise(sequence).pixels)
    video.stop()


def test_sixteen_bits_fit_a_folder_and_no_video(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    camera = ScriptedCamera()
    deep = _noise(0, full_scale=4095.0)
    with Acquisition(lambda: camera, reconnect=False, lost_after_s=HANGS_S) as acquisition:
        place = acquisition.ring.end
        camera.script.put(deep)
        camera.script.put(END)
        acquisition.ring.wait(place, HANGS_S)
        kept = FrameFolder(tmp_path / "a").save(deep, 0)
        report = record(acquisition, LosslessVideo(tmp_path / "b"), tmp_path / "b", frames=1)
    source = ImageFiles(tmp_path / "a" / kept)
    source.open()
    source.start()
    np.testing.assert_array_equal(next(iter(source.frames())).pixels, deep.pixels)
    assert report.kept == 0
    with pytest.raises(ValueError, match="at most 8 bits; got full scale 4095"):
        LosslessVideo(tmp_path / "b").save(deep, 0)


def test_a_full_disk_keeps_what_there_is_and_says_so(tmp_path: Path) -> None:
    class Full(FrameFolder):
        def save(self, frame: Frame, number: int) -> str:
            if number == 2:
                raise OSError(28, "No space left on device")
            return super().save(frame, number)

    report, folder = _recorded(tmp_path, [0, 1, 2, 3, END], Full(tmp_path))
    assert report.kept == 2
    assert "took no more frames after 2: No space left on device" in report.ended_by
    assert len(list(folder.glob("*.png"))) == 2
    assert json.loads((folder / "recording.json").read_text())["report"]["ended_by"] == report.ended_by


def test_a_lost_camera_ends_the_recording_with_its_reason(tmp_path: Path) -> None:
    report, _ = _recorded(tmp_path, [0, 1, BREAK])
    assert report.kept == 2
    assert "bulk transfer failed" in report.ended_by
    assert report.interruptions == 1


def test_a_disk_too_slow_for_the_ring_is_counted(tmp_path: Path) -> None:
    camera = ScriptedCamera()

    class Slow(FrameFolder):
        """While it keeps the first frame, nine more come into a ring of four."""

        def save(self, frame: Frame, number: int) -> str:
            if number == 0:
                for sequence in range(1, 10):
                    camera.script.put(_noise(sequence))
                camera.script.put(END)
                until(lambda: acquisition.ring.end == 10)
            return super().save(frame, number)

    def begin() -> bool:
        if camera.script.empty() and acquisition.ring.end == 0:
            camera.script.put(_noise(0))
        return False

    with Acquisition(lambda: camera, reconnect=False, ring_frames=4, lost_after_s=HANGS_S) as acquisition:
        report = record(acquisition, Slow(tmp_path), tmp_path, stopped=begin)
    assert (report.kept, report.overrun, report.missed) == (5, 5, 0)


@pytest.mark.parametrize("most", [1, 3])
def test_it_ends_after_so_many_frames(tmp_path: Path, most: int) -> None:
    report, folder = _recorded(tmp_path, list(range(8)), frames=most)
    assert report.kept == most == len(list(folder.glob("*.png")))


def test_further_columns_stand_beside_each_frame(tmp_path: Path) -> None:
    _, folder = _recorded(
        tmp_path,
        [0, 1, END],
        beside=FurtherColumns(names=("mean",), of=lambda arrival: (arrival.frame.pixels.mean(),)),
        about=lambda: {"probe": "x"},
    )
    with (folder / "frames.csv").open() as index:
        means = [float(row["mean"]) for row in csv.DictReader(index)]
    assert means == [pytest.approx(_noise(number).pixels.mean()) for number in range(2)]
    assert json.loads((folder / "recording.json").read_text())["probe"] == "x"


def test_an_index_is_never_written_over(tmp_path: Path) -> None:
    (tmp_path / "frames.csv").write_text("an older recording")
    report, folder = _recorded(tmp_path, [0, END])
    assert "took no more frames after 0: File exists" in report.ended_by
    assert (folder / "frames.csv").read_text() == "an older recording"


def test_a_frame_that_the_disk_did_not_take_whole_is_not_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = type(tmp_path).open

    def full(path: Path, *arguments: Any, **options: Any) -> Any:
        opened = real(path, *arguments, **options)
        if path.name == "frame-000001.png":
            opened.close()
            raise OSError(28, "No space left on device")
        return opened

    monkeypatch.setattr(type(tmp_path), "open", full)
    report, folder = _recorded(tmp_path, [0, 1, 2, END])
    assert report.kept == 1
    assert [file.name for file in folder.glob("*.png")] == ["frame-000000.png"]


def test_a_report_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    (tmp_path / "recording.json").mkdir()
    report, _ = _recorded(tmp_path, [0, END])
    assert report.kept == 1
    assert "recording.json could not be written" in report.ended_by


def test_counts_add_up_when_the_camera_is_lost_while_the_disk_is_behind(tmp_path: Path) -> None:
    cameras = [ScriptedCamera(), ScriptedCamera()]
    handed = iter(cameras)

    class Slow(FrameFolder):
        """While it keeps the first frame, nine more come and the camera is lost; the next one begins at 5."""

        def save(self, frame: Frame, number: int) -> str:
            if number == 0:
                for sequence in range(1, 10):
                    cameras[0].script.put(_noise(sequence))
                cameras[0].script.put(BREAK)
                until(lambda: acquisition.ring.end == 10)
                for sequence in range(5, 9):
                    cameras[1].script.put(_noise(sequence))
                cameras[1].script.put(END)
                until(lambda: acquisition.ring.end == 14)
            return super().save(frame, number)

    def begin() -> bool:
        if cameras[0].script.empty() and acquisition.ring.end == 0:
            cameras[0].script.put(_noise(0))
        return False

    with Acquisition(lambda: next(handed), ring_frames=4, retry_s=0.0) as acquisition:
        report = record(acquisition, Slow(tmp_path), tmp_path, stopped=begin)
    assert (report.kept, report.overrun, report.missed) == (5, 9, 5)
    assert report.kept + report.overrun + report.missed == 10 + 9  # as many as the two cameras numbered


def test_a_recording_gives_its_files_in_their_order_with_times_that_rise(tmp_path: Path) -> None:
    _, folder = _recorded(tmp_path, [0, 1, 2, END])
    files, times = zip(*read_recording_index(folder), strict=True)
    assert list(files) == sorted(folder.glob("*.png"))
    assert list(times) == sorted(times)


def test_times_are_those_of_the_file(tmp_path: Path) -> None:
    times_s = (0.0, 0.5, 2.0)
    rows = [f"{number},{time_s},frame-{number}.png" for number, time_s in enumerate(times_s)]
    (tmp_path / "frames.csv").write_text("\n".join(["number,arrived_s,kept_in", *rows]))
    assert read_recording_index(tmp_path) == tuple(
        (tmp_path / f"frame-{number}.png", time_s) for number, time_s in enumerate(times_s)
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "must hold data; got an empty file"),
        ("number,arrived_s,kept_in\n", "must list at least one frame with the time of its arrival"),
        ("number,kept_in\n0,frame-0.png\n", "must have the columns number, "),
        ("number,arrived_s,kept_in\n0,late,frame-0.png\n", "must have the columns number, "),
        ("number,arrived_s,kept_in\n0,nan,frame-0.png\n", "must list at least one frame with the time"),
        ("number,arrived_s,kept_in\n0,1.0,\n", "must name files beside it; got ''"),
        ("number,arrived_s,kept_in\n0,1.0,..\n", "must name files beside it; got '..'"),
        ("number,arrived_s,kept_in\n0,1.0,/etc/hostname\n", "must name files beside it; got '/etc/hostname'"),
    ],
)
def test_an_index_that_is_none_is_one_sentence(tmp_path: Path, content: str, message: str) -> None:
    (tmp_path / "frames.csv").write_text(content)
    with pytest.raises(FileInputError, match=message) as refusal:
        read_recording_index(tmp_path)
    assert "\n" not in str(refusal.value)


def test_a_folder_without_an_index_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match=r"frames\.csv"):
        read_recording_index(tmp_path)
