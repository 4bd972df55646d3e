"""The index of a recording as it is read: what was written, and one sentence where there is none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.instrument.scripted_camera import END, ScriptedCamera
from tests.waiting import HANGS_S

from tsis.errors import FileInputError
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.camera import Frame
from tsis.instrument.recording import FrameFolder, read_recording_index, record

if TYPE_CHECKING:
    from pathlib import Path

TIMES_S = (0.0, 0.5, 2.0)


def recorded(folder: Path) -> Path:
    """A recording of three frames that a camera numbers and that arrive in their order."""
    camera = ScriptedCamera()
    asked = False

    def feed() -> bool:
        nonlocal asked
        if not asked:
            asked = True
            for number in range(len(TIMES_S)):
                camera.script.put(Frame(pixels=np.full((16, 24), number, dtype=np.uint8), sequence=number))
            camera.script.put(END)
        return False

    with Acquisition(lambda: camera, reconnect=False, lost_after_s=HANGS_S) as acquisition:
        assert record(acquisition, FrameFolder(folder), folder, stopped=feed).kept == len(TIMES_S)
    return folder


def test_a_recording_gives_its_files_in_their_order_with_times_that_rise(tmp_path: Path) -> None:
    folder = recorded(tmp_path)
    files, times = zip(*read_recording_index(folder), strict=True)
    assert list(files) == sorted(folder.glob("*.png"))
    assert list(times) == sorted(times)


def test_times_are_those_of_the_file(tmp_path: Path) -> None:
    rows = [f"{number},{time_s},frame-{number}.png" for number, time_s in enumerate(TIMES_S)]
    (tmp_path / "frames.csv").write_text("\n".join(["number,arrived_s,kept_in", *rows]))
    assert read_recording_index(tmp_path) == tuple(
        (tmp_path / f"frame-{number}.png", time_s) for number, time_s in enumerate(TIMES_S)
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
