"""Sequences: every end, every frame accounted for, nothing written over."""

from __future__ import annotations

import csv
import errno
import json
import time
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from tests.console.services.instruments import ANN, FixedGauge, gauge
from tests.console.services.lit_camera import observed
from tests.console.services.test_active_calibration import calibration_with
from tests.waiting import HANGS_S, until

from tsis.errors import CameraError, ControlError, InputError
from tsis.instrument.gauge import LONGEST_GAP_S
from tsis.instrument.recording import FrameFolder

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from tests.console.services.lit_camera import World

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job
    from tsis.instrument.acquisition import Acquisition


def over(job: Job) -> dict[str, Any]:
    assert job.wait(HANGS_S)
    assert job.state().status == "done", job.state().sentence
    return job.result  # type: ignore[no-any-return]


def rows(folder: Path) -> list[dict[str, str]]:
    with (folder / "frames.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def newest_s(acquisition: Acquisition) -> float:
    latest = acquisition.latest()
    return 0.0 if latest is None else latest.arrived_s


@pytest.fixture
def running(instrument: Instrument) -> Instrument:
    instrument.start(by=ANN)
    return instrument


def test_it_ends_after_so_many_frames_which_are_those_of_the_camera(running: Instrument, tmp_path: Path) -> None:
    running.hold(role="plain", force_n=0.4, by=ANN)
    job = running.begin_sequence(frames=12, by=ANN)
    result = over(job)
    folder = tmp_path / "workspace" / "Target1" / "sequence"
    assert result["folder"] == str(folder)
    report = result["report"]
    assert (report["kept"], report["overrun"], report["ended_by"]) == (12, 0, "")
    state = job.state()
    assert (state.title, state.done, state.total) == ("sequence of target 1", 12, 12)
    assert state.sentence.startswith("12 frames in ")
    assert running.state().sequence == state
    index = rows(folder)
    assert [row["number"] for row in index] == [str(number) for number in range(12)]
    sequences = [int(row["sequence"]) for row in index]
    assert sequences[-1] - sequences[0] + 1 == report["kept"] + report["missed"]
    assert {(row["force_n"], row["force_source"]) for row in index} == {("0.400000", "typed")}
    for row in index:
        pixels = cv2.imread(str(folder / row["kept_in"]), cv2.IMREAD_UNCHANGED)
        assert pixels is not None
        assert (pixels == observed(50, 2.0)).all()
    reported = json.loads((folder / "recording.json").read_text())
    assert (reported["target"], reported["role"], reported["probe"], reported["calibration"]) == (
        1,
        "plain",
        "tsis-domed",
        None,
    )


def test_it_ends_after_so_long(running: Instrument) -> None:
    job = running.begin_sequence(seconds=0.3, by=ANN)
    report = over(job)["report"]
    assert report["kept"] >= 1
    assert report["ended_by"] == ""
    assert 0.0 < report["seconds"] <= 30.0  # from the first frame to the last, which both lie within the time
    assert job.state().total == 3


def test_it_ends_when_asked_by_whoever_holds_the_camera_then(running: Instrument) -> None:
    job = running.begin_sequence(frames=100_000, by=ANN)
    until(lambda: job.state().done > 5)
    running.control.take("tab bob", "Bob", over=True)
    with pytest.raises(ControlError, match="Bob has taken the camera over"):
        running.end_sequence(by=ANN)
    running.end_sequence(by="tab bob")
    assert over(job)["report"]["kept"] > 5
    running.end_sequence(by="tab bob")  # there is none


def test_it_begins_at_once_whatever_else_is_under_way(running: Instrument) -> None:
    for _ in range(5):
        running.jobs.begin("an estimate that lasts", FixedGauge())
    assert over(running.begin_sequence(frames=5, by=ANN))["report"]["kept"] == 5


def test_what_would_end_the_stream_waits_and_the_rest_goes_on(running: Instrument) -> None:
    job = running.begin_sequence(frames=100_000, by=ANN)
    forbidden = (
        lambda: running.stop(by=ANN),
        lambda: running.choose(running.camera_controller.choice, by=ANN),
        lambda: running.use_calibration(None, by=ANN),
        lambda: running.use_gauge(None, by=ANN),
        lambda: running.begin_sequence(frames=1, by=ANN),
    )
    for command in forbidden:
        with pytest.raises(ControlError, match=r"a sequence is being recorded; .* when it is over \(or end it\)"):
            command()
    running.hold(force_n=0.3, by=ANN)
    running.adjust("gain", 4.0, by=ANN)
    running.snapshot(by=ANN)
    running.end_sequence(by=ANN)
    over(job)
    running.stop(by=ANN)


def test_no_folder_is_written_over(running: Instrument, tmp_path: Path) -> None:
    folders = [over(running.begin_sequence(frames=2, by=ANN))["folder"] for _ in range(3)]
    position = tmp_path / "workspace" / "Target1"
    assert folders == [str(position / name) for name in ("sequence", "sequence-2", "sequence-3")]


def test_a_camera_that_is_lost_on_the_way_loses_nothing_that_was_kept(running: Instrument, world: World) -> None:
    job = running.begin_sequence(frames=40, by=ANN)
    until(lambda: job.state().done > 5)
    world.plugged = False
    until(lambda: running.state().camera.lost)
    assert job.state().status == "running"
    world.plugged = True
    result = over(job)
    assert (result["report"]["kept"], result["report"]["interruptions"]) == (40, 1)
    connections = [int(row["connection"]) for row in rows(running.terms.workspace / "Target1" / "sequence")]
    assert connections == sorted(connections)
    assert len(set(connections)) > 1


def test_a_camera_that_stays_away_is_waited_for_until_somebody_ends_it(running: Instrument, world: World) -> None:
    job = running.begin_sequence(frames=100_000, by=ANN)
    until(lambda: job.state().done > 5)
    world.plugged = False
    until(lambda: running.state().camera.lost)
    running.end_sequence(by=ANN)
    assert over(job)["report"]["kept"] == len(rows(running.terms.workspace / "Target1" / "sequence"))
    with pytest.raises(CameraError, match="must run to record a sequence; it is away"):
        running.begin_sequence(frames=1, by=ANN)


@pytest.mark.parametrize("after", [0, 7])
def test_a_disk_that_fills_ends_it_with_what_was_kept(
    running: Instrument, monkeypatch: pytest.MonkeyPatch, after: int
) -> None:
    keep = FrameFolder.save

    def remaining(self: FrameFolder, frame: Any, number: int) -> str:
        if number >= after:
            raise OSError(errno.ENOSPC, "No space left on device")
        return keep(self, frame, number)

    monkeypatch.setattr(FrameFolder, "save", remaining)
    job = running.begin_sequence(frames=100, by=ANN)
    assert job.wait(HANGS_S)
    state = job.state()
    if after == 0:
        assert (state.status, job.result) == ("failed", None)
        assert state.sentence.startswith("nothing was recorded: ")
    else:
        assert (state.status, job.result["report"]["kept"]) == ("done", after)
        assert "ended early: " in state.sentence
    assert "took no more frames" in state.sentence
    assert "No space left" in state.sentence
    monkeypatch.undo()
    assert over(running.begin_sequence(frames=2, by=ANN))["report"]["kept"] == 2


def test_the_gauge_is_read_at_every_frame(running: Instrument, tmp_path: Path) -> None:
    running.use_gauge(gauge(0.8), by=ANN)
    over(running.begin_sequence(frames=10, by=ANN))
    folder = tmp_path / "workspace" / "Target1" / "sequence"
    forces = np.array([float(row["force_n"]) for row in rows(folder)])
    assert np.abs(forces - 0.8).max() < 0.02
    assert json.loads((folder / "recording.json").read_text())["gauge"]["frames_without_force"] == 0


def test_a_gauge_that_ends_holds_up_no_frame(running: Instrument, tmp_path: Path) -> None:
    log, acquisition = gauge(0.8), running.camera_controller.acquisition
    assert acquisition is not None
    running.use_gauge(log, by=ANN)
    job = running.begin_sequence(frames=100_000, by=ANN)
    until(lambda: job.state().done > 5)
    log.stop()
    silent_s = time.monotonic() + LONGEST_GAP_S
    until(lambda: newest_s(acquisition) > silent_s)
    received = acquisition.account().received
    until(lambda: job.state().done > received)  # so that frames are kept that came after it had ended
    running.end_sequence(by=ANN)
    report = over(job)["report"]
    assert report["overrun"] == 0
    folder = tmp_path / "workspace" / "Target1" / "sequence"
    index = rows(folder)
    assert index[0]["force_n"] != ""
    assert {row["force_n"] for row in index if float(row["arrived_s"]) > silent_s} == {""}
    reported = json.loads((folder / "recording.json").read_text())
    assert reported["gauge"]["frames_without_force"] == sum(row["force_n"] == "" for row in index)


def test_a_force_that_is_typed_meanwhile_is_that_of_the_frames_from_then_on(running: Instrument) -> None:
    running.hold(force_n=0.4, by=ANN)
    job = running.begin_sequence(frames=100_000, by=ANN)
    commands: tuple[Callable[[], None], ...] = (
        lambda: running.hold(force_n=0.9, by=ANN),
        lambda: running.forget_force(by=ANN),
        lambda: running.end_sequence(by=ANN),
    )
    for command in commands:
        done = job.state().done
        until(lambda done=done: job.state().done > done + 5)  # type: ignore[misc]
        command()
    folder = over(job)["folder"]
    forces = [row["force_n"] for row in rows(running.terms.workspace / "Target1" / "sequence")]
    assert list(dict.fromkeys(forces)) == ["0.400000", "0.900000", ""]
    assert forces == sorted(forces, key=["0.400000", "0.900000", ""].index)
    assert folder.endswith("sequence")


def test_something_else_is_pressed_when_it_is_over(running: Instrument) -> None:
    job = running.begin_sequence(frames=100_000, by=ANN)
    with pytest.raises(ControlError, match="a sequence is being recorded; something else can be pressed when"):
        running.hold(role="plain", force_n=0.2, by=ANN)
    running.hold(role="target", force_n=0.3, by=ANN)  # which it is already
    until(lambda: job.state().done > 0)
    running.end_sequence(by=ANN)
    over(job)
    running.hold(role="plain", by=ANN)
    assert (running.state().role, running.state().force_n) == ("plain", 0.3)


@pytest.mark.parametrize("gain", [2.0, 5.0])
def test_a_calibration_that_is_put_out_of_force_on_the_way_is_told(running: Instrument, gain: float) -> None:
    running.use_calibration(calibration_with(), by=ANN)
    job = running.begin_sequence(frames=100_000, by=ANN)
    until(lambda: job.state().done > 5)
    running.adjust("gain", gain, by=ANN)
    running.end_sequence(by=ANN)
    over(job)
    reported = json.loads((running.terms.workspace / "Target1" / "sequence" / "recording.json").read_text())
    assert reported["calibration"]["sha256"] == calibration_with().identity
    ends = {name: value for name, value in reported.items() if name.endswith("_at_end")}
    assert ends == ({} if gain == 2.0 else {"calibration_at_end": None, "probe_at_end": "tsis-domed"})


@pytest.mark.parametrize(
    "ends",
    [
        {},
        {"seconds": 1.0, "frames": 3},
        {"seconds": 0.0},
        {"seconds": 4000.0},
        {"seconds": float("nan")},
        {"frames": 0},
        {"frames": 200_001},
        {"frames": 1.5},
        {"frames": "3"},
    ],
)
def test_an_end_that_is_none_is_refused_and_no_folder_made(running: Instrument, ends: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        running.begin_sequence(**ends, by=ANN)
    assert not (running.terms.workspace / "Target1").exists()
    assert running.state().sequence is None


def test_a_stopped_camera_records_nothing(instrument: Instrument) -> None:
    with pytest.raises(CameraError, match="it is stopped"):
        instrument.begin_sequence(frames=1, by=ANN)
    assert not (instrument.terms.workspace / "Target1").exists()


def test_closing_ends_it_as_a_whole_one(running: Instrument) -> None:
    job = running.begin_sequence(frames=100_000, by=ANN)
    until(lambda: job.state().done > 5)
    running.close()
    folder = running.terms.workspace / "Target1" / "sequence"
    reported = json.loads((folder / "recording.json").read_text())
    assert reported["report"]["kept"] == len(rows(folder)) == over(job)["report"]["kept"]
