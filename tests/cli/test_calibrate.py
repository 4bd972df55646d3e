from __future__ import annotations

import io
import itertools
import json
import shutil
import threading
from datetime import UTC, datetime, timedelta
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from benchmarks.calibration_force import PROBE, SENSOR
from tests.instrument.scripted_camera import ScriptedCamera, frame
from tests.waiting import HANGS_S

from tsis.calibration.file import ProbeCalibration, read_calibration, write_calibration
from tsis.calibration.session import SessionFolder, SessionSetup
from tsis.virtual.calibration_bench import VirtualBench

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.cli.conftest import RunTsis

    from tsis.calibration.session import CalibrationFrame, CalibrationStep

GUIDE = import_module("tsis.cli.calibrate")  # the package holds the command under this name
PITCH_MM = 1.5
QUICK = ("--tip-mm", "10", "--tip-mm", "14", "--pitch-mm", str(PITCH_MM))
STEPS = 10  # of a calibration with two tips
VALUES = {
    "name": "bench probe 2",
    "probe": "tsis-2011",
    "response": {"gain_grey_per_kpa": 60.0, "saturation_kpa": 20.0, "probe": "tsis-2011"},
}


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session with every step done, of a small camera."""
    bench = VirtualBench(PROBE, rng=np.random.default_rng(8), sensor=SENSOR, pitch_mm=PITCH_MM)
    session = SessionFolder(tmp_path_factory.mktemp("cli") / "frames")
    session.begin(
        SessionSetup(
            name="[/red] <b>",
            probe=PROBE.name,
            camera="[b]small",
            began=datetime.now(UTC).replace(microsecond=0),
            pitch_mm=PITCH_MM,
            patch_px=bench.patch_px,
            tips_mm=(10.0, 14.0),
        )
    )
    for step in session.plan():
        session.save(step, bench.shots(step))
    return session.path


@pytest.fixture
def small_bench(monkeypatch: pytest.MonkeyPatch) -> None:
    """The virtual bench of the guide with a small camera, to be quick."""
    monkeypatch.setattr("tsis.virtual.calibration_bench.VirtualBench", partial(VirtualBench, sensor=SENSOR))


def kept(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("command", [(), ("guide",), ("make",), ("light",), ("show",), ("seal",)])
def test_help_names_what_there_is(run_tsis: RunTsis, command: tuple[str, ...]) -> None:
    finished = run_tsis("calibrate", *command, "--help")
    assert finished.code == 0
    assert "Usage: tsis calibrate" in finished.out
    for each in command or ("guide", "make", "light", "show", "seal"):
        assert each in finished.out


@pytest.mark.usefixtures("small_bench")
def test_the_virtual_bench_start_to_end(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("calibrate", *QUICK, "--seed", "3", "--name", "first", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    folder = tmp_path / "tsis-calibration"
    assert {path.name for path in folder.iterdir()} == {"calibration.json", "index.html", "result.json"}
    known = read_calibration(folder / "calibration.json")
    assert (known.name, known.probe, known.camera) == ("first", "tsis-direct", "virtual bench, seed 3")
    known.require_usable(datetime.now(UTC) + timedelta(days=10_000))
    assert known.scale is not None
    low, high = document["values"]["scale x"]["interval_95"]
    assert low < known.scale.mm_per_pixel_x.value < high
    assert known.scale.mm_per_pixel_x.value == pytest.approx(SENSOR.mm_per_pixel[0], rel=0.02)
    assert known.scale.mm_per_pixel_y.value == pytest.approx(SENSOR.mm_per_pixel[1], rel=0.02)
    for number in range(1, STEPS + 1):
        assert f"{number} of {STEPS}, " in finished.err
    before = kept(tmp_path / "tsis-calibration-frames")
    again = run_tsis("calibrate", *QUICK, "--seed", "3", "--name", "first", "--json")
    assert again.code == 0, again.err
    assert again.err.count("done before") == STEPS
    assert json.loads(again.out)["sha256"] == document["sha256"]
    assert (tmp_path / "tsis-calibration-2" / "calibration.json").exists()
    assert kept(tmp_path / "tsis-calibration-frames") == before
    other = run_tsis("calibrate", *QUICK, "--seed", "4")
    assert other.code == 3
    assert "must be of probe 'tsis-direct' and camera 'virtual bench, seed 4'" in other.err


@pytest.mark.usefixtures("small_bench")
@pytest.mark.parametrize("error", [KeyboardInterrupt, OSError(28, "No space left on device")])
def test_an_interrupted_session_goes_on_with_the_step_that_was_not_finished(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, error: BaseException | type[BaseException]
) -> None:
    take = VirtualBench.shots

    def interrupted(bench: VirtualBench, step: CalibrationStep) -> Iterator[CalibrationFrame]:
        for number, shot in enumerate(take(bench, step)):
            if step.name == "board" and number == 2:
                raise error
            yield shot

    with monkeypatch.context() as patch:
        patch.setattr(VirtualBench, "shots", interrupted)
        stopped = run_tsis("calibrate", *QUICK, "--session", "s")
    assert stopped.code == (130 if error is KeyboardInterrupt else 2)
    if error is KeyboardInterrupt:
        assert "The steps before are saved in s; the same command resumes with board." in stopped.err
    done = ("dark", "untouched", "flat-1", "flat-2", "flat-3", "board-untouched")
    assert {path.name for path in (tmp_path / "s").iterdir()} == {"session.json", *done}
    if error is not KeyboardInterrupt:
        return  # the folder is that of the other case
    before = kept(tmp_path / "s")
    finished = run_tsis("calibrate", *QUICK, "--session", "s")
    assert finished.code == 0, finished.err
    assert "Resuming the session in s with its settings." in finished.err
    assert finished.err.count("done before") == len(done)
    after = kept(tmp_path / "s")
    assert {name: after[name] for name in before} == before


@pytest.mark.parametrize(
    ("changed", "began", "now"),
    [
        (("--pitch-mm", "2.4"), "--pitch-mm 1.5;", "--pitch-mm 2.4 ("),
        (("--pitch-sd-mm", "0.1"), "--pitch-sd-mm 0;", "--pitch-sd-mm 0.1 ("),
        (("--gauge-uncertainty", "0.02"), "--gauge-uncertainty 0.001;", "--gauge-uncertainty 0.02 ("),
        (("--name", "b", "--repeats", "2"), "--name 'bench' --repeats 1;", "--name 'b' --repeats 2 ("),
        (("--tip-mm", "2"), "--tip-mm 10 --tip-mm 14;", "--tip-mm 10 --tip-mm 14 --tip-mm 2 ("),
    ],
)
@pytest.mark.usefixtures("small_bench")
def test_a_session_does_not_go_on_with_other_options(
    run_tsis: RunTsis, tmp_path: Path, changed: tuple[str, ...], began: str, now: str
) -> None:
    bench = VirtualBench(PROBE, rng=np.random.default_rng(4), sensor=SENSOR, pitch_mm=PITCH_MM)
    SessionFolder(tmp_path / "s").begin(
        SessionSetup(
            name="bench",
            probe="tsis-direct",
            camera="virtual bench, seed 4",
            pitch_mm=PITCH_MM,
            patch_px=bench.patch_px,
            tips_mm=(10.0, 14.0),
        )
    )
    before = kept(tmp_path / "s")
    finished = run_tsis("calibrate", *QUICK, *changed, "--session", "s")
    assert finished.code == 3
    assert f"the session in 's' began with {began}" in finished.err
    assert f"this command gives {now}" in finished.err
    assert "or choose another --session" in finished.err
    assert finished.err.count("\n") == 1
    assert kept(tmp_path / "s") == before


@pytest.mark.slow
def test_the_virtual_bench_at_full_size(run_tsis: RunTsis, tmp_path: Path) -> None:
    finished = run_tsis("calibrate", "--json")
    assert finished.code == 0, finished.err
    document = json.loads(finished.out)
    values = {name: each["interval_95"] for name, each in document["values"].items()}
    for name, truth in (("scale x", 0.0336), ("scale y", 0.0392)):
        low, high = values[name]
        middle, half = (low + high) / 2, (high - low) / 2
        # Half of the width is for the map's bend over a pitch, which this board shows beyond its noise.
        assert abs(truth - middle) < 2 * half < 0.008 * truth
    shown = run_tsis("calibrate", "show", "tsis-calibration/calibration.json")
    assert "It may be used today." in shown.out


@pytest.mark.slow
def test_make_repeats_the_calibration_and_its_page_is_safe(run_tsis: RunTsis, frames: Path, tmp_path: Path) -> None:
    finished = run_tsis("calibrate", "make", frames, "--days", "30", "--out", "made")
    assert finished.code == 0, finished.err
    assert "[/red] <b>" in finished.out
    assert "[b]small" in finished.out
    assert "Research use only" in finished.out
    page = (tmp_path / "made" / "index.html").read_text()
    assert "&lt;b&gt;" in page
    assert "[/red] <b>" not in page
    known = read_calibration(tmp_path / "made" / "calibration.json")
    assert known.made is not None
    assert known.expires == known.made + timedelta(days=30)
    assert known.made == SessionFolder(frames).setup().began
    shown = run_tsis("calibrate", "show", "made/calibration.json")
    assert shown.code == 0
    assert "[/red] <b>" in shown.out
    assert "[b]small" in shown.out
    assert "It may be used today." in shown.out


def test_show_refuses_what_was_changed_and_says_what_expired(run_tsis: RunTsis, tmp_path: Path) -> None:
    now = datetime.now(UTC)
    path = tmp_path / "old.json"
    write_calibration(ProbeCalibration(name="old", made=now - timedelta(days=9), expires=now - timedelta(days=2)), path)
    shown = run_tsis("calibrate", "show", path)
    assert shown.code == 0
    assert "calibration 'old' must not be expired" in shown.out
    assert "It may be used" not in shown.out
    document = json.loads(run_tsis("calibrate", "show", path, "--json").out)
    assert document["usable"] is False
    assert "must not be expired" in document["refusal"]
    path.write_text(path.read_text().replace('"old"', '"new"'))
    changed = run_tsis("calibrate", "show", path)
    assert changed.code == 3
    assert "its content does not match its hash" in changed.err
    assert changed.err.count("\n") == 1
    assert changed.out == ""


def test_sealed_values_are_a_calibration_that_examine_takes(run_tsis: RunTsis, tmp_path: Path) -> None:
    (tmp_path / "values.json").write_text(json.dumps(VALUES))
    finished = run_tsis("calibrate", "seal", "values.json", "--days", "10", "--json")
    assert finished.code == 0, finished.err
    known = read_calibration(tmp_path / "calibration.json")
    assert known.made is not None
    assert known.expires == known.made + timedelta(days=10)
    assert known.response is not None
    assert known.response.gain_grey_per_kpa == 60.0
    taken = run_tsis("acquire", "--force-n", "0", "--format", "png", "--calibration", "calibration.json", "--json")
    snapshot = json.loads(taken.out)
    assert snapshot["calibration"]["sha256"] == json.loads(finished.out)["sha256"]
    examine = ("examine", snapshot["files"]["raw"], "--calibration")
    assert "needs --scale-mm and --force-n" in run_tsis(*examine, "calibration.json").err  # it was read before
    text = (tmp_path / "calibration.json").read_text()
    (tmp_path / "changed.json").write_text(text.replace("60.0", "61.0"))
    assert "does not match its hash" in run_tsis(*examine, "changed.json").err
    again = run_tsis("calibrate", "seal", "values.json")
    assert again.code == 2
    assert "must be a new file" in again.err


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("", "must hold data; got an empty file"),
        ("{", "must be a readable JSON file"),
        ("[1]", "must hold a JSON object; got list"),
        ("{}", "name"),
        ('{"name": 3}', "calibration.name must be text"),
        ('{"name": "x", "gain": 3}', "must hold only known values; got ['gain']"),
        ('{"name": "x", "response": {"gain_grey_per_kpa": NaN, "saturation_kpa": 20}}', "gain_grey_per_kpa"),
        ('{"name": "x", "response": {"gain_grey_per_kpa": -1, "saturation_kpa": 20}}', "gain_grey_per_kpa"),
        ('{"name": "x", "settings": {"gain": "high"}}', "calibration.settings.gain must be a number"),
        ('{"name": "x"}', "must hold at least one of response, scale; got none"),
        (json.dumps({**VALUES, "made": "2020-01-01T00:00:00+00:00"}), "got made, which a session's frames give"),
        (json.dumps({**VALUES, "expires": "2020-01-01T00:00:00+00:00"}), "got expires, which"),
        (json.dumps({**VALUES, "specification": {"probe": "tsis-2011", "rows": []}}), "got specification, which"),
        (json.dumps({**VALUES, "reference": {}, "force_line": {}}), "written by hand (name, probe, camera"),
        (json.dumps({**VALUES, "name": "\ud800"}), "name must be printable, on one line; got '\\ud800'"),
        (json.dumps({**VALUES, "probe": "tsis-domed"}), "response.probe must be that of the calibration"),
    ],
)
def test_values_that_are_none_are_not_sealed(run_tsis: RunTsis, tmp_path: Path, content: str, sentence: str) -> None:
    (tmp_path / "values.json").write_text(content)
    finished = run_tsis("calibrate", "seal", "values.json")
    assert finished.code == 2
    assert sentence in finished.err
    assert finished.err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"values.json"}


OTHER_CODES = {"no serial port": 1}  # of messages that are no wrong input


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("--tip-mm", "0"), "tip_radius_mm must lie in [0.1, 1000]; got 0"),
        (("--tip-mm", "2", "--tip-mm", "2"), "tips_mm must hold each tip once"),
        (("--days", "0"), "--days must lie in [1, 3650]"),
        (("--days", "nan"), "--days must lie in [1, 3650]"),
        (("--pitch-mm", "-1"), "pitch_mm must lie in"),
        (("--pitch-sd-mm", "nan"), "pitch_sd_mm must lie in"),
        (("--gauge-uncertainty", "3"), "gauge_share must lie in"),
        (("--repeats", "0"), "--repeats"),
        (("--name", "two\nlines"), "name must be printable, on one line; got 'two\\nlines'"),
        (("--name", "n" * 201), "name must hold at most 200 characters; got 201"),
        (("--probe", "nobody"), "no probe is called 'nobody'"),
        (("--camera", "webcam:0"), "no camera source is called 'webcam'"),
        (("--camera", "files:nowhere"), "'nowhere' does not exist"),
        (("--camera", "files:nowhere", "--patch-px", "1,2,3"), "--patch-px must be left,top,right,bottom"),
        (("--camera", "files:nowhere", "--patch-px", "9,9,3,3"), "patch_px must be left < right"),
        (("--camera", "files:nowhere", "--set", "gain"), "--set must be a name and a number"),
        (("--camera", "files:nowhere", "--gauge", "nowhere"), "no serial port is called 'nowhere'"),
        (("--gauge", "nowhere"), "need --camera; the virtual rig has its own"),
        (("--gauge-latency-ms", "40"), "need --camera; the virtual rig has its own"),
        (("--set", "gain=1"), "need --camera; the virtual rig has its own"),
        (("--session", "blocked"), "must be a folder that can be written"),
        (("make", "nowhere"), "session.json' does not exist"),
        (("make", "blocked"), "blocked"),
        (("show", "blocked"), "must hold data; got an empty file"),
        (("show", "nowhere"), "'nowhere' does not exist"),
        (("bogus",), "bogus"),
    ],
)
def test_wrong_input_is_one_sentence_before_anything_is_written(
    run_tsis: RunTsis, tmp_path: Path, arguments: tuple[str, ...], sentence: str
) -> None:
    (tmp_path / "blocked").touch()
    finished = run_tsis("calibrate", *arguments)
    assert finished.code == next((code for text, code in OTHER_CODES.items() if text in sentence), 2)
    assert sentence in finished.err
    assert finished.err.startswith("Error: ")
    assert finished.err.count("\n") == 1
    assert {path.name for path in tmp_path.iterdir()} == {"blocked"}


def test_a_session_that_is_not_finished_names_what_is_missing(run_tsis: RunTsis, frames: Path, tmp_path: Path) -> None:
    shutil.copytree(frames, tmp_path / "half")
    shutil.rmtree(tmp_path / "half" / "tip-14mm-1")
    finished = run_tsis("calibrate", "make", "half")
    assert finished.code == 3
    assert finished.err == "Error: steps must be done first: tip-14mm-1; 'half' lacks them\n"


class Playing(ScriptedCamera):
    """A camera whose frames never end."""

    def frames(self) -> Iterator[Any]:
        exposure = threading.Event()
        for number in itertools.count():
            exposure.wait(0.002)
            if not self._running.is_set():
                return
            yield frame(number, level=number % 200)


def answered(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(text))


@pytest.fixture
def playing(monkeypatch: pytest.MonkeyPatch) -> Playing:
    camera = Playing()
    monkeypatch.setattr(GUIDE, "live_connector", lambda spec: lambda: camera)
    monkeypatch.setattr("tsis.calibration.session.TIMEOUT_S", HANGS_S)  # a busy machine brings frames late
    monkeypatch.setattr("tsis.instrument.acquisition.FIRST_FRAME_S", HANGS_S)
    return camera


def test_answers_guide_a_session_and_forces_may_be_typed(
    run_tsis: RunTsis, monkeypatch: pytest.MonkeyPatch, playing: Playing, tmp_path: Path
) -> None:
    arguments = ("calibrate", "--camera", "opencv:0", "--probe", "mine", "--session", "s", "--tip-mm", "2")
    #            dark, untouched, flats left out, boards, edge left out, tip: forces, one mistyped
    answered(monkeypatch, "\n\ns\nS\n s \n\n\ns\n\n0\n0,5\nhalf\n500\n1.25\n")
    stopped = run_tsis(*arguments)
    assert stopped.code == 2
    assert "that is no number" in stopped.err
    assert "force_n must lie in [-100, 100]; got 500 (newtons)" in stopped.err
    assert stopped.err.endswith("which has ended; run it in a terminal\n")
    assert stopped.err.count("left out") == 4
    session = SessionFolder(tmp_path / "s")
    assert session.missing() == ("tip-2mm-1",)  # its answers had not ended
    assert session.setup().settings == {"gain": 1.0}
    assert len(session.shots(session.plan()[0])) == 16
    answered(monkeypatch, "s\ns\ns\ns\n\n0\n0,5\n1.25\n\n")
    finished = run_tsis(*arguments)
    assert finished.code == 3
    assert "step 'board': " in finished.err  # which shows no dots
    (tip,) = (step for step in session.plan() if step.is_loading)
    assert [shot.force_n for shot in session.shots(tip)] == [0.0, 0.5, 1.25]
    playing.gain = 2.0
    answered(monkeypatch, "")
    other = run_tsis(*arguments)
    assert other.code == 3
    assert "began at gain = 1; the camera is at 2 (--set gain=1, or choose another --session)" in other.err


def test_the_light_of_a_session_without_pads_is_refused(run_tsis: RunTsis, tmp_path: Path) -> None:
    SessionFolder(tmp_path / "frames").begin(SessionSetup(name="bench", probe="tsis-domed", camera="small"))
    finished = run_tsis("calibrate", "light", "frames")
    assert finished.code == 3
    assert finished.err == (
        "Error: the session in 'frames' must hold presses on soft flat pads; it holds none (tsis calibrate --pad-kpa 5 "
        "--pad-kpa 10)\n"
    )
