"""A session before a camera, with a person who loads it: what goes wrong in mid-step costs that step alone."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest
from tests.console.services.instruments import ANN, BOB, FixedGauge
from tests.console.services.instruments import gauge as gauge_at
from tests.waiting import HANGS_S, until

from tsis.calibration.session import SessionSetup
from tsis.console.services import calibrating as session_module
from tsis.console.services.calibrating import IDLE
from tsis.errors import CalibrationError, CameraError, ControlError, FileInputError, InputError

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.services.lit_camera import World

    from tsis.calibration.session import SessionFolder
    from tsis.console.services.calibrating import CalibrationSession, StepState
    from tsis.console.services.instrument import Instrument

LOADING = "tip-2mm-1"


@pytest.fixture
def session(instrument: Instrument) -> CalibrationSession:
    instrument.start(by=ANN)
    terms = SessionSetup(name="s", probe="mine", camera="it tells itself", tips_mm=(2.0,), repeats=2)
    return instrument.calibrating.begin(terms, by=ANN)


def remaining(session: CalibrationSession) -> dict[str, int]:
    return {state.step.name: state.frames for state in session.steps() if state.status == "done"}


def forces(session: CalibrationSession) -> tuple[float, ...]:
    return step(session).forces_n


def step(session: CalibrationSession) -> StepState:
    return next(state for state in session.steps() if state.step.name == LOADING)


def drafts(folder: Path) -> list[Path]:
    return list(folder.glob(".*-*/frame-*.png"))


def test_it_remembers_camera_and_settings(session: CalibrationSession) -> None:
    assert session.terms.camera == "aravis:lit"
    assert session.terms.settings == {"gain": 2.0}
    assert session.terms.began is not None
    assert not session.rig.by_itself


def test_frames_are_fresh_and_of_this_step(session: CalibrationSession, world: World) -> None:
    assert session.take("dark", by=ANN).wait(HANGS_S)
    world.level = 90
    assert session.take("untouched", by=ANN).wait(HANGS_S)
    dark, untouched = (session.folder.shots(state.step) for state in session.steps()[:2])
    assert remaining(session) == {"dark": 16, "untouched": 16}
    assert {shot.image.grey.max() for shot in dark} == {60.0}
    assert untouched[-1].image.grey.max() == 100.0
    times = [shot.time_s or 0.0 for shot in dark]
    assert times == sorted(set(times))


@pytest.mark.slow
def test_a_camera_lost_in_mid_step_costs_that_step(
    session: CalibrationSession, world: World, instrument: Instrument
) -> None:
    assert session.take("dark", by=ANN).wait(HANGS_S)
    instrument.use_gauge(gauge_at(0.5), by=ANN)
    job = session.take(LOADING, by=ANN)
    until(lambda: job.state().done >= 1)
    world.plugged = False
    assert job.wait(HANGS_S)
    assert job.state().status == "failed"
    assert job.state().sentence.startswith(f"step '{LOADING}' is not saved, those before it are: aravis:lit ")
    assert remaining(session) == {"dark": 16}
    assert drafts(session.folder.path) == []
    with pytest.raises(CameraError, match="aravis:lit is away"):
        session.take("untouched", by=ANN)
    world.plugged = True
    until(
        lambda: (
            instrument.camera_controller.acquisition is not None and not instrument.camera_controller.acquisition.lost
        )
    )
    until(lambda: bool(instrument.camera_controller.settings()))
    assert session.take("untouched", by=ANN).wait(HANGS_S)
    assert remaining(session) == {"dark": 16, "untouched": 16}


def test_a_camera_that_was_away_in_between_costs_the_step(
    session: CalibrationSession, world: World, instrument: Instrument
) -> None:
    instrument.use_gauge(gauge_at(0.5), by=ANN)
    job = session.take(LOADING, by=ANN)
    until(lambda: job.state().done >= 1)
    world.plugged = False
    until(
        lambda: instrument.camera_controller.acquisition is not None and instrument.camera_controller.acquisition.lost
    )
    world.plugged = True
    assert job.wait(HANGS_S)
    assert "was lost meanwhile" in job.state().sentence
    assert remaining(session) == {}


def test_settings_of_another_session_are_refused_before_and_after(
    session: CalibrationSession, instrument: Instrument
) -> None:
    instrument.use_gauge(gauge_at(0.5), by=ANN)
    job = session.take(LOADING, by=ANN)
    until(lambda: job.state().done >= 1)
    instrument.adjust("gain", 5.0, by=ANN)
    session.end_loading(by=ANN)
    assert job.wait(HANGS_S)
    assert "gain = 2; it is at 5 (set it back)" in job.state().sentence
    assert remaining(session) == {}
    with pytest.raises(CalibrationError, match="gain = 2; it is at 5"):
        session.take("dark", by=ANN)
    instrument.adjust("gain", 2.0, by=ANN)
    assert session.take("dark", by=ANN).wait(HANGS_S)
    instrument.stop(by=ANN)
    with pytest.raises(CameraError, match="it is stopped"):
        session.take("untouched", by=ANN)


def test_a_loading_by_the_gauge_goes_on_until_it_is_over(session: CalibrationSession, instrument: Instrument) -> None:
    instrument.use_gauge(gauge_at(0.5), by=ANN)
    job = session.take(LOADING, by=ANN)
    until(lambda: job.state().done >= 2)
    with pytest.raises(ControlError, match="is taking a step"):
        session.take("dark", by=ANN)
    session.end_loading(by=ANN)
    assert job.wait(HANGS_S)
    assert job.state().status == "done"
    shots = session.folder.shots(step(session).step)
    assert len(shots) >= 2
    assert all(abs((shot.force_n or 0.0) - 0.5) < 0.01 for shot in shots)


def test_a_step_that_is_ended_is_not_kept(session: CalibrationSession, instrument: Instrument) -> None:
    instrument.use_gauge(gauge_at(0.5), by=ANN)
    job = session.take(LOADING, by=ANN)
    until(lambda: job.state().done >= 1)
    job.end()
    assert job.wait(HANGS_S)
    assert job.state().status == "ended"
    assert remaining(session) == {}
    assert drafts(session.folder.path) == []
    assert not session.busy


def test_forces_are_typed_one_after_the_other(session: CalibrationSession, world: World) -> None:
    with pytest.raises(CalibrationError, match="it has none"):
        session.save_presses(LOADING, by=ANN)
    for number, force in enumerate((0.0, 0.5, 9.0), start=1):
        assert session.press(LOADING, force, by=ANN) == number
    for wrong in (float("nan"), float("inf"), -101.0):
        with pytest.raises(InputError, match="force must lie in"):
            session.press(LOADING, wrong, by=ANN)
    session.unpress(LOADING, by=ANN)
    assert forces(session) == (0.0, 0.5)
    world.level = 120
    session.press(LOADING, 1.0, by=ANN)
    assert remaining(session) == {}
    assert session.save_presses(LOADING, by=ANN) == 3
    shots = session.folder.shots(step(session).step)
    assert [shot.force_n for shot in shots] == [0.0, 0.5, 1.0]
    assert forces(session) == ()
    with pytest.raises(CalibrationError, match="is done"):
        session.press(LOADING, 1.0, by=ANN)
    with pytest.raises(CalibrationError, match="forces belong to loadings"):
        session.press("dark", 1.0, by=ANN)


def test_forces_of_several_loadings_are_typed_before_any_is_kept(session: CalibrationSession, world: World) -> None:
    first, second = LOADING, "tip-2mm-2"
    assert session.press(first, 0.5, by=ANN) == 1
    world.level = 120
    assert session.press(second, 1.5, by=ANN) == 1
    with pytest.raises(InputError, match="force must lie in"):
        session.press(second, float("nan"), by=ANN)
    assert session.press(first, 0.7, by=ANN) == 2
    session.unpress(second, by=ANN)
    assert session.press(second, 1.6, by=ANN) == 1
    assert {state.step.name: state.forces_n for state in session.steps() if state.forces_n} == {
        first: (0.5, 0.7),
        second: (1.6,),
    }
    assert (session.save_presses(second, by=ANN), session.save_presses(first, by=ANN)) == (1, 2)
    assert remaining(session) == {first: 2, second: 1}
    shots = {state.step.name: session.folder.shots(state.step) for state in session.steps() if state.status == "done"}
    assert [shot.force_n for shot in shots[first]] == [0.5, 0.7]
    assert shots[first][0].image.grey.max() == 60.0
    assert shots[second][0].image.grey.max() == 130.0


def test_a_press_of_which_no_frame_came_leaves_what_was_typed(
    session: CalibrationSession, world: World, instrument: Instrument
) -> None:
    session.press(LOADING, 0.5, by=ANN)
    instrument.stop(by=ANN)
    for name in (LOADING, "tip-2mm-2"):
        with pytest.raises(CameraError, match="it is stopped"):
            session.press(name, 0.6, by=ANN)
    assert [state.forces_n for state in session.steps() if state.step.is_loading] == [(0.5,), ()]


def test_a_step_of_a_camera_waits_for_nothing(session: CalibrationSession, instrument: Instrument) -> None:
    for _ in range(5):
        instrument.jobs.begin("an estimate that lasts", FixedGauge())
    assert session.take("dark", by=ANN).wait(HANGS_S)
    assert remaining(session) == {"dark": 16}


def test_who_watches_ends_no_step(session: CalibrationSession, instrument: Instrument) -> None:
    instrument.use_gauge(gauge_at(0.5), by=ANN)
    job = session.take(LOADING, by=ANN)
    for command in (session.end_loading, session.end_step, lambda by: instrument.end_job(job.identity, by=by)):
        with pytest.raises(ControlError, match="controlled by Ann"):
            command(by=BOB)
    until(lambda: job.state().done >= 1)
    session.end_step(by=ANN)
    assert job.wait(HANGS_S)
    assert (job.state().status, remaining(session)) == ("ended", {})


def test_a_calibration_that_cannot_be_set_aside_keeps_no_frames_that_it_was_not_made_from(
    session: CalibrationSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(folder: SessionFolder) -> None:
        raise FileInputError(f"{folder.path} must be a folder that can be written; got: Permission denied")

    monkeypatch.setattr(session_module, "archive_calibration", refused)
    job = session.take("dark", by=ANN)
    assert job.wait(HANGS_S)
    assert "step 'dark' is not saved, those before it are: " in job.state().sentence
    assert remaining(session) == {}
    session.press(LOADING, 0.5, by=ANN)
    with pytest.raises(FileInputError, match="Permission denied"):
        session.save_presses(LOADING, by=ANN)
    assert remaining(session) == {}
    monkeypatch.undo()
    assert session.save_presses(LOADING, by=ANN) == 1


def test_sessions_that_nobody_looks_at_are_let_go_and_those_with_presses_are_not(
    session: CalibrationSession, instrument: Instrument
) -> None:
    session.press(LOADING, 0.5, by=ANN)
    terms = SessionSetup(name="t", probe="mine", camera="it tells itself")
    idle = weakref.ref(instrument.calibrating.begin(terms, by=ANN))
    for number in range(IDLE):
        assert idle() is not None
        instrument.calibrating.begin(replace(terms, name=f"t{number}"), by=ANN)
    gc.collect()
    assert idle() is None
    assert instrument.calibrating.open("s") is session
    assert instrument.calibrating.open("t").name == "t"


def test_a_session_needs_its_camera_to_begin(instrument: Instrument) -> None:
    with pytest.raises(CameraError, match="must run when a session begins"):
        instrument.calibrating.begin(SessionSetup(name="s", probe="mine", camera="c"), by=ANN)
    assert instrument.calibrating.listed() == ()
