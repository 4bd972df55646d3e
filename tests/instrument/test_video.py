"""Frames of a video file against those that were written."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import FileInputError
from tsis.instrument.video import Video, opened_video

FRAMES = np.random.default_rng(3).integers(0, 256, (6, 24, 32, 3), dtype=np.uint8)  # red first


def written(file: Path) -> Path:
    """A video without loss."""
    writer = cv2.VideoWriter(str(file), cv2.VideoWriter.fourcc(*"FFV1"), 10.0, (32, 24))
    for frame in FRAMES:
        writer.write(frame[..., ::-1])
    writer.release()
    return file


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written(tmp_path_factory.mktemp("video") / "six.avi")


@given(numbers=st.lists(st.integers(0, 5), min_size=1, max_size=8))
def test_frames_are_those_that_were_written_in_any_order(file: Path, numbers: list[int]) -> None:
    video = Video(file)
    assert video.count == len(FRAMES)
    for number in numbers:
        np.testing.assert_array_equal(video.levels(number), FRAMES[number])


def test_a_frame_behind_the_end_is_refused_and_those_before_it_are_still_read(file: Path) -> None:
    video = Video(file)
    with pytest.raises(FileInputError, match=r"frame 6 of six\.avi must be decodable; the video ends or breaks before"):
        video.levels(6)
    np.testing.assert_array_equal(video.levels(2), FRAMES[2])


@pytest.mark.parametrize("content", [b"", b"no video", b"RIFF" + bytes(200)])
def test_other_files_are_refused(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        other = Path(folder) / "other.avi"
        other.write_bytes(content)
        with pytest.raises(FileInputError, match=r"must (be a video that can be decoded|hold data)"):
            Video(other)


def test_an_absent_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileInputError, match="absent"):
        Video(tmp_path / "absent.avi")


def test_a_file_that_changed_is_opened_anew(file: Path, tmp_path: Path) -> None:
    same = tmp_path / "film.avi"
    same.write_bytes(file.read_bytes())
    np.testing.assert_array_equal(opened_video(same).levels(1), FRAMES[1])
    writer = cv2.VideoWriter(str(same), cv2.VideoWriter.fourcc(*"FFV1"), 10.0, (32, 24))
    for _ in range(9):
        writer.write(np.full((24, 32, 3), 90, np.uint8))
    writer.release()
    assert opened_video(same).count == 9
    assert (opened_video(same).levels(1) == 90).all()
