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
from tests.console.services.lit_camera import seen
from tests.console.services.instruments import ANN, BOB, LIT, gauge, lit_bench
from tests.records.full_disk import FailingDisk
from tests.waiting import HANGS_S, until

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import CameraError, ControlError, FileInputError, GaugeError, InputError, RecordsError
from tsis.files import DISK
from tsis.instrument.gauge._alignment import LONGEST_GAP_S
from tsis.records.importing import ImportOptions, find_import_batches, import_batches
from tsis.records.store import DATABASE_FILE, open_store, verify_store
from tsis.records.store import _engines as engines

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray
    from tests.console.services.lit_camera import World

    from tsis.console.services import Instrument


def sha256(pixels: NDArray[Any]) -> str:
    return hashlib.sha256(np.ascontiguousarray(pixels).tobytes()).hexdigest()


def read(path: Path) -> NDArray[Any]:
    found = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert found is not None
    return found


def presses(bench: Instrument, number: int = 1) -> list[str]:
    return [press.id for press in bench.store.presses(bench.store.target(number))]


def files(bench: Instrument) -> set[str]:
    place = bench.terms.workspace
    return {str(path.relative_to(place)) for path in place.rglob("*") if path.is_file()}


def test_the_press_is_the_frame_that_is_seen(bench: Instrument, world: World) -> None:
    bench.start(by=ANN)
    world.level = 77
    bench.hold(role="plain", force_n=0.6, by=ANN)
    begun = datetime.now(UTC)
    kept = bench.snapshot(by=ANN)
    ended = datetime.now(UTC)
    wanted = sha256(seen(77, 2.0))
    acquisition = bench.camera_controller.acquisition
    assert acquisition is not None
    ring, _, _ = acquisition.ring.read(0)
    shown = {each.frame.name: sha256(each.frame.pixels) for each in ring}
    assert shown[kept.press.name] == wanted  # that of the live view of the same number
    assert sha256(bench.store.levels(kept.press.frame)) == wanted
    assert sha256(read(kept.files.raw)) == wanted
    assert read(kept.files.colour).shape == (48, 64, 3)
    assert begun - timedelta(seconds=1) <= kept.press.taken <= ended
    assert (kept.press.role, kept.press.force_n, kept.press.mm_per_pixel) == ("plain", 0.6, None)
    assert (kept.press.probe, kept.press.calibration) == ("tsis-domed", None)  # as chosen with the camera
    assert (kept.target.number, kept.target.name, dict(kept.target.truth)) == (1, "", {})
    sidecar = json.loads(kept.files.sidecar.read_text())
    assert sidecar["notice"] == RESEARCH_USE_ONLY
    assert sidecar["force"] == {"force_n": 0.6, "source": "typed"}
    assert (sidecar["role"], sidecar["probe"], sidecar["calibration"]) == ("plain", "tsis-domed", None)
    assert (sidecar["target"], sidecar["settings"]) == (1, {"gain": 2.0})
    assert {flag["name"] for flag in sidecar["flags"]} == set(kept.press.flags) == {flag.name for flag in kept.flags}
    assert verify_store(bench.store).sound


def test_it_is_kept_when_the_frame_came_and_not_when_it_was_written(
    bench: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.start(by=ANN)
    arrival = bench.camera_controller.fresh()
    monkeypatch.setattr(bench.camera_controller, "fresh", lambda: arrival)
    until(lambda: time.monotonic() - arrival.arrived_s > 0.3)
    before = datetime.now(UTC)
    assert bench.snapshot(by=ANN).press.taken < before - timedelta(seconds=0.25)


def test_every_snapshot_goes_to_the_target_of_its_moment(bench: Instrument) -> None:
    bench.start(by=ANN)
    first = bench.snapshot(by=ANN)
    bench.set_target(7, by=ANN)
    second, third = bench.snapshot(by=ANN), bench.snapshot(by=ANN)
    assert (first.target.number, second.target.number, third.target.number) == (1, 7, 7)
    assert sorted(presses(bench, 7)) == sorted([second.press.id, third.press.id])
    assert len(files(bench)) == 9
    for wrong in (0, 100_000, 1.5, "2", float("nan")):
        with pytest.raises(InputError, match="target must"):
            bench.set_target(wrong, by=ANN)  # type: ignore[arg-type]
    assert bench.state().target == 7


def test_a_number_that_somebody_else_enters_meanwhile_is_theirs_and_the_press_joins_it(
    bench: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.start(by=ANN)
    enter = bench.store.add_target

    def entered_before(**given: Any) -> Any:
        monkeypatch.undo()
        enter(number=given["number"], name="theirs")
        return enter(**given)

    monkeypatch.setattr(bench.store, "add_target", entered_before)
    kept = bench.snapshot(by=ANN)
    assert kept.target.name == "theirs"
    assert presses(bench) == [kept.press.id]


def test_a_gauge_tells_the_force(bench: Instrument) -> None:
    bench.hold(force_n=0.2, by=ANN)
    bench.start(by=ANN)
    bench.use_gauge(gauge(0.8), by=ANN)
    kept = bench.snapshot(by=ANN)
    assert kept.press.force_n == pytest.approx(0.8, abs=0.01)
    assert json.loads(kept.files.sidecar.read_text())["force"]["source"] == "gauge"
    bench.use_gauge(None, by=ANN)
    assert bench.snapshot(by=ANN).press.force_n == 0.2
    bench.forget_force(by=ANN)
    kept = bench.snapshot(by=ANN)
    assert kept.press.force_n is None
    assert json.loads(kept.files.sidecar.read_text())["force"] is None


def test_a_gauge_that_pulls_presses_nothing(bench: Instrument) -> None:
    bench.start(by=ANN)
    bench.use_gauge(gauge(0.0, zero_n=-0.4), by=ANN)
    assert bench.snapshot(by=ANN).press.force_n == 0.0


def test_a_gauge_that_has_ended_keeps_no_press_and_says_so(bench: Instrument) -> None:
    bench.start(by=ANN)
    log = gauge()
    bench.use_gauge(log, by=ANN)
    log.stop()
    until(lambda: not log.state().running)
    (sentence,) = (each for each in bench.state().trouble if "gauge" in each)
    assert sentence == "The gauge is away: its readings were ended."
    last_s = log.readings()[-1].time_s
    until(lambda: time.monotonic() - last_s > 2 * LONGEST_GAP_S)
    with pytest.raises(GaugeError):
        bench.snapshot(by=ANN)
    assert files(bench) == set()
    bench.use_gauge(None, by=ANN)
    assert bench.snapshot(by=ANN).press.force_n is None


def test_a_gauge_is_stopped_when_another_takes_its_place_and_not_by_itself(bench: Instrument) -> None:
    first, second = gauge(), gauge()
    bench.use_gauge(first, by=ANN)
    bench.use_gauge(first, by=ANN)
    assert first.state().running
    bench.use_gauge(second, by=ANN)
    until(lambda: not first.state().running)
    bench.close()
    until(lambda: not second.state().running)


def test_nothing_is_kept_while_the_camera_is_away_and_the_next_one_is_of_after(bench: Instrument, world: World) -> None:
    bench.start(by=ANN)
    bench.snapshot(by=ANN)
    before = files(bench)
    world.plugged = False
    until(lambda: bench.state().camera.lost)
    assert bench.state().trouble[0].startswith("The camera is away: the camera's driver failed: RuntimeError: bulk")
    with pytest.raises(CameraError, match="is away; nothing was saved"):
        bench.snapshot(by=ANN)
    assert files(bench) == before
    world.level, world.plugged = 99, True
    until(lambda: not bench.state().camera.lost)
    kept = bench.snapshot(by=ANN)
    assert (bench.store.levels(kept.press.frame) == seen(99, 2.0)).all()
    assert bench.state().trouble == ()


def test_who_does_not_hold_the_camera_keeps_nothing(bench: Instrument) -> None:
    bench.start(by=ANN)
    with pytest.raises(ControlError, match="held by Ann"):
        bench.snapshot(by=BOB)
    with pytest.raises(InputError, match="no colour map is called"):
        bench.snapshot(by=ANN, map_name="rainbow")
    assert files(bench) == set()


def _failing(monkeypatch: pytest.MonkeyPatch, *, lasting: bool) -> FailingDisk:
    disk = FailingDisk(errno.ENOSPC, lasting=lasting)
    for step in ("create", "write", "sync", "rename", "name", "sync_folder", "make_folder"):
        monkeypatch.setattr(DISK, step, getattr(disk, step))
    return disk


def _attempted(bench: Instrument) -> tuple[FileInputError | RecordsError | None, str]:
    """What a snapshot says when it fails, or the press."""
    try:
        return None, bench.snapshot(by=ANN).press.id
    except (FileInputError, RecordsError) as error:
        return error, ""


@pytest.mark.parametrize("lasting", [False, True])
def test_a_disk_that_is_full_at_any_step_leaves_nothing_half_kept(
    bench: Instrument, world: World, monkeypatch: pytest.MonkeyPatch, lasting: bool
) -> None:
    bench.start(by=ANN)
    bench.snapshot(by=ANN)
    disk = _failing(monkeypatch, lasting=lasting)
    refused = {FileInputError: 0, RecordsError: 0}
    for step in range(100):
        before, held = files(bench), presses(bench)
        world.level = 40 + step  # a frame that is new to the store
        bench.hold(force_n=0.01 * step, by=ANN)
        disk.arm(step)
        said, kept = _attempted(bench)
        failed = disk.failed
        disk.arm(None)
        if isinstance(said, FileInputError):
            assert "No space left" in str(said)
            assert (files(bench), presses(bench)) == (before, held)
        elif said is not None:
            assert str(said).startswith("the files are in")
            assert len(files(bench) - before) == 3  # whole, for nobody can press the same again
            assert presses(bench) == held
        else:
            assert presses(bench) == [*held, kept]
            if not failed:
                break
        if said is not None:
            refused[type(said)] += 1
        if step % 5 == 0:
            assert bench.snapshot(by=ANN).press.id == presses(bench)[-1]  # the next one is fine
    else:
        pytest.fail("it never passed")
    assert min(refused.values()) > 2
    assert verify_store(bench.store).sound


def test_the_first_press_of_a_target_on_a_full_disk(bench: Instrument, monkeypatch: pytest.MonkeyPatch) -> None:
    bench.start(by=ANN)
    disk = _failing(monkeypatch, lasting=True)
    disk.arm(12)  # in the store, after the three files
    with pytest.raises((RecordsError, FileInputError)):
        bench.snapshot(by=ANN)
    disk.arm(None)
    kept = bench.snapshot(by=ANN)
    assert (kept.target.number, presses(bench)) == (1, [kept.press.id])


def test_a_workspace_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with lit_bench(tmp_path, workspace=tmp_path / "file" / "workspace") as bench:
        bench.start(by=ANN)
        with pytest.raises(FileInputError, match="the snapshot must be written into"):
            bench.snapshot(by=ANN)
        with pytest.raises(FileInputError, match="must be a folder that can be made"):
            bench.begin_sequence(frames=3, by=ANN)
        assert bench.store.targets() == ()


def _locked(store: Path) -> Callable[[], None]:
    """Hold the database as another program that writes; the answer lets go."""
    other = sqlite3.connect(store / DATABASE_FILE, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    return other.close


def test_a_store_that_another_program_writes_to_for_too_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engines, "BUSY_S", 0.05)
    with lit_bench(tmp_path) as bench:
        bench.start(by=ANN)
        first = bench.snapshot(by=ANN)
        let_go = _locked(tmp_path / "store")
        with pytest.raises(RecordsError, match=r"the files are in .*Target1, but the press could not be kept"):
            bench.snapshot(by=ANN)
        let_go()
        second = bench.snapshot(by=ANN)
        assert presses(bench) == [first.press.id, second.press.id]


def test_a_store_that_is_gone(tmp_path: Path) -> None:
    with lit_bench(tmp_path) as bench:
        bench.start(by=ANN)
        bench.snapshot(by=ANN)
        shutil.rmtree(tmp_path / "store")
        with pytest.raises(RecordsError, match="the files are in"):
            bench.snapshot(by=ANN)
        assert len(files(bench)) == 6
        assert bench.state().camera.running


def test_a_press_that_the_store_did_not_take_can_be_entered_from_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engines, "BUSY_S", 0.05)
    with lit_bench(tmp_path) as bench:
        bench.start(by=ANN)
        bench.hold(role="plain", force_n=0.6, by=ANN)
        let_go = _locked(tmp_path / "store")
        with pytest.raises(RecordsError):
            bench.snapshot(by=ANN)
        let_go()
    with open_store(tmp_path / "store") as store:
        import_batches(store, find_import_batches([tmp_path / "workspace" / "Target1"], ImportOptions()))
        (press,) = store.presses(store.target(1))
        assert (press.role, press.force_n, press.settings["gain"]) == ("plain", 0.6, 2.0)
        assert press.probe == "tsis-domed"


def test_two_who_press_the_key_at_once_keep_two_presses(bench: Instrument) -> None:
    bench.start(by=ANN)
    gate, kept, said = threading.Barrier(4), list[str](), list[str]()

    def press() -> None:
        gate.wait(HANGS_S)
        try:
            kept.append(bench.snapshot(by=ANN).press.id)
        except ControlError as error:
            said.append(str(error))

    threads = [threading.Thread(target=press) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(HANGS_S)
    assert sorted(presses(bench)) == sorted(kept)
    assert len(files(bench)) == 3 * len(kept)
    assert len(kept) + len(said) == 4
    assert bench.camera_controller.name == LIT
