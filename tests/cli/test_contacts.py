"""``tsis contacts`` and ``tsis sensor frames``."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.cli._contacts import missing_frames_note

if TYPE_CHECKING:
    from tests.cli.conftest import RunTsis


@pytest.fixture
def gel_frames(run_tsis: RunTsis, tmp_path: Path) -> list[dict[str, Any]]:
    finished = run_tsis("sensor", "frames", "gelsight-mini", "--presses", "2", "--seed", "3", "--json")
    assert finished.code == 0, finished.err
    truth: list[dict[str, Any]] = json.loads(finished.out)["truth"]
    return truth


def test_contacts_of_rendered_frames(run_tsis: RunTsis, gel_frames: list[dict[str, Any]], tmp_path: Path) -> None:
    common = ("--sensor", "gelsight-mini", "--reference", "gel-frames/untouched.png")
    files = ("--csv", "c.csv", "--html", "c.html", "--figure", "c.png")
    frames = ("gel-frames/press-1.png", "gel-frames/press-2.png")
    finished = run_tsis("contacts", *frames, *common, *files, "--json")
    assert finished.code == 0, finished.err
    found = json.loads(finished.out)["contacts"]
    for contact, truth in zip(found, gel_frames, strict=True):
        assert np.hypot(*np.subtract(contact["centre_px"], truth["centre_px"])) < 1.0
        assert contact["radius_px"] == pytest.approx(truth["radius_px"], rel=0.06)
    with (tmp_path / "c.csv").open(newline="") as file:
        assert [row["name"] for row in csv.DictReader(file)] == ["press-1.png", "press-2.png"]
    assert b"Research use only" in (tmp_path / "c.html").read_bytes()
    assert (tmp_path / "c.png").read_bytes().startswith(b"\x89PNG")
    empty = run_tsis("contacts", "gel-frames/untouched.png", *common)
    assert empty.code == 3
    assert "no contact" in empty.out


def test_dropped_frames_of_a_recording_are_said_in_one_sentence(tmp_path: Path) -> None:
    def recorded(times: list[float]) -> Path:
        folder = tmp_path / f"recording-{len(times)}"
        folder.mkdir()
        rows = [f"{number},{time},{time},f{number}.png" for number, time in enumerate(times)]
        (folder / "frames.csv").write_text("\n".join(["sequence,time_s,arrived_s,kept_in", *rows]) + "\n")
        return folder

    steady = [0.1 * number for number in range(12)]
    assert missing_frames_note([recorded(steady)]) == ()
    (note,) = missing_frames_note([recorded([time for time in steady if not 0.35 < time < 0.65])])
    assert note.startswith("3 frames of the recording are missing")
    assert missing_frames_note([Path("press-1.png"), Path("press-2.png")]) == ()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--watch", "--camera", "virtual"), "--sensor needs --camera opencv:NUMBER or video:FILE, which have colours"),
        (("--camera", "video:none.avi"), "--sensor needs --watch"),
        (("--watch", "--camera", "video:none.avi"), "needs a frame of the untouched sensor"),
    ],
)
def test_a_live_gel_sensor_needs_a_camera_with_colours_and_a_reference(
    run_tsis: RunTsis, options: tuple[str, ...], said: str
) -> None:
    finished = run_tsis("acquire", "--sensor", "gelsight-mini", *options)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())


@pytest.mark.slow
@pytest.mark.usefixtures("gel_frames")
def test_a_video_is_read_as_a_live_sensor(run_tsis: RunTsis, tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    frames = [cv2.imread(str(tmp_path / "gel-frames" / f"{name}.png")) for name in ("untouched", "press-1", "press-2")]
    size = frames[0].shape[1::-1]
    video = cv2.VideoWriter(str(tmp_path / "live.avi"), cv2.VideoWriter_fourcc(*"FFV1"), 10, size)
    for frame in frames:
        video.write(frame)
    video.release()
    common = ("--sensor", "gelsight-mini", "--reference", "gel-frames/untouched.png")
    finished = run_tsis("acquire", "--watch", "--camera", "video:live.avi", *common, "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    assert (document["frames"], document["flagged"]) == (3, {"no contact": 1})
    assert finished.err.count("contact at") == 2


def test_a_sensor_without_a_file_says_which_and_how(run_tsis: RunTsis) -> None:
    finished = run_tsis("contacts", "press.png")
    assert finished.code == 2
    assert "give --sensor gelsight-mini" in finished.err
    assert "tsis sensor new makes" in finished.err
