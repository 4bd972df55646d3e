from __future__ import annotations

import csv
import hashlib
import json
import re
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import TYPE_CHECKING, Any, Self

import cv2
import numpy as np
import pytest

from tsis.calibration.file import ProbeCalibration, write_calibration
from tsis.catalog.phantoms import load_phantom
from tsis.catalog.probes import load_probe
from tsis.instrument.discovery import CameraInfo, CameraListing
from tsis.instrument.gauge import SimulatedGauge
from tsis.virtual.camera import VirtualCamera
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.cli.conftest import RunTsis

UNTOUCHED = ("--force-n", "0")  # no press is solved, which is quick
STORED = 40
NOW = datetime(2026, 11, 22, 9, 8, 7, 654321, tzinfo=UTC)


def stored_frame(number: int) -> NDArray[np.uint8]:
    return np.random.default_rng(number).integers(0, 256, (30, 40)).astype(np.uint8)


@pytest.fixture
def stored(tmp_path: Path) -> str:
    """A folder of frames, and the camera that plays it."""
    folder = tmp_path / "frames"
    folder.mkdir()
    for number in range(STORED):
        cv2.imwrite(str(folder / f"f{number:03d}.png"), stored_frame(number))
    return f"files:{folder}"


@pytest.fixture
def stopped_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    class Clock:
        @classmethod
        def now(cls) -> Self:
            return cls()

        def astimezone(self) -> datetime:
            return NOW

    monkeypatch.setattr("tsis.cli.acquire.datetime", Clock)


def grey(path: Path) -> NDArray[Any]:
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert found is not None
    return np.asarray(found)


def index(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


def everything(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*")}


def virtual_frames(seed: int, count: int, **settings: float) -> list[NDArray[Any]]:
    """What the virtual camera of that seed sees, frame by frame."""
    rng = np.random.default_rng(seed)
    probe = VirtualProbe(load_probe("tsis-2011"), rng=rng, strain="small")
    camera = VirtualCamera(probe, load_phantom("hardness-100"), rng=rng, force_n=0.0)
    camera.open()
    for name, value in settings.items():
        camera.adjust(name, value)
    camera.start()
    frames = [frame.pixels for frame in islice(camera.frames(), count)]
    camera.stop()
    return frames


def test_a_list_shows_cameras_and_what_is_missing(run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch) -> None:
    found = CameraInfo(source="aravis", identity="Maker-[red]7", maker="Maker [/]", model="M", note="10.0.0.2")
    findings = CameraListing(
        cameras=(found,), missing={"pylon": "the camera source pylon needs pypylon; pip install ..."}
    )
    monkeypatch.setattr("tsis.instrument.discovery.find_cameras", lambda: findings)
    document = json.loads(run_tsis("acquire", "--list", "--json").out)
    assert document["found"] == [
        {"source": "aravis", "identity": "Maker-[red]7", "maker": "Maker [/]", "model": "M", "note": "10.0.0.2"}
    ]
    assert document["missing"] == dict(findings.missing)
    shown = run_tsis("acquire", "--list")
    assert shown.code == 0
    assert "aravis:Maker-[red]7" in shown.out
    assert "Maker [/]" in shown.out
    assert "virtual" in shown.out
    assert "- the camera source pylon needs pypylon" in shown.out


def test_modes_and_settings_of_the_virtual_camera(run_tsis: RunTsis, tmp_path: Path) -> None:
    document = json.loads(run_tsis("acquire", "--modes", *UNTOUCHED, "--json").out)
    (mode,) = document["modes"]
    assert (mode["mode"], mode["width_px"], mode["height_px"]) == ("768x492@30", 768, 492)
    settings = {one["name"]: one for one in document["settings"]}
    assert settings["gain"] == {"name": "gain", "value": 0.0, "unit": "dB", "low": 0.0, "high": 24.0}
    shown = run_tsis("acquire", "--modes", *UNTOUCHED).out
    for name in settings:
        assert re.search(rf"^ *{name} ", shown, re.MULTILINE)
    assert list(tmp_path.iterdir()) == []


def test_stored_frames_have_no_settings(run_tsis: RunTsis, stored: str) -> None:
    assert "It has no settings." in run_tsis("acquire", "--modes", "--camera", stored).out


@pytest.mark.usefixtures("stopped_clock")
def test_a_snapshot_is_named_as_in_the_source_and_raw_is_lossless(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("acquire", *UNTOUCHED, "--target", "3", "--seed", "7", "--set", "exposure_ms=10", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    folder = tmp_path / "Target3"
    stem = "Target3-112226-090807"
    assert {path.name for path in folder.iterdir()} == {f"{stem}.bmp", f"{stem}-raw.bmp", f"{stem}.json"}
    assert document["files"]["raw"] == str(folder / f"{stem}-raw.bmp")
    number = document["sequence"]
    np.testing.assert_array_equal(
        grey(folder / f"{stem}-raw.bmp"), virtual_frames(7, number + 1, exposure_ms=10.0)[number]
    )
    colour = grey(folder / f"{stem}.bmp")
    assert colour.shape == (492, 768, 3)
    assert np.ptp(colour, axis=2).max() > 0
    sidecar = json.loads((folder / f"{stem}.json").read_text())
    assert sidecar["settings"]["exposure_ms"] == 10.0
    assert (sidecar["target"], sidecar["taken"]) == (3, "2026-11-22T09:08:07.654+00:00")
    for ending, digest in sidecar["sha256"].items():
        assert hashlib.sha256((folder / f"{stem}{ending}").read_bytes()).hexdigest() == digest


@pytest.mark.usefixtures("stopped_clock")
def test_a_second_snapshot_in_one_second_is_kept_beside_the_first(
    run_tsis: RunTsis, stored: str, tmp_path: Path
) -> None:
    stem = "Target1-112226-090807"
    arguments = ("acquire", "--camera", stored, "--out", "snaps", "--format", "png")
    assert run_tsis(*arguments).code == 0
    first = {path.name: path.read_bytes() for path in (tmp_path / "snaps" / "Target1").iterdir()}
    assert run_tsis(*arguments).code == 0
    now = {path.name: path.read_bytes() for path in (tmp_path / "snaps" / "Target1").iterdir()}
    assert {name: now[name] for name in first} == first
    assert set(first) == {f"{stem}.png", f"{stem}-raw.png", f"{stem}.json"}
    assert set(now) - set(first) == {f"{stem}-2.png", f"{stem}-2-raw.png", f"{stem}-2.json"}


@pytest.mark.parametrize(("picture", "raw"), [("bmp", "bmp"), ("png", "png"), ("jpg", "png")])
def test_stored_frames_are_a_camera_and_raw_stays_lossless(
    run_tsis: RunTsis, stored: str, tmp_path: Path, picture: str, raw: str
) -> None:
    finished = run_tsis("acquire", "--camera", stored, "--format", picture, "--map", "cividis", "--json")
    files = json.loads(finished.out)["files"]
    assert files["colour"].endswith(f".{picture}")
    assert files["raw"].endswith(f"-raw.{raw}")
    number = json.loads(finished.out)["sequence"]
    np.testing.assert_array_equal(grey(tmp_path / files["raw"]), stored_frame(number))


def test_every_stored_frame_is_recorded_and_a_snapshot_takes_the_first(
    run_tsis: RunTsis, stored: str, tmp_path: Path
) -> None:
    finished = run_tsis("acquire", "--camera", stored, "--seconds", "60", "--json")  # ends with the frames
    assert finished.code == 0, finished.err
    report = json.loads(finished.out)["recording"]
    assert (report["kept"], report["missed"], report["overrun"], report["ended_by"]) == (STORED, 0, 0, "")
    rows = index(tmp_path / "tsis-sequence" / "frames.csv")
    for number, row in enumerate(rows):
        np.testing.assert_array_equal(grey(tmp_path / "tsis-sequence" / row["kept_in"]), stored_frame(number))
    calibrated(tmp_path / "known.json")  # of another camera, which stored frames do not contradict
    snapshot = run_tsis("acquire", "--camera", stored, "--calibration", "known.json", "--json")
    assert json.loads(snapshot.out)["sequence"] == 0


def test_a_stored_frame_of_another_size_ends_the_recording_with_its_reason(
    run_tsis: RunTsis, stored: str, tmp_path: Path
) -> None:
    cv2.imwrite(str(tmp_path / "frames" / "f007.png"), np.zeros((31, 40), np.uint8))
    finished = run_tsis("acquire", "--camera", stored, "--frames", "30")
    assert finished.code == 1
    assert "7 frames in" in finished.out
    assert "Ended early: frames of one folder must have one format" in finished.out
    assert len(list((tmp_path / "tsis-sequence").glob("*.png"))) == 7
    broken = run_tsis("acquire", "--camera", stored, "--watch", "--json")
    assert json.loads(broken.out)["frames"] == 7
    assert "! camera: frames of one folder must have one format" in broken.err


def test_a_sequence_holds_so_many_frames_and_accounts_for_them(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("acquire", *UNTOUCHED, "--seed", "9", "--frames", "4", "--json")
    assert finished.code == 0, finished.err
    report = json.loads(finished.out)["recording"]
    folder = tmp_path / "tsis-sequence"
    rows = index(folder / "frames.csv")
    assert report["kept"] == len(rows) == 4
    assert report["missed"] == report["overrun"] == 0
    numbers = [int(row["sequence"]) for row in rows]
    assert numbers == list(range(numbers[0], numbers[0] + 4))
    expected = virtual_frames(9, numbers[-1] + 1)
    for row, number in zip(rows, numbers, strict=True):
        np.testing.assert_array_equal(grey(folder / row["kept_in"]), expected[number])
    summary = json.loads((folder / "recording.json").read_text())
    assert summary["report"] == report
    assert summary["calibration"] is None


def test_a_video_is_lossless_and_a_camera(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("acquire", *UNTOUCHED, "--seed", "2", "--seconds", "0.3", "--video", "--out", "film")
    assert finished.code == 0, finished.err
    rows = index(tmp_path / "film" / "frames.csv")
    assert len(rows) >= 2
    assert f"{len(rows)} frames in" in finished.out
    expected = virtual_frames(2, int(rows[-1]["sequence"]) + 1)
    played = cv2.VideoCapture(str(tmp_path / "film" / "frames.mkv"))
    for row in rows:
        present, colour = played.read()
        assert present
        np.testing.assert_array_equal(colour[..., 0], expected[int(row["sequence"])])
    played.release()
    modes = json.loads(run_tsis("acquire", "--modes", "--camera", "video:film/frames.mkv", "--json").out)["modes"]
    assert [mode["mode"] for mode in modes] == ["768x492@30"]


def test_a_folder_that_exists_is_left_as_it_is(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "seq").mkdir()
    (tmp_path / "seq" / "mine").write_text("here")
    assert run_tsis("acquire", *UNTOUCHED, "--frames", "1", "--out", "seq").code == 0
    assert everything(tmp_path) == {
        *("seq", "seq/mine", "seq-2", "seq-2/frame-000000.png", "seq-2/frames.csv", "seq-2/recording.json")
    }


OTHER_CODES = {"no serial port": 1}  # of messages that are no wrong input


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--camera", "webcam:0"), "no camera source is called 'webcam'"),
        (("--camera", "files:"), "files: must be followed by a path"),
        (("--camera", "files:nowhere"), "'nowhere' does not exist"),
        (("--camera", "video:blocked"), "blocked"),
        (("--camera", "opencv:x"), "opencv cameras go by their number"),
        ((*UNTOUCHED, "--mode", "640x480"), "no mode is called '640x480'"),
        ((*UNTOUCHED, "--set", "gain=99"), "gain must lie in [0, 24]; got 99 (dB)"),
        ((*UNTOUCHED, "--set", "gain=nan"), "gain must lie in [0, 24]; got nan"),
        ((*UNTOUCHED, "--set", "gian=1"), "no setting is called 'gian'; did you mean 'gain'?"),
        ((*UNTOUCHED, "--set", "gain"), "--set must be a name and a number"),
        ((*UNTOUCHED, "--set", "=1"), "--set must be a name and a number"),
        ((*UNTOUCHED, "--preset", "maximal"), "no preset is called 'maximal'"),
        (("--format", "gif"), "no picture format is called 'gif'"),
        (("--map", "jet"), "no colour map is called 'jet'"),
        (("--target", "0"), "--target"),
        (("--target", "100000"), "--target"),
        (("--frames", "0"), "--frames"),
        (("--seconds", "0"), "--seconds must lie in"),
        (("--seconds", "nan"), "--seconds must lie in"),
        (("--video",), "--video needs --seconds or --frames"),
        (("--force-n", "50"), "force_n must lie in [0, 5]"),
        (("--probe", "tsis-1811"), "no probe is called 'tsis-1811'"),
        (("--phantom", "size-800"), "no phantom is called 'size-800'"),
        (("--calibration", "blocked"), "must hold data; got an empty file"),
        (("--camera", "files:none", "--probe", "tsis-domed"), "--probe must be left out, or given for the virtual"),
        (("--camera", "files:none", "--force-n", "2"), "--force-n must be left out, or given for the virtual probe"),
        ((*UNTOUCHED, "--depth", "depth.json"), "--depth must be left out, or given for a gel sensor"),
        ((*UNTOUCHED, "--frames", "2", "--target", "7"), "--target must be left out, or given for a snapshot"),
        ((*UNTOUCHED, "--frames", "2", "--role", "plain"), "--role must be left out, or given for a snapshot"),
        ((*UNTOUCHED, "--watch", "--map", "inferno"), "--map must be left out, or given for a snapshot"),
        (("--gauge-unit", "N"), "need --gauge"),
        ((*UNTOUCHED, "--gauge-baud", "115200"), "need --gauge"),
        ((*UNTOUCHED, "--gauge-latency-ms", "40"), "need --gauge"),
        (("--gauge", "nowhere", *UNTOUCHED), "no serial port is called 'nowhere'"),
        ((*UNTOUCHED, "--out", "blocked"), "must be written into 'blocked/Target1'"),
        ((*UNTOUCHED, "--frames", "2", "--out", "blocked/in"), "must be a folder that can be created"),
        ((*UNTOUCHED, "--frames", "2", "--out", ".."), "must name a new folder"),
    ],
)
def test_wrong_input_is_one_sentence_and_nothing_is_written(
    run_tsis: RunTsis, tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    (tmp_path / "blocked").touch()
    finished = run_tsis("acquire", *arguments)
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in sentence), 2)
    assert sentence in finished.err
    assert finished.err.startswith("Error: ")
    assert finished.err.count("\n") == 1
    assert finished.out == ""
    assert everything(tmp_path) == {"blocked"}


def test_the_minimal_preset_is_set_and_a_given_setting_goes_before_it(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("acquire", *UNTOUCHED, "--preset", "minimal", "--set", "gain=6", "--json")
    sidecar = json.loads((tmp_path / json.loads(finished.out)["files"]["sidecar"]).read_text())
    assert sidecar["settings"]["gain"] == 6.0
    assert sidecar["settings"]["exposure_ms"] == 0.01
    assert sidecar["settings"]["brightness"] == 0.0


def calibrated(path: Path, **changes: Any) -> str:
    now = datetime.now(UTC)
    terms: dict[str, Any] = {
        "name": "bench",
        "camera": "virtual probe on hardness-100",
        "settings": {"exposure_ms": 20.0},
        "made": now - timedelta(days=2),
        "expires": now + timedelta(days=2),
    }
    return write_calibration(ProbeCalibration(**{**terms, **changes}), path)


def test_results_name_the_calibration(run_tsis: RunTsis, tmp_path: Path) -> None:
    identity = calibrated(tmp_path / "known.json")
    finished = run_tsis("acquire", *UNTOUCHED, "--calibration", "known.json", "--json")
    assert finished.code == 0, finished.err
    sidecar = json.loads((tmp_path / json.loads(finished.out)["files"]["sidecar"]).read_text())
    assert sidecar["calibration"]["sha256"] == identity
    assert run_tsis("acquire", *UNTOUCHED, "--calibration", "known.json", "--frames", "1").code == 0
    summary = json.loads((tmp_path / "tsis-sequence" / "recording.json").read_text())
    assert summary["calibration"]["sha256"] == identity


@pytest.mark.parametrize(
    ("changes", "arguments", "sentence"),
    [
        ({"camera": "Aravis-7"}, (), "must be of the camera in use, 'virtual probe on hardness-100'"),
        ({}, ("--set", "exposure_ms=10"), "holds at exposure_ms = 20; the camera is at 10"),
        ({"expires": datetime.now(UTC) - timedelta(hours=1)}, (), "must not be expired"),
        ({"made": datetime.now(UTC) + timedelta(hours=9)}, (), "must not come from the future"),
    ],
)
@pytest.mark.parametrize("sequence", [(), ("--frames", "1")])
def test_a_calibration_that_does_not_hold_here_is_refused(
    run_tsis: RunTsis,
    tmp_path: Path,
    changes: dict[str, Any],
    arguments: tuple[str, ...],
    sentence: str,
    sequence: tuple[str, ...],
) -> None:
    calibrated(tmp_path / "known.json", **changes)
    finished = run_tsis("acquire", *UNTOUCHED, "--calibration", "known.json", *arguments, *sequence)
    assert finished.code == 3
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
    assert everything(tmp_path) == {"known.json"}


def test_the_gauges_force_stands_beside_each_frame(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def gauge(port: str, **_: Any) -> SimulatedGauge:
        assert port == "port"
        return SimulatedGauge(lambda time_s: 1.25, rng=np.random.default_rng(1), rate_per_s=200.0)

    monkeypatch.setattr("tsis.instrument.force_log.SerialGauge", gauge)
    finished = run_tsis("acquire", *UNTOUCHED, "--gauge", "port", "--json")
    assert finished.code == 0, finished.err
    assert json.loads(finished.out)["force"]["force_n"] == pytest.approx(1.25, abs=0.01)
    finished = run_tsis("acquire", *UNTOUCHED, "--gauge", "port", "--frames", "3")
    assert finished.code == 0, finished.err
    rows = index(tmp_path / "tsis-sequence" / "frames.csv")
    assert [float(row["force_n"]) for row in rows] == pytest.approx([1.25] * 3, abs=0.01)
    assert all(0 < float(row["force_error_n"]) < 0.1 for row in rows)
