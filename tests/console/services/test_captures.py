"""Snapshots, sequences and own images: what is kept is what was seen, and nothing is half kept."""

from __future__ import annotations

import csv
import errno
import hashlib
import json
import shutil
import sqlite3
import threading
import time
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
import pytest
from PIL import Image
from tests.console.services.instruments import ANN, BOB, LIT, FixedGauge, gauge, lit_instrument
from tests.console.services.lit_camera import observed
from tests.console.services.test_camera import calibration_with
from tests.records.folders import save
from tests.records.full_disk import FailingDisk
from tests.waiting import HANGS_S, until

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.console.services.captures import OwnImage, measure_images, open_images, save_images
from tsis.errors import CameraError, ControlError, FileInputError, GaugeError, InputError, RecordsError
from tsis.files.atomic import DISK
from tsis.instrument.gauge import LONGEST_GAP_S
from tsis.instrument.recording import FrameFolder
from tsis.records import database as engines
from tsis.records.database import DATABASE_FILE
from tsis.records.importing import import_batches
from tsis.records.sources import ImportOptions, find_import_batches
from tsis.records.store import open_store, verify_store

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.console.services.lit_camera import World

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job
    from tsis.instrument.acquisition import Acquisition


def sha256(pixels: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(pixels).tobytes()).hexdigest()


def read(path: Path) -> NDArray[Any]:
    result = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert result is not None
    return result


def presses(instrument: Instrument, number: int = 1) -> list[str]:
    return [press.id for press in instrument.store.presses(instrument.store.target(number))]


def files(instrument: Instrument) -> set[str]:
    workspace = instrument.terms.workspace
    return {str(path.relative_to(workspace)) for path in workspace.glob("Target*/**/*") if path.is_file()}


def test_the_press_is_the_frame_that_is_seen(instrument: Instrument, world: World) -> None:
    instrument.start(by=ANN)
    world.level = 77
    instrument.hold(role="plain", force_n=0.6, by=ANN)
    begun = datetime.now(UTC)
    saved = instrument.snapshot(by=ANN)
    ended = datetime.now(UTC)
    expected = sha256(observed(77, 2.0))
    acquisition = instrument.camera_controller.acquisition
    assert acquisition is not None
    ring, _, _ = acquisition.ring.read(0)
    number = int(saved.press.name.removeprefix("lit#"))
    shown = {sha256(item.frame.pixels) for item in ring if item.frame.sequence >= number}
    assert shown == {expected}  # what the live view shows from the saved frame on
    assert sha256(instrument.store.levels(saved.press.frame)) == expected
    assert sha256(read(saved.files.raw)) == expected
    assert read(saved.files.colour).shape == (48, 64, 3)
    assert begun - timedelta(seconds=1) <= saved.press.taken <= ended
    assert (saved.press.role, saved.press.force_n, saved.press.mm_per_pixel) == ("plain", 0.6, None)
    assert (saved.press.probe, saved.press.calibration) == ("tsis-domed", None)  # as chosen with the camera
    assert (saved.target.number, saved.target.name, dict(saved.target.truth)) == (1, "", {})
    sidecar = json.loads(saved.files.sidecar.read_text())
    assert sidecar["notice"] == RESEARCH_USE_ONLY
    assert sidecar["force"] == {"force_n": 0.6, "source": "typed"}
    assert (sidecar["role"], sidecar["probe"], sidecar["calibration"]) == ("plain", "tsis-domed", None)
    assert (sidecar["target"], sidecar["settings"]) == (1, {"gain": 2.0})
    assert {flag["name"] for flag in sidecar["flags"]} == set(saved.press.flags) == {flag.name for flag in saved.flags}
    assert verify_store(instrument.store).sound


def test_it_is_kept_when_the_frame_came_and_not_when_it_was_written(
    instrument: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    instrument.start(by=ANN)
    arrival = instrument.camera_controller.fresh()
    monkeypatch.setattr(instrument.camera_controller, "fresh", lambda: arrival)
    until(lambda: time.monotonic() - arrival.arrived_s > 0.3)
    before = datetime.now(UTC)
    assert instrument.snapshot(by=ANN).press.taken < before - timedelta(seconds=0.25)


def test_every_snapshot_goes_to_the_target_of_its_moment(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    first = instrument.snapshot(by=ANN)
    instrument.set_target(7, by=ANN)
    second, third = instrument.snapshot(by=ANN), instrument.snapshot(by=ANN)
    assert (first.target.number, second.target.number, third.target.number) == (1, 7, 7)
    assert sorted(presses(instrument, 7)) == sorted([second.press.id, third.press.id])
    assert len([name for name in files(instrument) if name.startswith("Target")]) == 9
    for wrong in (0, 100_000, 1.5, "2", float("nan")):
        with pytest.raises(InputError, match="target must"):
            instrument.set_target(wrong, by=ANN)  # type: ignore[arg-type]
    assert instrument.state().target == 7


def test_a_number_that_somebody_else_enters_meanwhile_is_theirs_and_the_press_joins_it(
    instrument: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    instrument.start(by=ANN)
    enter = instrument.store.add_target

    def entered_before(**given: Any) -> Any:
        monkeypatch.undo()
        enter(number=given["number"], name="theirs")
        return enter(**given)

    monkeypatch.setattr(instrument.store, "add_target", entered_before)
    saved = instrument.snapshot(by=ANN)
    assert saved.target.name == "theirs"
    assert presses(instrument) == [saved.press.id]


def test_a_gauge_tells_the_force(instrument: Instrument) -> None:
    instrument.hold(force_n=0.2, by=ANN)
    instrument.start(by=ANN)
    instrument.use_gauge(gauge(0.8), by=ANN)
    saved = instrument.snapshot(by=ANN)
    assert saved.press.force_n == pytest.approx(0.8, abs=0.01)
    assert json.loads(saved.files.sidecar.read_text())["force"]["source"] == "gauge"
    instrument.use_gauge(None, by=ANN)
    assert instrument.snapshot(by=ANN).press.force_n == 0.2
    instrument.forget_force(by=ANN)
    saved = instrument.snapshot(by=ANN)
    assert saved.press.force_n is None
    assert json.loads(saved.files.sidecar.read_text())["force"] is None


def test_a_gauge_that_pulls_presses_nothing(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    instrument.use_gauge(gauge(0.0, zero_n=-0.4), by=ANN)
    assert instrument.snapshot(by=ANN).press.force_n == 0.0


def test_a_gauge_that_has_ended_keeps_no_press_and_says_so(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    log = gauge()
    instrument.use_gauge(log, by=ANN)
    log.stop()
    until(lambda: not log.state().running)
    (message,) = (item for item in instrument.state().trouble if "gauge" in item)
    assert message == "The gauge is away: its readings stopped."
    last_s = log.readings()[-1].time_s
    until(lambda: time.monotonic() - last_s > 2 * LONGEST_GAP_S)
    with pytest.raises(GaugeError):
        instrument.snapshot(by=ANN)
    assert files(instrument) == set()
    instrument.use_gauge(None, by=ANN)
    assert instrument.snapshot(by=ANN).press.force_n is None


def test_a_gauge_is_stopped_when_another_takes_its_place_and_not_by_itself(instrument: Instrument) -> None:
    first, second = gauge(), gauge()
    instrument.use_gauge(first, by=ANN)
    instrument.use_gauge(first, by=ANN)
    assert first.state().running
    instrument.use_gauge(second, by=ANN)
    until(lambda: not first.state().running)
    instrument.close()
    until(lambda: not second.state().running)


def test_nothing_is_kept_while_the_camera_is_away_and_the_next_one_is_of_after(
    instrument: Instrument, world: World
) -> None:
    instrument.start(by=ANN)
    instrument.snapshot(by=ANN)
    before = files(instrument)
    world.plugged = False
    until(lambda: instrument.state().camera.lost)
    assert (
        instrument.state().trouble[0].startswith("The camera is away: the camera's driver failed: RuntimeError: bulk")
    )
    with pytest.raises(CameraError, match="is away; nothing was saved"):
        instrument.snapshot(by=ANN)
    assert files(instrument) == before
    world.level, world.plugged = 99, True
    until(lambda: not instrument.state().camera.lost)
    saved = instrument.snapshot(by=ANN)
    assert (instrument.store.levels(saved.press.frame) == observed(99, 2.0)).all()
    assert instrument.state().trouble == ()


def test_who_does_not_hold_the_camera_keeps_nothing(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    with pytest.raises(ControlError, match="controlled by Ann"):
        instrument.snapshot(by=BOB)
    with pytest.raises(InputError, match="no colour map is called"):
        instrument.snapshot(by=ANN, map_name="rainbow")
    assert files(instrument) == set()


def _failing(monkeypatch: pytest.MonkeyPatch, *, lasting: bool) -> FailingDisk:
    disk = FailingDisk(errno.ENOSPC, lasting=lasting)
    for step in ("create", "write", "sync", "rename", "name", "sync_folder", "make_folder"):
        monkeypatch.setattr(DISK, step, getattr(disk, step))
    return disk


def _attempted(instrument: Instrument) -> tuple[FileInputError | RecordsError | None, str]:
    """What a snapshot says when it fails, or the press."""
    try:
        return None, instrument.snapshot(by=ANN).press.id
    except (FileInputError, RecordsError) as error:
        return error, ""


@pytest.mark.parametrize("lasting", [False, True])
def test_a_disk_that_is_full_at_any_step_leaves_nothing_half_kept(
    instrument: Instrument, world: World, monkeypatch: pytest.MonkeyPatch, lasting: bool
) -> None:
    instrument.start(by=ANN)
    instrument.snapshot(by=ANN)
    disk = _failing(monkeypatch, lasting=lasting)
    refused = {FileInputError: 0, RecordsError: 0}
    for step in range(100):
        before, owned = files(instrument), presses(instrument)
        world.level = 40 + step  # a frame that is new to the store
        instrument.hold(force_n=0.01 * step, by=ANN)
        disk.arm(step)
        reported, saved = _attempted(instrument)
        failed = disk.failed
        disk.arm(None)
        if isinstance(reported, FileInputError):
            assert "No space left" in str(reported)
            assert (files(instrument), presses(instrument)) == (before, owned)
        elif reported is not None:
            assert str(reported).startswith("the files are in")
            assert len(files(instrument) - before) == 3  # whole, for nobody can press the same again
            assert presses(instrument) == owned
        else:
            assert presses(instrument) == [*owned, saved]
            if not failed:
                break
        if reported is not None:
            refused[type(reported)] += 1
        if step % 5 == 0:
            owned = presses(instrument)
            assert {instrument.snapshot(by=ANN).press.id} == {*presses(instrument)} - {*owned}  # the next one is fine
    else:
        pytest.fail("it never passed")
    assert min(refused.values()) > 2
    assert verify_store(instrument.store).sound


def test_the_first_press_of_a_target_on_a_full_disk(instrument: Instrument, monkeypatch: pytest.MonkeyPatch) -> None:
    instrument.start(by=ANN)
    disk = _failing(monkeypatch, lasting=True)
    disk.arm(12)  # in the store, after the three files
    with pytest.raises((RecordsError, FileInputError)):
        instrument.snapshot(by=ANN)
    disk.arm(None)
    saved = instrument.snapshot(by=ANN)
    assert (saved.target.number, presses(instrument)) == (1, [saved.press.id])


def test_a_workspace_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with lit_instrument(tmp_path, workspace=tmp_path / "file" / "workspace") as instrument:
        instrument.start(by=ANN)
        with pytest.raises(FileInputError, match="the snapshot must be written into"):
            instrument.snapshot(by=ANN)
        with pytest.raises(FileInputError, match="must be a folder that can be made"):
            instrument.begin_sequence(frames=3, by=ANN)
        assert instrument.store.targets() == ()


def _locked(store: Path) -> Callable[[], None]:
    """Hold the database as another program that writes; the answer lets go."""
    other = sqlite3.connect(store / DATABASE_FILE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    return other.close


def test_a_store_that_another_program_writes_to_for_too_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "BUSY_S", 0.05)
    with lit_instrument(tmp_path) as instrument:
        instrument.start(by=ANN)
        first = instrument.snapshot(by=ANN)
        let_go = _locked(tmp_path / "store")
        with pytest.raises(RecordsError, match=r"the files are in .*Target1, but the press could not be saved"):
            instrument.snapshot(by=ANN)
        let_go()
        second = instrument.snapshot(by=ANN)
        assert presses(instrument) == [first.press.id, second.press.id]


def test_a_store_that_is_gone(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as instrument:
        instrument.start(by=ANN)
        instrument.snapshot(by=ANN)
        shutil.rmtree(tmp_path / "store")
        with pytest.raises(RecordsError, match="the files are in"):
            instrument.snapshot(by=ANN)
        assert len(files(instrument)) == 6
        assert instrument.state().camera.running


def test_a_press_that_the_store_did_not_take_can_be_entered_from_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "BUSY_S", 0.05)
    with lit_instrument(tmp_path) as instrument:
        instrument.start(by=ANN)
        instrument.hold(role="plain", force_n=0.6, by=ANN)
        let_go = _locked(tmp_path / "store")
        with pytest.raises(RecordsError):
            instrument.snapshot(by=ANN)
        let_go()
    with open_store(tmp_path / "store") as store:
        import_batches(store, find_import_batches([tmp_path / "workspace" / "Target1"], ImportOptions()))
        (press,) = store.presses(store.target(1))
        assert (press.role, press.force_n, press.settings["gain"]) == ("plain", 0.6, 2.0)
        assert press.probe == "tsis-domed"


def test_two_who_press_the_key_at_once_keep_two_presses(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    guarded_app, saved, reported = threading.Barrier(4), list[str](), list[str]()

    def press() -> None:
        guarded_app.wait(HANGS_S)
        try:
            saved.append(instrument.snapshot(by=ANN).press.id)
        except ControlError as error:
            reported.append(str(error))

    threads = [threading.Thread(target=press) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(HANGS_S)
    assert sorted(presses(instrument)) == sorted(saved)
    assert len(files(instrument)) == 3 * len(saved)
    assert len(saved) + len(reported) == 4
    assert instrument.camera_controller.name == LIT


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

    def saved(self: FrameFolder, frame: Any, number: int) -> str:
        if number >= after:
            raise OSError(errno.ENOSPC, "No space left on device")
        return keep(self, frame, number)

    monkeypatch.setattr(FrameFolder, "save", saved)
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


CENTRE, RADIUS_PX, SCALE_MM = (40.0, 30.0), 12.0, 0.1


def disc(folder: Path, name: str, *, light: float = 150.0) -> Path:
    """A frame with a bright disc of known centre and radius."""
    y, x = np.mgrid[0:60, 0:80]
    pressed = np.hypot(x - CENTRE[0], y - CENTRE[1]) <= RADIUS_PX
    file = folder / name
    Image.fromarray((20 + light * pressed).astype(np.uint8)).save(file)
    return file


@pytest.mark.parametrize("ending", ["png", "bmp", "tiff", "jpg"])
def test_every_image_form_is_opened(tmp_path: Path, ending: str) -> None:
    opened = open_images([disc(tmp_path, f"a.{ending}")], frames_in=tmp_path)
    assert [(image.name, image.columns, image.rows) for image in opened.images] == [(f"a.{ending}", 80, 60)]
    assert opened.refused == ()


def test_a_bad_file_is_named_and_the_good_ones_stay(tmp_path: Path) -> None:
    (tmp_path / "cut.png").write_bytes(disc(tmp_path, "b.png").read_bytes()[:60])
    (tmp_path / "notes.txt").write_text("no image")
    opened = open_images([tmp_path / name for name in ("cut.png", "b.png", "notes.txt")], frames_in=tmp_path)
    assert [image.name for image in opened.images] == ["b.png"]
    assert len(opened.refused) == 2
    assert "cut.png" in opened.refused[0]
    assert "notes.txt" in opened.refused[1]


def test_a_folder_gives_its_images_in_order(tmp_path: Path) -> None:
    for name in ("b.png", "a.bmp"):
        disc(tmp_path, name)
    assert [image.name for image in open_images([tmp_path], frames_in=tmp_path).images] == ["a.bmp", "b.png"]


def test_a_video_gives_its_frames(tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    (frames := tmp_path / "frames").mkdir()
    writer = cv2.VideoWriter(str(tmp_path / "v.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 10, (80, 60))
    for level in (30, 60, 90):
        writer.write(np.full((60, 80, 3), level, dtype=np.uint8))
    writer.release()
    opened = open_images([tmp_path / "v.avi"], frames_in=frames)
    assert [image.name for image in opened.images] == ["v-00000.png", "v-00001.png", "v-00002.png"]
    with Image.open(opened.images[2].path) as frame:
        assert abs(float(np.asarray(frame).mean()) - 90) < 3


def test_the_contact_is_measured_against_the_untouched_frame(tmp_path: Path) -> None:
    images = (
        OwnImage(path=disc(tmp_path, "press.png"), rows=60, columns=80),
        OwnImage(path=disc(tmp_path, "bare.png", light=0.0), rows=60, columns=80, role="untouched"),
    )
    (finding,), failed = measure_images(images, mm_per_pixel=(SCALE_MM, SCALE_MM))
    assert failed == ()
    assert finding.features.centroid_px == pytest.approx(CENTRE, abs=0.5)
    assert finding.features.equivalent_diameter_mm == pytest.approx(2 * RADIUS_PX * SCALE_MM, rel=0.1)


def test_frames_are_saved_with_their_role_and_force(tmp_path: Path) -> None:
    images = (
        OwnImage(path=disc(tmp_path, "press.png"), rows=60, columns=80, force_n=0.5),
        OwnImage(path=disc(tmp_path, "plain.png", light=90.0), rows=60, columns=80, role="plain", force_n=0.5),
    )
    with open_store(tmp_path / "store") as store:
        options = ImportOptions(mm_per_pixel=(SCALE_MM, SCALE_MM))
        assert save_images(store, images, number=None, options=options) == (1, 2)
        record = store.record(store.target(1))
        assert {(press.role, press.force_n) for press in record.presses} == {("target", 0.5), ("plain", 0.5)}
        with pytest.raises(InputError, match="at least one image"):
            save_images(store, (), number=None, options=options)


@pytest.mark.parametrize(("stated", "stored"), [({}, "plain"), ({"role": "untouched"}, "untouched")])
def test_a_snapshot_among_own_images_keeps_what_its_sidecar_says(
    tmp_path: Path, stated: dict[str, Any], stored: str
) -> None:
    sidecar = save(tmp_path / "camera", 1, force_n=0.5, **stated).sidecar
    (raw,) = sidecar.parent.glob(f"{sidecar.stem}-raw.*")
    mine = OwnImage(path=raw, rows=16, columns=24, role="plain", force_n=0.9)
    with open_store(tmp_path / "store") as store:
        number, _ = save_images(store, [mine], number=None, options=ImportOptions(mm_per_pixel=(0.1, 0.1)))
        (press,) = store.presses(store.target(number))
    assert (press.force_n, press.role) == (0.5, stored)
