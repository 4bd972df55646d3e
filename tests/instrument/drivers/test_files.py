from __future__ import annotations

import subprocess
import sys
from typing import TYPE_CHECKING

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import CameraError, FileInputError, ImageMismatchError
from tsis.instrument.camera import Mode
from tsis.instrument.drivers.files import ImageFiles, VideoFile, natural_key

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.instrument.conftest import Write


def _started(path: Path) -> ImageFiles:
    source = ImageFiles(path)
    source.open()
    source.start()
    return source


def test_a_folder_is_read_in_natural_order(tmp_path: Path, write: Write) -> None:
    for number in (10, 2, 1, 33):
        write(f"frame{number}.png", np.full((4, 5), number, np.uint8))
    (tmp_path / "notes.txt").write_text("passed over")
    (tmp_path / ".frame0.png").write_bytes(b"hidden")
    frames = list(_started(tmp_path).frames())
    assert [frame.name for frame in frames] == ["frame1.png", "frame2.png", "frame10.png", "frame33.png"]
    assert [frame.sequence for frame in frames] == [0, 1, 2, 3]
    assert [int(frame.pixels[0, 0]) for frame in frames] == [1, 2, 10, 33]
    assert all(frame.time_s is None for frame in frames)


@given(st.lists(st.integers(0, 10**12), unique=True))
def test_natural_order_is_the_order_of_the_numbers(numbers: list[int]) -> None:
    names = [f"Target{number}-raw" for number in numbers]
    assert sorted(names, key=natural_key) == [f"Target{number}-raw" for number in sorted(numbers)]


@given(st.lists(st.text()))
def test_any_names_can_be_ordered(names: list[str]) -> None:
    sorted(names, key=natural_key)


def test_one_file_is_one_frame(write: Write, grey: NDArray[np.uint8]) -> None:
    source = _started(write("frame.bmp", grey))
    assert source.modes() == (Mode(width_px=17, height_px=13),)
    (frame,) = source.frames()
    np.testing.assert_array_equal(frame.pixels, grey)
    assert not source.lost


def test_frames_of_two_sizes_do_not_belong_together(tmp_path: Path, write: Write) -> None:
    write("1.png", np.zeros((4, 5), np.uint8))
    write("2.png", np.zeros((4, 6), np.uint8))
    frames = _started(tmp_path).frames()
    next(frames)
    with pytest.raises(ImageMismatchError, match=r"'2\.png' has \(4, 6\)"):
        next(frames)


def test_a_damaged_file_is_named_after_the_frames_before_it(
    tmp_path: Path, write: Write, grey: NDArray[np.uint8]
) -> None:
    write("1.png", grey)
    second = write("2.png", grey)
    second.write_bytes(second.read_bytes()[:-20])
    frames = _started(tmp_path).frames()
    next(frames)
    with pytest.raises(FileInputError, match=r"2\.png' must be a complete image file"):
        next(frames)


def test_folders_without_images_and_absent_ones_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match="must hold at least one image"):
        ImageFiles(tmp_path).open()
    with pytest.raises(FileInputError, match="does not exist"):
        ImageFiles(tmp_path / "absent").open()
    with pytest.raises(FileInputError, match="null byte"):
        ImageFiles("a\0b").open()


def test_the_order_of_calls_is_checked(write: Write, grey: NDArray[np.uint8]) -> None:
    source = ImageFiles(write("frame.png", grey))
    with pytest.raises(CameraError, match=r"call open\(\)"):
        source.start()
    source.open()
    with pytest.raises(CameraError, match=r"call start\(\)"):
        next(source.frames())
    with pytest.raises(CameraError, match="mode must be"):
        source.start(Mode(width_px=1, height_px=1))
    assert source.settings() == ()
    with pytest.raises(CameraError, match="gain cannot be set"):
        source.adjust("gain", 1.0)


def test_stopping_ends_the_stream(tmp_path: Path, write: Write, grey: NDArray[np.uint8]) -> None:
    for number in range(3):
        write(f"{number}.png", grey)
    source = _started(tmp_path)
    frames = source.frames()
    next(frames)
    source.stop()
    source.stop()
    assert list(frames) == []


FRAMES, RATE = 30, 25.0


def _written(path: Path, codec: str) -> Path:
    """A video whose frame k is plain grey of level 8 k."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), RATE, (64, 48))
    assert writer.isOpened()
    for number in range(FRAMES):
        writer.write(np.full((48, 64, 3), 8 * number, np.uint8))
    writer.release()
    return path


def _started_video(path: Path) -> VideoFile:
    source = VideoFile(path)
    source.open()
    source.start()
    return source


@pytest.mark.parametrize(
    ("name", "codec", "tolerance"), [("a.avi", "FFV1", 1.0), ("a.avi", "MJPG", 3.0), ("a.mp4", "mp4v", 4.0)]
)
def test_a_written_video_reads_back(tmp_path: Path, name: str, codec: str, tolerance: float) -> None:
    source = _started_video(_written(tmp_path / name, codec))
    assert source.modes() == (Mode(width_px=64, height_px=48, frames_per_s=RATE),)
    frames = list(source.frames())
    assert [frame.sequence for frame in frames] == list(range(FRAMES))
    assert [frame.time_s for frame in frames] == pytest.approx([number / RATE for number in range(FRAMES)])
    for number, frame in enumerate(frames):
        assert frame.pixels.shape == (48, 64)
        assert np.abs(frame.pixels - 8 * number).max() <= tolerance
    assert not source.lost


@pytest.mark.parametrize("codec", ["FFV1", "MJPG"])
@pytest.mark.parametrize("share", [0.6, 0.8, 0.95])
def test_a_cut_video_gives_its_whole_frames_and_then_an_error(tmp_path: Path, codec: str, share: float) -> None:
    path = _written(tmp_path / "a.avi", codec)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    source, frames = _started_video(path), []
    with pytest.raises(FileInputError, match=f"declares {FRAMES} frames and is cut short after"):  # noqa: PT012
        for frame in source.frames():
            frames.append(frame)  # noqa: PERF402 - the frames before the cut must stay valid
    assert 0 < len(frames) < FRAMES
    for number, frame in enumerate(frames):
        assert np.abs(frame.pixels - 8 * number).max() <= 3
    assert source.lost


def test_what_is_no_video_is_refused(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("no video\n" * 500)
    (tmp_path / "empty.mp4").touch()
    whole = _written(tmp_path / "whole.mp4", "mp4v")
    (tmp_path / "cut.mp4").write_bytes(whole.read_bytes()[:-600])
    for name, phrase in {
        "text.mp4": "must be a complete video file",
        "cut.mp4": "must be a complete video file",
        "empty.mp4": "got an empty file",
        "absent.mp4": "does not exist",
    }.items():
        with pytest.raises(FileInputError, match=phrase):
            VideoFile(tmp_path / name).open()


READER = """
import sys
from tsis.instrument.drivers.files import VideoFile
from tsis.errors import FileInputError
for path in sys.argv[1:]:
    source = VideoFile(path)
    try:
        source.open()
        source.start()
        list(source.frames())
    except FileInputError:
        pass
    else:
        sys.exit(f"{path} was accepted")
"""


@pytest.mark.system
def test_a_damaged_video_writes_nothing_on_the_terminal(tmp_path: Path) -> None:
    (tmp_path / "text.mp4").write_text("no video\n" * 500)
    paths = [tmp_path / "text.mp4"]
    for name, codec in {"a.avi": "MJPG", "b.mp4": "mp4v", "c.mkv": "FFV1"}.items():
        path = _written(tmp_path / name, codec)
        path.write_bytes(path.read_bytes()[: path.stat().st_size * 6 // 10])
        paths.append(path)
    # a process of its own: FFmpeg reads its loudness once, and the writer above has already woken it here
    ended = subprocess.run([sys.executable, "-c", READER, *paths], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "")


def test_an_address_is_never_opened() -> None:
    with pytest.raises(FileInputError, match="does not exist"):
        VideoFile("http://localhost/clip.avi").open()


def test_the_order_of_calls_is_checked_and_stopping_ends_the_stream(tmp_path: Path) -> None:
    source = VideoFile(_written(tmp_path / "a.avi", "MJPG"))
    with pytest.raises(CameraError, match=r"call open\(\)"):
        source.modes()
    source.open()
    with pytest.raises(CameraError, match=r"call start\(\)"):
        next(source.frames())
    with pytest.raises(CameraError, match="mode must be"):
        source.start(Mode(width_px=1, height_px=1))
    source.start()
    frames = source.frames()
    next(frames)
    source.stop()
    assert list(frames) == []
    assert source.settings() == ()
    with pytest.raises(CameraError, match="gain cannot be set"):
        source.adjust("gain", 1.0)


@pytest.mark.parametrize("content", [b"#EXTM3U\nother.avi\n", b"ffconcat version 1.0\nfile other.avi\n", b"\n <MPD/>"])
def test_a_list_of_other_files_is_no_video(tmp_path: Path, content: bytes) -> None:
    """A decoder would open what such a list names, which may be any file or address."""
    path = tmp_path / "a.avi"
    path.write_bytes(content)
    with pytest.raises(FileInputError, match=r"must be a video file; got a list that names other files"):
        VideoFile(path).open()
