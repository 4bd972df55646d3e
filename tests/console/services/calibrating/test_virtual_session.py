"""A session of the virtual rig, from its terms to the file."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.console.services.instruments import ANN, BOB, lit_instrument, virtual_instrument
from tests.waiting import HANGS_S

from tsis.calibration.file import ProbeCalibration, calibration_sha256
from tsis.calibration.frames import UsableCalibration, read_usable_calibration
from tsis.calibration.session import SessionFolder, SessionSetup
from tsis.catalog.probes import load_probe
from tsis.console.services.calibrating import folder_name
from tsis.console.widgets import drawings
from tsis.errors import CalibrationError, ControlError, InputError
from tsis.model.calibration import Calibration
from tsis.present.calibration import calibration_page
from tsis.virtual.calibration_bench import VirtualBench, bench_name
from tsis.virtual.probe import VirtualProbe

if TYPE_CHECKING:
    from pathlib import Path

    from tsis.console.services.calibrating import CalibrationSession
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
        used = read_usable_calibration(job.result.file)
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
