"""Calibration sessions of the virtual rig and of a camera that a person loads; what goes wrong costs nothing."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.console.services.instruments import ANN, BOB, FixedGauge, lit_instrument, virtual_instrument
from tests.console.services.instruments import gauge as gauge_at
from tests.waiting import HANGS_S, until

from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.calibration.frames import UsableCalibration, load_calibration
from tsis.calibration.session import CalibrationFrame, SessionFolder, SessionSetup
from tsis.catalog.probes import load_probe
from tsis.console.services import calibrating as session_module
from tsis.console.services.calibrating import IDLE, MOST_TYPED, TypedLoadings, folder_name
from tsis.console.widgets import drawings
from tsis.errors import CalibrationError, CameraError, ControlError, FileInputError, InputError
from tsis.model.calibration import Calibration
from tsis.model.image import TactileImage
from tsis.present.calibration import calibration_page
from tsis.virtual.calibration_bench import VirtualBench, bench_name
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

    from tests.console.services.lit_camera import World

    from tsis.console.services.calibrating import CalibrationSession, StepState
    from tsis.console.services.instrument import Instrument


TERMS = SessionSetup(name="May, left", probe="tsis-domed", camera=bench_name(3), tips_mm=(6.0, 14.0))


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def statuses(session: CalibrationSession) -> dict[str, str]:
    return {state.step.name: state.status for state in session.steps()}


@pytest.mark.slow
def test_the_frames_are_those_of_the_virtual_probe_of_that_seed(instrument: Instrument, tmp_path: Path) -> None:
    session = instrument.calibrating.begin(TERMS, by=ANN)
    assert session.folder.path == instrument.terms.workspace / "calibrations" / "May-left"
    assert session.take("flat-1", by=ANN).wait(HANGS_S)
    rig = VirtualProbe(load_probe("tsis-domed"), rng=np.random.default_rng(3), strain="small")
    virtual = VirtualBench.of(rig, rng=np.random.default_rng(np.random.PCG64([3, 1])))
    guided = SessionFolder(tmp_path / "guided")
    guided.begin(replace(TERMS, settings=virtual.settings, pad_sd=0.02))
    (step,) = [step for step in guided.plan() if step.name == "flat-1"]
    guided.save(step, virtual.shots(step))
    assert files(session.folder.path) == files(guided.path)
    assert [name for name, status in statuses(session).items() if status == "done"] == ["flat-1"]


def test_a_session_goes_on_in_another_program_and_its_noise_does_not_come_again(
    instrument: Instrument, tmp_path: Path
) -> None:
    session = instrument.calibrating.begin(TERMS, by=ANN)
    assert session.take("dark", by=ANN).wait(HANGS_S)
    instrument.close()
    with lit_instrument(tmp_path) as later:
        (listed,) = later.calibrating.listed()
        assert (listed.name, listed.title, listed.done, listed.total, listed.made) == (
            "May-left",
            "May, left",
            1,
            10,
            False,
        )
        again = later.calibrating.open("May-left")
        assert again is later.calibrating.open("May-left")
        assert statuses(again)["dark"] == "done"
        with pytest.raises(CalibrationError, match="step 'dark' is done"):
            again.take("dark", by=ANN)
        dark = again.folder.shots(again.steps()[0].step)
        again.repeat("dark", by=ANN)
        assert statuses(again)["dark"] == "open"
        assert again.take("dark", by=ANN).wait(HANGS_S)
        anew = again.folder.shots(again.steps()[0].step)
        assert not any(np.array_equal(one.image.grey, other.image.grey) for one in dark for other in anew)


def test_steps_are_left_out_and_taken_nevertheless(instrument: Instrument) -> None:
    session = instrument.calibrating.begin(TERMS, by=ANN)
    session.leave_out("flat-2", by=ANN)
    assert statuses(session)["flat-2"] == "left out"
    with pytest.raises(CalibrationError, match="step 'dark' cannot be skipped"):
        session.leave_out("dark", by=ANN)
    assert session.take("flat-2", by=ANN).wait(HANGS_S)
    assert statuses(session)["flat-2"] == "done"
    with pytest.raises(CalibrationError, match="no force is typed"):
        session.press("tip-14mm-1", 1.0, by=ANN)
    with pytest.raises(InputError, match="no step is called 'flat-9'"):
        session.take("flat-9", by=ANN)


def test_who_does_not_hold_the_camera_changes_nothing(instrument: Instrument) -> None:
    with pytest.raises(ControlError, match="controlled by Ann"):
        instrument.calibrating.begin(TERMS, by=BOB)
    session = instrument.calibrating.begin(TERMS, by=ANN)
    for command in (session.take, session.leave_out, session.repeat, session.save_presses):
        with pytest.raises(ControlError, match="controlled by Ann"):
            command("flat-1", by=BOB)
    assert set(statuses(session).values()) == {"open"}
    with pytest.raises(InputError, match="a session in 'May-left' exists already"):
        instrument.calibrating.begin(TERMS, by=ANN)


@pytest.mark.slow
def test_a_calibration_stays_when_its_frames_change(instrument: Instrument) -> None:
    session = instrument.calibrating.begin(TERMS, by=ANN)
    failed = session.make(days=30)
    assert failed.wait(HANGS_S)
    assert "steps must be done first: dark" in failed.state().sentence
    assert session.take_all(by=ANN).wait(HANGS_S)
    assert session.folder.missing() == ()
    assert set(statuses(session).values()) == {"done"}
    with pytest.raises(CalibrationError, match="every step is done"):
        session.take_all(by=ANN)
    job = session.make(days=30)
    with pytest.raises(ControlError, match="'May-left' is being made"):
        session.repeat("flat-1", by=ANN)
    assert job.wait(HANGS_S)
    created = job.result
    assert session.file == created.file
    assert instrument.calibrating.listed()[0].made
    before = created.file.read_bytes()
    session.repeat("flat-1", by=ANN)
    assert session.file is None
    assert session.result is None
    aside = created.file.with_name(f"calibration-{created.identity[:12]}.json")
    assert aside.read_bytes() == before
    assert statuses(session)["flat-1"] == "open"


def test_only_sessions_of_the_list_are_opened(instrument: Instrument) -> None:
    instrument.calibrating.begin(TERMS, by=ANN)
    for name in ("..", "../calibrations/May-left", "nowhere", "", "/etc"):
        with pytest.raises(InputError, match="must be one of the list"):
            instrument.calibrating.open(name)
    damaged = instrument.terms.workspace / "calibrations" / "damaged"
    damaged.mkdir()
    (damaged / "session.json").write_text("{")
    troubles = {item.name: item.trouble for item in instrument.calibrating.listed()}
    assert troubles["May-left"] == ""
    assert "session.json" in troubles["damaged"]


@pytest.mark.parametrize("title", ["../../etc/passwd", "a/b\\c", "  .hidden", "日本", "n" * 200, "con:aux"])
def test_a_folder_is_a_plain_name_whatever_the_title(title: str) -> None:
    name = folder_name(title)
    assert 0 < len(name) <= 60
    assert not name.startswith(".")
    assert set(name) <= set("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-")


EXPOSED = {"exposure_ms": 20.0, "gain": 0.0, "brightness": 8.0}


def of_bench(seed: int, settings: dict[str, float]) -> UsableCalibration:
    made = ProbeCalibration(
        name="bench",
        probe="tsis-domed",
        camera=bench_name(seed),
        settings=settings,
        response=Calibration(gain_grey_per_kpa=24.0, saturation_kpa=20.0, probe="tsis-domed"),
    )
    return UsableCalibration(calibration=made, identity=calibration_sha256(made))


def test_a_calibration_of_the_virtual_probe_is_active_on_that_probe_alone(tmp_path: Path) -> None:
    with virtual_instrument(tmp_path, probe="tsis-domed") as instrument:
        seed = instrument.camera_controller.choice.seed
        used = of_bench(seed, EXPOSED)
        instrument.use_calibration(used, by=ANN)
        assert instrument.state().calibration_identity == used.identity
        with pytest.raises(CalibrationError, match=f"of the virtual probe of seed {seed + 1} on tissue; the camera is"):
            instrument.use_calibration(of_bench(seed + 1, EXPOSED), by=ANN)
        assert instrument.state().calibration_identity == used.identity
        instrument.choose(replace(instrument.camera_controller.choice, phantom="cl2000x"), by=ANN)
        assert "on a bare sphere" in instrument.state().trouble[0]
        assert instrument.state().calibration == ""


def test_a_calibration_of_an_older_session_of_the_virtual_bench_is_an_exercise(tmp_path: Path) -> None:
    """Its light is that of another exposure: on the virtual probe it would be wrong by a factor of ten."""
    with virtual_instrument(tmp_path, probe="tsis-domed") as instrument:
        with pytest.raises(CalibrationError, match="'bench' is of the virtual bench, seed 4, an exercise"):
            instrument.use_calibration(of_bench(4, {}), by=ANN)
        assert instrument.state().calibration == ""


@pytest.mark.slow
def test_a_session_ends_in_an_active_calibration_under_which_estimates_are_right(tmp_path: Path) -> None:
    """Seed 14 was not used while the bench was made."""
    size_mm, depth_mm = 8.0, 5.0
    with virtual_instrument(tmp_path, probe="tsis-domed", phantom="size-8", seed=14) as instrument:
        terms = replace(
            TERMS, probe="tsis-domed", camera=bench_name(14), tips_mm=(6.0, 10.0, 14.0), pads_kpa=(5.0, 10.0)
        )
        session = instrument.calibrating.begin(terms, by=ANN)
        assert session.take_all(by=ANN).wait(HANGS_S)
        job = session.make(days=30)
        assert job.wait(HANGS_S)
        assert job.state().status == "done", job.state().sentence
        used = load_calibration(job.result.file)
        assert len(drawings(calibration_page(job.result.measured, job.result.findings, provenance={}))) == 3
        instrument.use_calibration(used, by=ANN)
        assert instrument.state().calibration_identity == used.identity
        instrument.start(by=ANN)
        assert instrument.state().calibration_identity == used.identity  # also with the settings of the running camera
        for role in ("plain", "target"):
            for force_n in (0.7, 1.0, 1.3):
                instrument.hold(role=role, force_n=force_n, by=ANN)
                assert instrument.snapshot(by=ANN).press.calibration == used.identity
        estimate = instrument.estimate(1)
        assert estimate.wait(HANGS_S)
        found = estimate.result.estimate
        assert found.trusted, found.flags
        for name, true in (("diameter_mm", size_mm), ("depth_mm", depth_mm)):
            low, high = found.interval(0.95)[name]
            assert low < true < high


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


def shot(force_n: float) -> CalibrationFrame:
    return CalibrationFrame(image=TactileImage(grey=np.full((4, 8), 7.0)), force_n=force_n)


def test_a_loading_has_so_many_presses_and_no_more() -> None:
    typed = TypedLoadings()
    for number in range(1, MOST_TYPED + 1):
        assert typed.add("one", shot(0.01 * number)) == number
    with pytest.raises(InputError, match=rf"presses of a loading must lie in \[1, {MOST_TYPED}\]"):
        typed.add("one", shot(0.5))
    assert typed.add("another", shot(0.5)) == 1
    assert typed.forces_n("one") == pytest.approx([0.01 * number for number in range(1, MOST_TYPED + 1)])


def test_the_frames_of_all_loadings_take_so_much_memory_and_no_more() -> None:
    one = shot(0.5)
    typed = TypedLoadings(most_bytes=3 * one.image.grey.nbytes)
    for step in ("one", "two", "three"):
        typed.add(step, one)
    with pytest.raises(CalibrationError, match=r"may take at most .* MiB; this one would take more \(keep"):
        typed.add("one", one)
    assert typed.forces_n("one") == (0.5,)
    typed.forget("two")
    assert typed.add("one", one) == 2


def test_nothing_is_left_of_what_was_forgotten() -> None:
    typed = TypedLoadings()
    typed.add("one", shot(0.5))
    owned = typed.is_empty
    typed.forget_last("one")
    typed.forget_last("one")
    typed.forget("two")
    assert (owned, typed.is_empty) == (False, True)
    assert typed.shots("one") == ()
