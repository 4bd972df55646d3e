"""The whole instrument: start, state during commands, and closing at any moment."""

from __future__ import annotations

import threading
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import pytest
from tests.console.services.instruments import ANN, BOB, LIT, FixedGauge, gauge, lit_instrument
from tests.console.services.lit_camera import World
from tests.waiting import HANGS_S, until

from tsis.console.services.choice import CameraChoice, InstrumentSettings
from tsis.console.services.instrument import Instrument
from tsis.console.services.state import InstrumentState
from tsis.errors import CameraError, ControlError, FileInputError, GaugeError, InputError, RecordsError, TsisError
from tsis.records.store import open_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path


@pytest.fixture(autouse=True)
def _no_thread_stays() -> Iterator[None]:
    before = threading.active_count()
    yield
    until(lambda: threading.active_count() <= before)


def in_thread(command: Callable[[], object], reported: list[str]) -> threading.Thread:
    def attempt() -> None:
        try:
            command()
        except TsisError as error:
            reported.append(str(error))

    thread = threading.Thread(target=attempt)
    thread.start()
    return thread


def test_no_step_of_many_at_once_is_lost(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as instrument:
        reported: list[str] = []
        together = threading.Barrier(8)

        def step() -> None:
            together.wait(HANGS_S)
            instrument.step_target(1, by=ANN)

        for thread in [in_thread(step, reported) for _ in range(8)]:
            thread.join(HANGS_S)
        assert reported == []
        assert instrument.state().target == 9
        instrument.step_target(-8, by=ANN)
        with pytest.raises(InputError, match=r"target must lie in \[1, 99999\]; got 0"):
            instrument.step_target(-1, by=ANN)
        assert instrument.state().target == 1


def test_before_anything_was_done(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as instrument:
        state = instrument.state()
        assert (state.target, state.role, state.force_n, state.calibration, state.frame_analysis) == (
            1,
            "target",
            None,
            "",
            None,
        )
        assert (state.camera.running, state.camera.name, state.camera.rows, state.camera.settings) == (False, "", 0, ())
        assert (state.sequence, state.jobs, state.trouble, state.busy) == (None, (), (), "")
        assert state.owner is not None
        assert state.owner.name == "Ann"


def test_one_that_cannot_be_begun_leaves_no_thread_and_no_lock(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    (tmp_path / "calibration.json").write_text("{}")
    with open_store(tmp_path / "subjects", kind="subject"):
        pass
    before = threading.active_count()
    wrong: tuple[dict[str, Any], ...] = (
        {"store": tmp_path / "file"},
        {"store": tmp_path / "subjects"},
        {"calibration": tmp_path / "calibration.json"},
    )
    for terms in wrong:
        with pytest.raises((RecordsError, FileInputError)):
            lit_instrument(tmp_path, **terms)
    assert threading.active_count() == before
    with lit_instrument(tmp_path) as instrument:
        assert instrument.store.targets() == ()


def test_state_never_waits_for_a_camera_that_is_being_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    world, reported = World(), list[str]()
    world.opening = threading.Event()
    with lit_instrument(tmp_path, world) as instrument:
        starting = in_thread(lambda: instrument.start(by=ANN), reported)
        assert world.waits.wait(HANGS_S)
        state = instrument.state()
        assert (state.busy, state.camera.running) == ("starting the camera", False)
        monkeypatch.setattr(instrument._commands, "_timeout_s", 0.01)
        with pytest.raises(ControlError, match="the instrument is busy starting the camera; try again"):
            instrument.start(by=ANN)
        instrument.control.take("tab bob", "Bob", over=True)
        world.opening.set()
        starting.join(HANGS_S)
        assert reported == []
        assert instrument.state().camera.running
        assert instrument.state().busy == ""
        instrument.stop(by="tab bob")


def test_a_camera_that_refuses_leaves_a_bench_that_can_start_it_again(tmp_path: Path) -> None:
    world = World()
    world.refuses = "lit is held by another program; close it"
    with lit_instrument(tmp_path, world) as instrument:
        with pytest.raises(CameraError, match="held by another program"):
            instrument.start(by=ANN)
        state = instrument.state()
        assert (state.camera.running, state.trouble, state.busy) == (False, (), "")
        with pytest.raises(CameraError, match="it is stopped"):
            instrument.snapshot(by=ANN)
        world.refuses = ""
        instrument.start(by=ANN)
        instrument.start(by=ANN)  # again it does nothing
        assert len(world.cameras) == 2
        instrument.snapshot(by=ANN)


def test_another_choice_lets_go_of_the_camera_and_of_what_was_said_of_it(instrument: Instrument, world: World) -> None:
    instrument.start(by=ANN)
    instrument.hold(role="ball", force_n=3.0, by=ANN)
    instrument.adjust("gain", 9.0, by=ANN)
    instrument.choose(CameraChoice(spec=LIT, probe="tsis-2011"), by=ANN)
    state = instrument.state()
    assert (state.camera.running, state.role, state.force_n) == (False, "target", None)
    assert state.camera.choice.probe == "tsis-2011"
    instrument.start(by=ANN)
    assert instrument.snapshot(by=ANN).press.probe == "tsis-2011"
    assert world.cameras[1].gain == 2.0


def test_the_press_of_a_virtual_probe_may_be_said_before_it_runs_and_is_what_it_holds(tmp_path: Path) -> None:
    with Instrument(InstrumentSettings(workspace=tmp_path / "w", store=tmp_path / "s")) as instrument:
        instrument.control.take(ANN, "Ann", held_s=600.0)
        assert (instrument.state().roles, instrument.state().force_n) == (("target", "plain", "untouched"), 1.0)
        instrument.hold(role="untouched", force_n=0.5, by=ANN)
        instrument.forget_force(by=ANN)
        with pytest.raises(InputError, match="must be a number for the virtual probe, whose force is always known"):
            instrument.hold(forget=True, by=ANN)
        assert (instrument.state().role, instrument.state().force_n, instrument.state().lifted) == (
            "untouched",
            0.5,
            True,
        )
        for wrong in (5.5, float("nan")):
            with pytest.raises(InputError, match="force_n must lie in"):
                instrument.hold(force_n=wrong, by=ANN)
        with pytest.raises(InputError, match="no role is called 'ball'"):
            instrument.hold(role="ball", by=ANN)


def test_many_watch_while_somebody_acts(instrument: Instrument) -> None:
    """State is whole whenever it is asked for: no act in between makes it fail."""
    over, wrong, checks = threading.Event(), list[Exception](), [0]

    def watch() -> None:
        while not over.is_set():
            try:
                state = instrument.state()
                assert isinstance(state, InstrumentState)
                assert state.camera.running == (state.camera.name != "")
                checks[0] += 1
            except Exception as error:
                wrong.append(error)
                return

    watching = [threading.Thread(target=watch) for _ in range(2)]
    for thread in watching:
        thread.start()
    for step in range(10):
        instrument.start(by=ANN)
        instrument.hold(force_n=0.1 * step, by=ANN)
        with suppress(CameraError):
            instrument.adjust("gain", float(step), by=ANN)
        instrument.choose(CameraChoice(spec=LIT), by=ANN) if step % 2 else instrument.stop(by=ANN)
        before = checks[0]
        until(lambda before=before: checks[0] > before or bool(wrong))  # type: ignore[misc]
    over.set()
    for thread in watching:
        thread.join(HANGS_S)
    assert wrong == []


def test_a_snapshot_while_another_camera_is_chosen_is_kept_whole_or_not_at_all(tmp_path: Path) -> None:
    world = World()
    with lit_instrument(tmp_path, world) as instrument:
        for _ in range(5):
            reported: list[str] = []
            instrument.start(by=ANN)
            threads = [
                in_thread(lambda: instrument.snapshot(by=ANN), reported),
                in_thread(lambda: instrument.choose(CameraChoice(spec=LIT), by=ANN), reported),
            ]
            for thread in threads:
                thread.join(HANGS_S)
            assert all("it is stopped" in message for message in reported)
        targets = instrument.store.targets()
        remaining = sum(instrument.store.press_count(instrument.store.target(item.target.number)) for item in targets)
        assert remaining == len(list((tmp_path / "workspace").rglob("*.json")))


def test_closing_ends_everything_at_once(tmp_path: Path) -> None:
    world = World()
    instrument = lit_instrument(tmp_path, world)
    instrument.start(by=ANN)
    instrument.use_gauge(gauge(), by=ANN)
    instrument.begin_sequence(frames=100_000, by=ANN)
    owned = FixedGauge()
    job = instrument.jobs.begin("an estimate", owned)
    waiting = [instrument.jobs.begin("another", FixedGauge()) for _ in range(3)]
    assert owned.begun.wait(HANGS_S)
    world.plugged = False
    until(lambda: instrument.state().camera.lost)
    instrument.close()
    instrument.close()  # again it does nothing
    assert {item.state().status for item in (job, *waiting)} == {"ended"}
    assert instrument.state().sequence is not None
    assert instrument.state().sequence.status == "done"  # type: ignore[union-attr]
    for command in (instrument.start, instrument.snapshot):
        with pytest.raises(ControlError, match="the console is shutting down"):
            command(by=ANN)


def test_closing_while_a_camera_is_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tsis.instrument.acquisition.STOP_S", 0.01)
    world, reported = World(), list[str]()
    world.opening = threading.Event()
    instrument = lit_instrument(tmp_path, world)
    starting = in_thread(lambda: instrument.start(by=ANN), reported)
    assert world.waits.wait(HANGS_S)
    instrument.close()
    world.opening.set()
    starting.join(HANGS_S)
    assert reported == ["the console is shutting down; the camera was not started (start the console again)"]


def test_a_gauge_that_does_not_let_go_keeps_nothing_else_open(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    instrument, log = lit_instrument(tmp_path), gauge()
    instrument.start(by=ANN)
    instrument.use_gauge(log, by=ANN)
    stop, closed = log.stop, list[bool]()

    def stuck() -> None:
        stop()
        raise GaugeError("simulated gauge did not end its readings within 5 s; unplug it")

    close = instrument.store.close

    def close_and_tell() -> None:
        close()
        closed.append(True)

    monkeypatch.setattr(log, "stop", stuck)
    monkeypatch.setattr(instrument.store, "close", close_and_tell)
    with pytest.raises(GaugeError, match="unplug it"):
        instrument.close()
    assert closed == [True]


def test_what_follows_the_camera_is_ended_by_who_holds_it_and_other_work_by_anybody(instrument: Instrument) -> None:
    estimate, search = (
        instrument.jobs.begin("an estimate", FixedGauge()),
        instrument.jobs.begin("frames", FixedGauge(), at_once=True),
    )
    assert instrument.end_job(estimate.identity, by=BOB) is estimate
    with pytest.raises(ControlError, match="controlled by Ann"):
        instrument.end_job(search.identity, by=BOB)
    assert estimate.wait(HANGS_S)
    assert (estimate.state().status, search.state().status) == ("ended", "running")
    instrument.end_job(search.identity, by=ANN)
    assert search.wait(HANGS_S)
    with pytest.raises(InputError, match="job must be one of this console's"):
        instrument.end_job("0" * 32, by=ANN)


def test_role_and_force_are_changed_together_or_not_at_all(instrument: Instrument) -> None:
    instrument.hold(role="plain", force_n=0.5, by=ANN)
    with pytest.raises(InputError, match="no role is called 'bell'"):
        instrument.hold(role="bell", forget=True, by=ANN)
    with pytest.raises(InputError, match="given or forgotten, not both"):
        instrument.hold(force_n=0.7, forget=True, by=ANN)
    assert (instrument.state().role, instrument.state().force_n) == ("plain", 0.5)
    instrument.hold(role="ball", forget=True, by=ANN)
    assert (instrument.state().role, instrument.state().force_n) == ("ball", None)


def test_what_was_chosen_comes_back_after_a_kill_and_is_said(tmp_path: Path) -> None:
    killed = lit_instrument(tmp_path)
    try:
        killed.choose(CameraChoice(phantom="size-8", probe="tsis-2011"), by=ANN)
        killed.set_target(12, by=ANN)
        waits = FixedGauge()
        killed.jobs.begin("sequence of target 12", waits, at_once=True)
        assert waits.begun.wait(HANGS_S)
        with lit_instrument(tmp_path) as again:
            state = again.state()
            assert (state.camera.choice.phantom, state.target) == ("size-8", 12)
            assert state.trouble[-1] == (
                "The console was not shut down properly. Interrupted (saved data are safe): sequence of target 12. "
                "Restored: camera virtual on size-8, target 12; start the camera to continue."
            )
            again.start(by=ANN)
            assert not any("in order" in message for message in again.state().trouble)
    finally:
        killed.close()
    with lit_instrument(tmp_path) as later:  # the one before was shut down properly
        assert (later.state().target, later.state().trouble) == (1, ())
