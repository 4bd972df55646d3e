"""``tsis contacts`` for frames of a probe and of a gel sensor, and ``tsis sensor frames``."""

from __future__ import annotations

import csv
import json
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.cli.disc_frames import CENTRE, DISC_PX, entries

from tsis.catalog.sensors import load_sensor
from tsis.cli.contacts import missing_frames_note
from tsis.errors import ImageMismatchError, InputError
from tsis.files.images import encode_picture
from tsis.imaging.depth import DepthCalibration, DepthMapper, depth_calibration_json
from tsis.imaging.gel_contact import contacts
from tsis.virtual.gel_frames import random_gel_press, rendered_series

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray
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


def test_a_session_folder_gives_frames_the_untouched_one_and_forces(
    run_tsis: RunTsis, gel_frames: list[dict[str, Any]], tmp_path: Path
) -> None:
    folder = tmp_path / "gel-frames"
    assert len(gel_frames) == 2
    (folder / "result.json").unlink()
    refused = run_tsis("contacts", "gel-frames", "--sensor", "gelsight-mini")
    assert refused.code == 2
    assert "make it one by tsis session" in refused.err
    (folder / "Waage.csv").write_bytes("Bild;Kraft [g]\npress-2.png;51,0\npress-1.png;20,4\n".encode("utf-16"))
    assert run_tsis("session", "gel-frames", "--yes").code == 0
    finished = run_tsis("contacts", "gel-frames", "--sensor", "gelsight-mini", "--csv", "c.csv", "--json")
    assert finished.code == 0, finished.err
    with (tmp_path / "c.csv").open(newline="") as file:
        forces = {row["name"]: float(row["force_n"]) for row in csv.DictReader(file)}
    assert forces == {"press-1.png": pytest.approx(0.2, abs=1e-3), "press-2.png": pytest.approx(0.5, abs=1e-3)}
    estimated = run_tsis("hardness", "gel-frames", "--sensor", "gelsight-mini", "--radius-mm", "3", "--json")
    contacts = json.loads(estimated.out)["estimate"]["provenance"]["contacts"]
    assert [contact["force_n"] for contact in contacts] == pytest.approx([0.2, 0.5], abs=1e-3)
    (folder / "press-1.json").write_text('{"force": {"force_n": 0.3, "force_sd_n": 0.05}}')
    (folder / "presses.csv").unlink()
    order = ("--sensor", "gelsight-mini", "--reference", "gel-frames/untouched.png", "--radius-mm", "3", "--json")
    alone = run_tsis("hardness", "gel-frames/press-1.png", "gel-frames/press-2.png", *order)
    assert alone.out, alone.err
    contacts = json.loads(alone.out)["estimate"]["provenance"]["contacts"]
    assert [contact["force_n"] for contact in contacts] == [0.3, None]
    assert contacts[0]["force_sd_n"] == 0.05


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
        (("--watch", "--camera", "aravis:1"), "--sensor needs --camera virtual, opencv:NUMBER or video:FILE"),
        (("--camera", "video:none.avi"), "--sensor needs --watch, or --frames or --seconds for a folder"),
        (("--video", "--frames", "2"), "--sensor needs --watch, or --frames or --seconds for a folder"),
        (("--watch", "--camera", "video:none.avi"), "--camera must be a camera that opens; video:none.avi does not"),
    ],
)
def test_a_live_gel_sensor_needs_a_camera_with_colours(run_tsis: RunTsis, options: tuple[str, ...], said: str) -> None:
    pytest.importorskip("cv2")
    finished = run_tsis("acquire", "--sensor", "gelsight-mini", *options)
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1


@pytest.fixture
def small_sensor(run_tsis: RunTsis) -> tuple[str, str]:
    finished = run_tsis("sensor", "new", "small", "--image-px", "160,120", "--scale-mm", "0.1264")
    assert finished.code == 0, finished.err
    return "--sensor", "sensor.toml"


def test_a_recorded_gel_sensor_has_its_contacts(run_tsis: RunTsis, small_sensor: tuple[str, str]) -> None:
    """From the camera to contacts: the first frame of the virtual sensor is untouched, the others are presses."""
    recorded = run_tsis("acquire", *small_sensor, "--seed", "12", "--frames", "4", "--out", "rec", "--json")
    assert recorded.code == 0, recorded.err
    assert json.loads(recorded.out)["frames"] == 4
    finished = run_tsis("contacts", "rec", *small_sensor, "--reference", "rec/frame-000000.png", "--json")
    assert finished.code == 0, finished.err
    found = json.loads(finished.out)["contacts"]
    made = rendered_series(load_sensor("sensor.toml"), 6, ball_radius_mm=3.0, seed=12)
    assert found[0]["reasons"] == ["no contact"]
    for contact, press in zip(found[1:], made, strict=False):
        assert np.hypot(*np.subtract(contact["centre_px"], press.centre_px)) < 1.0


def test_the_live_view_of_the_virtual_sensor_has_contact_depth_and_force(
    run_tsis: RunTsis, small_sensor: tuple[str, str]
) -> None:
    run_tsis("acquire", *small_sensor, "--seed", "12", "--frames", "4", "--out", "rec")
    presses = [f"rec/frame-{number:06d}.png" for number in range(1, 4)]
    common = (*small_sensor, "--reference", "rec/frame-000000.png")
    made = run_tsis("depth", "calibrate", *presses, *common, "--ball-mm", "6", "--out", "depth.json")
    assert made.code == 0, made.err
    watched = ("acquire", "--watch", *small_sensor, "--seed", "12", "--depth", "depth.json", "--seconds", "0.02")
    finished = run_tsis(*watched)
    assert finished.code == 0, finished.err
    assert "no good contact: no contact" in finished.out


@pytest.mark.system
def test_the_live_view_as_a_program_reads_contact_depth_and_force(
    run_tsis: RunTsis, small_sensor: tuple[str, str], tmp_path: Path
) -> None:
    run_tsis("acquire", *small_sensor, "--seed", "12", "--frames", "6", "--out", "rec")
    presses = [f"rec/frame-{number:06d}.png" for number in range(1, 6)]
    common = (*small_sensor, "--reference", "rec/frame-000000.png")
    run_tsis("depth", "calibrate", *presses, *common, "--ball-mm", "6", "--out", "depth.json")
    words = ("acquire", "--watch", *small_sensor, "--seed", "12", "--depth", "depth.json", "--seconds", "30", "--json")
    program = [sys.executable, "-c", "from tsis.cli import main; main()", *words]
    with subprocess.Popen(program, cwd=tmp_path, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as live:
        assert live.stderr is not None
        lines = [line for line, _ in zip(live.stderr, range(3), strict=False)]
        live.send_signal(signal.SIGINT)
        out, _ = live.communicate()
    assert lines[0].startswith("no good contact")
    assert all("contact at" in line and "deepest" in line and " N (" in line for line in lines[1:])
    assert live.returncode == 0
    assert json.loads(out)["frames"] >= 3


@pytest.mark.slow
@pytest.mark.usefixtures("gel_frames")
def test_a_video_is_read_as_a_live_sensor(run_tsis: RunTsis, tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    frames = [cv2.imread(str(tmp_path / "gel-frames" / f"{name}.png")) for name in ("untouched", "press-1", "press-2")]
    size = frames[0].shape[1::-1]
    video = cv2.VideoWriter(str(tmp_path / "live.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 10, size)
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
    finished = run_tsis("depth", "calibrate", "press.png", "--ball-mm", "6")
    assert finished.code == 2
    assert "give --sensor gelsight-mini" in finished.err
    assert "tsis sensor new makes" in finished.err


@pytest.mark.usefixtures("disc_frames")
def test_a_disc_is_measured(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis(
        *("contacts", "press.png", "--reference", "untouched.png", "--invert", "--scale-mm", "0.05,0.04", "--json")
    )
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    (image,) = document["images"]
    found = image["features"]
    assert found["centroid_px"] == pytest.approx(CENTRE, abs=0.05)
    assert found["area_mm2"] == pytest.approx(np.pi * DISC_PX**2 * 0.05 * 0.04, rel=0.01)
    assert found["semi_axes_mm"] == pytest.approx([DISC_PX * 0.05, DISC_PX * 0.04], rel=0.02)
    assert found["peak"] == pytest.approx(80.0, rel=0.01)
    assert {entry["estimate"] for entry in document["refused"]} == {
        "inclusion: diameter, depth, modulus",
        "force",
        "hardness of a touched object",
    }
    page = (tmp_path / "tsis-contacts" / "index.html").read_text()
    assert "Not estimated, and why" in page
    assert "Research use only" in page


@pytest.mark.usefixtures("disc_frames")
def test_without_a_scale_lengths_stay_in_pixels(run_tsis: RunTsis) -> None:
    finished = run_tsis("contacts", "press.png", "--reference", "untouched.png", "--invert", "--json")
    found = json.loads(finished.out)["images"][0]["features"]
    assert found["area_px"] == pytest.approx(np.pi * DISC_PX**2, rel=0.01)
    assert found["area_mm2"] is None
    assert found["equivalent_diameter_mm"] is None


@pytest.mark.usefixtures("disc_frames")
def test_the_wrong_sign_finds_no_contact_and_says_so(run_tsis: RunTsis) -> None:
    finished = run_tsis("contacts", "untouched.png", "--reference", "untouched.png")
    assert finished.code == 0
    assert "no contact stands out of the noise" in " ".join(finished.out.split())


@pytest.mark.parametrize("name", ["[bold]frame[red].png", "a\x1b[2J\nb.png", "\udcff.png", "<b>.png"])
def test_names_of_files_stay_text(run_tsis: RunTsis, tmp_path: Path, name: str) -> None:
    cv2.imwrite(str(tmp_path / "plain.png"), np.full((30, 40), 7, np.uint8))
    (tmp_path / "plain.png").rename(tmp_path / name)
    finished = run_tsis("contacts", name)
    assert finished.code == 0, finished.err
    assert "\x1b" not in finished.out
    if "[" in name and "\x1b" not in name:
        assert name in finished.out


@pytest.mark.parametrize("shape", [(1, 60), (60, 1), (1, 1)])
def test_a_thin_image_is_no_crash(run_tsis: RunTsis, tmp_path: Path, shape: tuple[int, int]) -> None:
    cv2.imwrite(str(tmp_path / "thin.png"), np.full(shape, 9, np.uint8))
    assert run_tsis("contacts", "thin.png", "--scale-mm", "0.05").code == 0


def test_a_white_frame_is_said_to_be_clipped(run_tsis: RunTsis, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "white.png"), np.full((50, 60), 255, np.uint8))
    assert "100.0 % of the picture is clipped by the camera" in " ".join(run_tsis("contacts", "white.png").out.split())


@pytest.mark.usefixtures("disc_frames")
def test_several_images_have_a_table_each(run_tsis: RunTsis) -> None:
    finished = run_tsis("contacts", "press.png", "untouched.png", "--reference", "untouched.png", "--invert", "--json")
    first, second = json.loads(finished.out)["images"]
    assert (first["name"], second["name"]) == ("press.png", "untouched.png")
    assert (first["features"]["contact"], second["features"]["contact"]) == (True, False)


@pytest.mark.usefixtures("disc_frames")
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["absent.png"], "absent.png"),
        (["cut.png"], "must be a complete image file"),
        (["empty.png"], "empty.png"),
        (["notes.png"], "notes.png"),
        (["."], "must have a sidecar"),
        (["press.png", "--reference", "small.png"], "reference must have the image's shape (200, 300); got (20, 30)"),
        (["press.png", "--reference", "deep.png"], "reference must have the image's full_scale 255; got 65535"),
        (["press.png", "--scale-mm", "-0.05"], "mm_per_pixel must lie in [0.0001, 10]; got -0.05"),
        (["press.png", "--scale-mm", "50"], "mm_per_pixel must lie in [0.0001, 10]; got 50"),
        (["press.png", "--scale-mm", "wide"], "--scale-mm must be one number or x,y"),
        (["press.png", "--scale-mm", "nan"], "mm_per_pixel must be finite"),
        (["press.png", "--invert"], "invert needs a reference"),
        (["press.png", "--out", "."], "must name a new folder"),
        (["press.png", "--out", "x" * 300], "must be a folder that can be made"),
        (["press.png", "--match-light"], "--match-light needs --reference"),
        (["press.png", "--csv", "c.csv"], "--csv is an option for frames of a gel sensor, with --sensor; leave it out"),
        (["press.png", "--sensor", "gelsight-mini", "--invert"], "--invert is an option for frames of a probe"),
    ],
)
def test_wrong_input_is_one_sentence_and_writes_nothing(
    run_tsis: RunTsis, tmp_path: Path, arguments: list[str], sentence: str
) -> None:
    before = entries(tmp_path)
    finished = run_tsis("contacts", *arguments)
    assert finished.code == 2
    assert finished.out == ""
    assert sentence in finished.err
    assert finished.err.startswith("Error: ")
    assert finished.err.count("\n") == 1
    assert entries(tmp_path) == before


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
def gel_files(tmp_path: Path) -> Path:
    for name, levels in (("press", MADE.frame), ("untouched", MADE.reference), ("other", OTHER.reference)):
        (tmp_path / f"{name}.png").write_bytes(encode_picture(levels))
    (tmp_path / "depth.json").write_bytes(depth_calibration_json(CALIBRATION))
    return tmp_path


@pytest.mark.parametrize("command", [("contacts",), ("depth", "map", "--calibration", "depth.json")])
@pytest.mark.parametrize(("fault", "change", "said"), FAULTS, ids=[fault for fault, _, _ in FAULTS])
def test_a_bad_frame_ends_in_one_sentence(
    run_tsis: RunTsis,
    gel_files: Path,
    command: tuple[str, ...],
    fault: str,
    change: Callable[[NDArray[Any]], NDArray[Any]],
    said: str,
) -> None:
    (gel_files / "bad.png").write_bytes(encode_picture(change(MADE.frame)))
    common = ("--sensor", "gelsight-mini", "--reference", "untouched.png")
    finished = run_tsis(*command, "bad.png", *common)
    assert finished.code == 2, fault
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert not (gel_files / "depth-maps").exists()


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
def test_the_reference_of_another_sensor_is_refused(
    run_tsis: RunTsis, gel_files: Path, command: tuple[str, ...]
) -> None:
    finished = run_tsis(*command, "press.png", "--sensor", "gelsight-mini", "--reference", "other.png")
    assert finished.code == 2
    assert "reference must be an untouched frame of the sensor" in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1
    assert not (gel_files / "depth-maps").exists()


DEPTH_MAP = ("depth", "map", "--calibration", "depth.json")
NO_FILE, NO_NAME = "it does not exist: make one with tsis sensor new", "or a file in .toml, which tsis sensor new makes"


@pytest.mark.parametrize(
    ("command", "sensor", "said"),
    [
        (DEPTH_MAP, (), "give --sensor gelsight-mini, or another that tsis sensor show lists, or a file of your own"),
        *[(command, ("--sensor", "mine.toml"), NO_FILE) for command in (("contacts",), DEPTH_MAP)],
        *[(command, ("--sensor", "gelsight-mimi"), NO_NAME) for command in (("contacts",), DEPTH_MAP)],
    ],
)
@pytest.mark.usefixtures("gel_files")
def test_a_sensor_without_a_file_is_one_sentence_with_the_command_that_makes_it(
    run_tsis: RunTsis, command: tuple[str, ...], sensor: tuple[str, ...], said: str
) -> None:
    finished = run_tsis(*command, "press.png", *sensor, "--reference", "untouched.png")
    assert finished.code == 2
    assert said in " ".join(finished.err.split())
    assert finished.err.count("\n") == 1


def test_sixteen_bits_give_the_contact_of_eight(run_tsis: RunTsis, gel_files: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    for name in ("press", "untouched"):
        eight = cv2.imread(str(gel_files / f"{name}.png"))
        cv2.imwrite(str(gel_files / f"{name}-16.png"), eight.astype(np.uint16) * 257)
    results = []
    for ending in ("", "-16"):
        common = ("--sensor", "gelsight-mini", "--reference", f"untouched{ending}.png", "--json")
        finished = run_tsis("contacts", f"press{ending}.png", *common)
        assert finished.code == 0, finished.err
        (contact,) = json.loads(finished.out)["contacts"]
        results.append([*contact["centre_px"], contact["radius_px"]])
    assert results[1] == pytest.approx(results[0], rel=1e-9)


def test_a_recording_with_dropped_frames_says_so(run_tsis: RunTsis, gel_files: Path) -> None:
    folder = gel_files / "recording"
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


def test_other_files_than_pictures_and_depth_maps_are_refused_with_what_to_do(
    run_tsis: RunTsis, gel_files: Path
) -> None:
    (gel_files / "press.avi").write_bytes(b"RIFF")
    common = ("--sensor", "gelsight-mini", "--reference", "untouched.png")
    for command, said in (
        (("contacts", "press.avi", *common), "press.avi must be a video that can be decoded"),
        (("force", "press.png", *common[:2]), "must be an NPY file of a depth map, as tsis depth map writes it"),
        (("force", "no.npy", *common[:2]), "'no.npy' does not exist"),
    ):
        finished = run_tsis(*command)
        assert finished.code == 2
        assert said in " ".join(finished.err.split())
        assert finished.err.count("\n") == 1


def test_a_video_of_a_press_is_read_as_its_frames(run_tsis: RunTsis, tmp_path: Path) -> None:
    press = random_gel_press(load_sensor("gelsight-mini"), np.random.default_rng(31))
    rows, columns = press.frame.shape[:2]
    writer = cv2.VideoWriter(str(tmp_path / "press.avi"), cv2.VideoWriter.fourcc(*"FFV1"), 10.0, (columns, rows))
    for frame in (press.reference, press.frame):
        writer.write(frame[..., ::-1])
    writer.release()
    finished = run_tsis("contacts", "press.avi", "--sensor", "gelsight-mini", "--json")
    assert finished.code == 0, finished.err
    untouched, pressed = json.loads(finished.out)["contacts"]
    assert not untouched["good"]
    assert pressed["radius_px"] == pytest.approx(press.radius_px, rel=0.06)
    (tmp_path / "broken.avi").write_bytes(b"no video")
    refused = run_tsis("contacts", "broken.avi", "--sensor", "gelsight-mini")
    assert refused.code == 2
    assert "must be a video that can be decoded" in refused.err
