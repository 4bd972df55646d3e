"""What is kept is what was seen: frame, force, role, probe, calibration; and after a failure nothing is half kept."""

from __future__ import annotations

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
from tests.console.services.instruments import ANN, BOB, LIT, gauge, lit_instrument
from tests.console.services.lit_camera import observed
from tests.records.full_disk import FailingDisk
from tests.waiting import HANGS_S, until

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import CameraError, ControlError, FileInputError, GaugeError, InputError, RecordsError
from tsis.files.atomic import DISK
from tsis.instrument.gauge import LONGEST_GAP_S
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


def sha256(pixels: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(pixels).tobytes()).hexdigest()


def read(path: Path) -> NDArray[Any]:
    result = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert result is not None
    return result


def presses(instrument: Instrument, number: int = 1) -> list[str]:
    return [press.id for press in instrument.store.presses(instrument.store.target(number))]


def files(instrument: Instrument) -> set[str]:
    position = instrument.terms.workspace
    return {str(path.relative_to(position)) for path in position.glob("Target*/**/*") if path.is_file()}


def test_the_press_is_the_frame_that_is_seen(instrument: Instrument, world: World) -> None:
    instrument.start(by=ANN)
    world.level = 77
    instrument.hold(role="plain", force_n=0.6, by=ANN)
    begun = datetime.now(UTC)
    remaining = instrument.snapshot(by=ANN)
    ended = datetime.now(UTC)
    expected = sha256(observed(77, 2.0))
    acquisition = instrument.camera_controller.acquisition
    assert acquisition is not None
    ring, _, _ = acquisition.ring.read(0)
    shown = {item.frame.name: sha256(item.frame.pixels) for item in ring}
    assert shown[remaining.press.name] == expected  # that of the live view of the same number
    assert sha256(instrument.store.levels(remaining.press.frame)) == expected
    assert sha256(read(remaining.files.raw)) == expected
    assert read(remaining.files.colour).shape == (48, 64, 3)
    assert begun - timedelta(seconds=1) <= remaining.press.taken <= ended
    assert (remaining.press.role, remaining.press.force_n, remaining.press.mm_per_pixel) == ("plain", 0.6, None)
    assert (remaining.press.probe, remaining.press.calibration) == ("tsis-domed", None)  # as chosen with the camera
    assert (remaining.target.number, remaining.target.name, dict(remaining.target.truth)) == (1, "", {})
    sidecar = json.loads(remaining.files.sidecar.read_text())
    assert sidecar["notice"] == RESEARCH_USE_ONLY
    assert sidecar["force"] == {"force_n": 0.6, "source": "typed"}
    assert (sidecar["role"], sidecar["probe"], sidecar["calibration"]) == ("plain", "tsis-domed", None)
    assert (sidecar["target"], sidecar["settings"]) == (1, {"gain": 2.0})
    assert (
        {flag["name"] for flag in sidecar["flags"]}
        == set(remaining.press.flags)
        == {flag.name for flag in remaining.flags}
    )
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
    remaining = instrument.snapshot(by=ANN)
    assert remaining.target.name == "theirs"
    assert presses(instrument) == [remaining.press.id]


def test_a_gauge_tells_the_force(instrument: Instrument) -> None:
    instrument.hold(force_n=0.2, by=ANN)
    instrument.start(by=ANN)
    instrument.use_gauge(gauge(0.8), by=ANN)
    remaining = instrument.snapshot(by=ANN)
    assert remaining.press.force_n == pytest.approx(0.8, abs=0.01)
    assert json.loads(remaining.files.sidecar.read_text())["force"]["source"] == "gauge"
    instrument.use_gauge(None, by=ANN)
    assert instrument.snapshot(by=ANN).press.force_n == 0.2
    instrument.forget_force(by=ANN)
    remaining = instrument.snapshot(by=ANN)
    assert remaining.press.force_n is None
    assert json.loads(remaining.files.sidecar.read_text())["force"] is None


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
    remaining = instrument.snapshot(by=ANN)
    assert (instrument.store.levels(remaining.press.frame) == observed(99, 2.0)).all()
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
        reported, remaining = _attempted(instrument)
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
            assert presses(instrument) == [*owned, remaining]
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
    remaining = instrument.snapshot(by=ANN)
    assert (remaining.target.number, presses(instrument)) == (1, [remaining.press.id])


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
    guarded_app, remaining, reported = threading.Barrier(4), list[str](), list[str]()

    def press() -> None:
        guarded_app.wait(HANGS_S)
        try:
            remaining.append(instrument.snapshot(by=ANN).press.id)
        except ControlError as error:
            reported.append(str(error))

    threads = [threading.Thread(target=press) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(HANGS_S)
    assert sorted(presses(instrument)) == sorted(remaining)
    assert len(files(instrument)) == 3 * len(remaining)
    assert len(remaining) + len(reported) == 4
    assert instrument.camera_controller.name == LIT
