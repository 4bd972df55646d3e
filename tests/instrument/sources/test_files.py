from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import CameraError, FileInputError, ImageMismatchError
from tsis.instrument.camera import Mode
from tsis.instrument.drivers.files import ImageFiles, natural_key

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
