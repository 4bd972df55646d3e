"""Bad frames of a gel sensor through the commands: one sentence each, and never a result."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from tsis.catalog.sensors import load_sensor
from tsis.errors import ImageMismatchError, InputError
from tsis.files.images import encode_picture
from tsis.imaging.depth import DepthCalibration, DepthMapper, depth_calibration_json
from tsis.imaging.gel_contact import contacts
from tsis.virtual.gel_frames import random_gel_press

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.cli.conftest import RunTsis

SENSOR = replace(load_sensor("gelsight-mini"), image_px=(160, 120), mm_per_pixel=(0.1264, 0.1264))
MADE, OTHER = (random_gel_press(SENSOR, np.random.default_rng([88, number])) for number in (0, 1))
CALIBRATION = DepthCalibration(
    sensor=SENSOR.name, light="rgb", method="polynomial", weights=np.full((37, 2), 0.01), ball_mm=6.0, presses=3,
    sd_mm=0.02, sd_relative=0.02,
)  # fmt: skip

FAULTS: tuple[tuple[str, Callable[[NDArray[Any]], NDArray[Any]], str], ...] = (
    ("one channel", lambda frame: frame[..., 0], "must be in colour, because gelsight-mini has coloured lamps"),
    ("wrong size", lambda frame: frame[:60], "must have the aspect ratio of 320 x 240 pixels; got 160 x 60"),
    ("all black", lambda frame: np.zeros_like(frame), "must be lit; got a black frame"),
    ("saturated", lambda frame: np.full_like(frame, 255), "must not be saturated; got 100% white pixels"),
)  # fmt: skip


@pytest.fixture
def frames(tmp_path: Path) -> Path:
    for name, levels in (("press", MADE.frame), ("untouched", MADE.reference), ("other", OTHER.reference)):
        (tmp_path / f"{name}.png").write_bytes(encode_picture(levels))
    (tmp_path / "depth.json").write_bytes(depth_calibration_json(CALIBRATION))
    return tmp_path


@pytest.mark.parametrize("command", [("contacts",), ("depth", "map", "--calibration", "depth.json")])
@pytest.mark.parametrize(("fault", "change", "said"), FAULTS, ids=[fault for fault, _, _ in FAULTS])
def test_a_bad_frame_ends_in_one_sentence(
    run_tsis: RunTsis,
    frames: Path,
    command: tuple[str, ...],
    fault: str,
    change: Callable[[NDArray[Any]], NDArray[Any]],
    said: str,
) -> None:
    (frames / "bad.png").write_bytes(encode_picture(change(MADE.frame)))
    common = ("--sensor", "gelsight-mini", "--reference", "untouched.png")
    finished = run_tsis(*command, "bad.png", *common)
    assert finished.code == 2, fault
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert not (frames / "depth-maps").exists()


@pytest.mark.parametrize(("fault", "change", "said"), FAULTS, ids=[fault for fault, _, _ in FAULTS])
def test_a_bad_frame_is_an_error_of_python_too(
    fault: str, change: Callable[[NDArray[Any]], NDArray[Any]], said: str
) -> None:
    sensor = replace(SENSOR, image_px=(320, 240))  # as the file has it
    mapper = DepthMapper(CALIBRATION, sensor, MADE.reference)
    for call in (lambda bad: contacts([bad], sensor=sensor, reference=MADE.reference), mapper.map):
        with pytest.raises((InputError, ImageMismatchError)) as error:
            call(change(MADE.frame))
        assert said in str(error.value), fault


@pytest.mark.parametrize("command", [("contacts",), ("depth", "map", "--calibration", "depth.json")])
def test_the_reference_of_another_sensor_is_refused(run_tsis: RunTsis, frames: Path, command: tuple[str, ...]) -> None:
    finished = run_tsis(*command, "press.png", "--sensor", "gelsight-mini", "--reference", "other.png")
    assert finished.code == 2
    assert "reference must be an untouched frame of the sensor" in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert not (frames / "depth-maps").exists()


@pytest.mark.parametrize("command", [("contacts",), ("depth", "map", "--calibration", "depth.json")])
@pytest.mark.parametrize(
    ("sensor", "said"),
    [((), "give --sensor gelsight-mini, or another that tsis sensor show lists, or a file of your own that tsis sensor "
     "new makes"),
     (("--sensor", "mine.toml"), "it does not exist: make one with tsis sensor new"),
     (("--sensor", "gelsight-mimi"), "or a file in .toml, which tsis sensor new makes")],
)  # fmt: skip
@pytest.mark.usefixtures("frames")
def test_a_sensor_without_a_file_is_one_sentence_with_the_command_that_makes_it(
    run_tsis: RunTsis, command: tuple[str, ...], sensor: tuple[str, ...], said: str
) -> None:
    finished = run_tsis(*command, "press.png", *sensor, "--reference", "untouched.png")
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1


def test_sixteen_bits_give_the_contact_of_eight(run_tsis: RunTsis, frames: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    for name in ("press", "untouched"):
        eight = cv2.imread(str(frames / f"{name}.png"))
        cv2.imwrite(str(frames / f"{name}-16.png"), eight.astype(np.uint16) * 257)
    results = []
    for ending in ("", "-16"):
        common = ("--sensor", "gelsight-mini", "--reference", f"untouched{ending}.png", "--json")
        finished = run_tsis("contacts", f"press{ending}.png", *common)
        assert finished.code == 0, finished.err
        (contact,) = json.loads(finished.out)["contacts"]
        results.append([*contact["centre_px"], contact["radius_px"]])
    assert results[1] == pytest.approx(results[0], rel=1e-9)


def test_a_recording_with_dropped_frames_says_so(run_tsis: RunTsis, frames: Path) -> None:
    folder = frames / "recording"
    folder.mkdir()
    times = [0.0, 0.1, 0.2, 0.6, 0.7]
    rows = ["number,kept_in,connection,sequence,time_s,arrived_s"]
    for number, time in enumerate(times):
        (folder / f"frame-{number:06d}.png").write_bytes(encode_picture(MADE.frame))
        rows.append(f"{number},frame-{number:06d}.png,0,{number},{time},{time}")
    (folder / "frames.csv").write_text("\n".join(rows) + "\n")
    finished = run_tsis("contacts", "recording", "--sensor", "gelsight-mini", "--reference", "untouched.png")
    assert finished.code == 0, finished.err
    assert "3 frames of the recording are missing" in " ".join(finished.out.split())


def test_other_files_than_pictures_and_depth_maps_are_refused_with_what_to_do(run_tsis: RunTsis, frames: Path) -> None:
    (frames / "press.avi").write_bytes(b"RIFF")
    common = ("--sensor", "gelsight-mini", "--reference", "untouched.png")
    for command, said in (
        (("contacts", "press.avi", *common), "tsis acquire --camera video:press.avi"),
        (("force", "press.png", *common[:2]), "must be an NPY file of a depth map, as tsis depth map writes it"),
        (("force", "no.npy", *common[:2]), "'no.npy' does not exist"),
    ):
        finished = run_tsis(*command)
        assert finished.code == 2
        assert said in " ".join(finished.err.split())
        assert finished.err.count("\n") == 1
