"""The camera controller: settings, losses, and a calibration in force only where it fits the camera."""

from __future__ import annotations

import threading
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import cycle
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import pytest
from tests.console.services.instruments import ANN, LIT, lit_instrument
from tests.console.services.lit_camera import COLUMNS, ROWS, World, observed
from tests.records.sample import sample_calibration
from tests.waiting import HANGS_S, until

from tsis.calibration.file import calibration_sha256, write_calibration
from tsis.calibration.frames import UsableCalibration
from tsis.calibration.measured import MeasuredValue
from tsis.calibration.scale import PixelScale
from tsis.console.services import camera
from tsis.console.services.camera import CameraController
from tsis.console.services.choice import CameraChoice
from tsis.errors import CalibrationError, CameraError, ControlError, FileInputError, InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.console.services.lit_camera import World

    from tsis.console.services.instrument import Instrument


@pytest.fixture
def controller(world: World) -> Iterator[CameraController]:
    controller = CameraController(CameraChoice(spec=LIT), connect_to=world.connect)
    yield controller
    controller.close()


def gain(controller: CameraController) -> float:
    return {item.name: item.value for item in controller.settings()}["gain"]


def test_settings_are_remembered_over_stop_and_start_and_forgotten_with_another_choice(
    controller: CameraController, world: World
) -> None:
    controller.start()
    controller.adjust("gain", 6.0)
    assert gain(controller) == 6.0
    controller.stop()
    assert controller.settings() == ()
    controller.start()
    assert gain(controller) == 6.0
    assert len(world.cameras) == 2
    controller.choose(CameraChoice(spec=LIT))
    controller.start()
    assert gain(controller) == 2.0


def test_settings_are_made_again_when_a_lost_camera_is_back(controller: CameraController, world: World) -> None:
    controller.start()
    controller.adjust("gain", 6.0)
    world.plugged = False
    until(lambda: controller.acquisition is not None and controller.acquisition.lost)
    assert controller.settings() == ()
    with pytest.raises(CameraError, match="not connected; wait"):
        controller.adjust("gain", 7.0)
    world.plugged = True
    until(lambda: controller.acquisition is not None and not controller.acquisition.lost)
    assert world.cameras[-1].adjusted == [6.0]
    assert gain(controller) == 6.0


def test_presets_go_back_to_how_the_camera_came_also_after_a_stop(controller: CameraController) -> None:
    controller.start()
    controller.adjust("gain", 6.0)
    controller.stop()
    controller.start()
    controller.preset("minimal")
    assert gain(controller) == 0.0
    controller.preset("default")
    assert gain(controller) == 2.0
    with pytest.raises(UnknownNameError, match="did you mean 'default'"):
        controller.preset("defaults")


def test_a_setting_that_is_refused_is_not_remembered(controller: CameraController) -> None:
    controller.start()
    for wrong in (25.0, float("nan")):
        with pytest.raises(InputError, match="gain must lie in"):
            controller.adjust("gain", wrong)
    with pytest.raises(UnknownNameError, match="no setting is called 'force_n'"):
        controller.adjust("force_n", 1.0)
    controller.stop()
    controller.start()
    assert gain(controller) == 2.0


def test_a_remembered_setting_that_the_camera_no_longer_takes_does_not_keep_it_from_starting(
    controller: CameraController, world: World
) -> None:
    controller.start()
    controller.adjust("gain", 20.0)
    controller.stop()
    world.most_gain = 12.0  # another camera answers by the same name
    with pytest.raises(InputError, match=r"gain must lie in \[0, 12\]; got 20"):
        controller.start()
    controller.start()
    assert gain(controller) == 2.0


def test_what_is_changed_elsewhere_is_seen_and_told(world: World) -> None:
    reported = threading.Event()
    controller = CameraController(CameraChoice(spec=LIT), changed=reported.set, connect_to=world.connect)
    controller.start()
    assert not reported.is_set()
    world.cameras[0].gain = 9.0
    assert reported.wait(HANGS_S)  # looked at every second
    assert gain(controller) == 9.0
    controller.close()


@pytest.mark.parametrize("queued", [0, 2])
def test_a_frame_is_never_of_before_the_last_change(controller: CameraController, world: World, queued: int) -> None:
    """A frame may be exposed, and others wait in the driver, while the change is made."""
    world.queued = queued
    controller.start()
    for step in range(12):
        world.level, expected = 40 + 10 * step, float(step)
        controller.adjust("gain", expected)
        arrival = controller.fresh()
        assert (arrival.frame.pixels == observed(world.level, expected)).all()
        world.level = 45 + 10 * step
        controller.hold("plain" if step % 2 else "target", 0.1 * step)
        assert (controller.fresh().frame.pixels == observed(world.level, expected)).all()


def test_without_a_change_it_is_the_newest_frame(controller: CameraController) -> None:
    controller.start()
    until(lambda: controller.acquisition is not None and controller.acquisition.ring.end > 3)
    assert controller.acquisition is not None
    before = controller.acquisition.latest()
    fresh = controller.fresh()
    assert before is not None
    assert fresh.frame.sequence >= before.frame.sequence


def test_no_frame_of_before_a_loss(controller: CameraController, world: World) -> None:
    controller.start()
    controller.fresh()
    world.plugged = False
    until(lambda: controller.acquisition is not None and controller.acquisition.lost)
    with pytest.raises(CameraError, match="aravis:lit is away; nothing was saved"):
        controller.fresh()
    world.level, world.plugged = 90, True
    until(lambda: controller.acquisition is not None and not controller.acquisition.lost)
    assert (controller.fresh().frame.pixels == observed(90, 2.0)).all()


def test_a_camera_that_cannot_be_opened_can_be_started_once_it_can(controller: CameraController, world: World) -> None:
    world.refuses = "lit is held by another program; close it"
    for _ in range(2):
        with pytest.raises(CameraError, match="held by another program"):
            controller.start()
        assert not controller.running
        assert controller.name == ""
    world.refuses = ""
    controller.start()
    assert (controller.fresh().frame.pixels.shape, controller.name) == ((ROWS, COLUMNS), LIT)


def test_a_mode_that_it_does_not_have_is_refused_and_another_can_be_chosen(controller: CameraController) -> None:
    controller.choose(CameraChoice(spec=LIT, mode="Mono16-64x48@100"))
    with pytest.raises(UnknownNameError, match="did you mean 'Mono8-64x48@100'"):
        controller.start()
    controller.choose(CameraChoice(spec=LIT, mode="Mono8-64x48@100"))
    controller.start()
    assert controller.fresh().frame.pixels.shape == (ROWS, COLUMNS)


def test_closing_does_not_wait_for_a_driver_that_hangs(
    controller: CameraController, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tsis.instrument.acquisition.STOP_S", 0.01)
    world.opening, message = threading.Event(), list[str]()

    def start() -> None:
        try:
            controller.start()
        except (CameraError, ControlError) as error:
            message.append(str(error))

    starting = threading.Thread(target=start)
    starting.start()
    assert world.waits.wait(HANGS_S)
    controller.close()
    assert not world.opening.is_set()
    world.opening.set()
    starting.join(HANGS_S)
    assert message == ["the console is shutting down; the camera was not started (start the console again)"]
    assert not controller.running
    with pytest.raises(ControlError, match="shutting down"):
        controller.start()


def test_a_stopped_camera_has_no_frame_and_no_setting(controller: CameraController) -> None:
    for command in (controller.fresh, lambda: controller.adjust("gain", 3.0)):
        with pytest.raises(CameraError, match=r"must run for this; it is stopped \(start it\)"):
            command()


@pytest.mark.parametrize("force_n", [-0.1, 1000.5, float("nan"), float("inf"), "1"])
def test_a_force_that_nobody_presses_with_is_refused(controller: CameraController, force_n: float) -> None:
    controller.hold("ball", 2.0)
    with pytest.raises(InputError, match="force_n must"):
        controller.hold("plain", force_n)
    assert (controller.role, controller.force_n) == ("ball", 2.0)
    with pytest.raises(UnknownNameError, match="no role is called 'tissue'"):
        controller.hold("tissue", 1.0)
    controller.hold(*controller.completed(None, None, forget=True))
    assert controller.force_n is None


class Subject:
    """In place of the virtual probe: counts what was solved, and takes until it is let go."""

    solved: ClassVar[list[CameraChoice]] = []
    let_go = threading.Event()

    def __init__(self, choice: CameraChoice, *, solver: object) -> None:
        assert solver is None
        self.choice = choice

    def hold(self, _role: str, _force_n: float) -> None:
        assert self.let_go.wait(HANGS_S)
        self.solved.append(self.choice)

    def connect(self, *, apart: bool) -> object:
        raise CameraError("this probe has no camera")


@pytest.fixture
def prepared(monkeypatch: pytest.MonkeyPatch) -> Iterator[CameraController]:
    """A controller of a virtual probe whose first press is being solved ahead."""
    monkeypatch.setattr(camera, "VirtualSubject", Subject)
    Subject.solved.clear()
    Subject.let_go.clear()
    controller = CameraController(CameraChoice(seed=1))
    controller.prepare()
    controller.prepare()
    yield controller
    controller.close()


def test_a_first_press_that_was_solved_ahead_is_not_solved_again(prepared: CameraController) -> None:
    Subject.let_go.set()
    with pytest.raises(CameraError, match="no camera"):
        prepared.start()
    assert Subject.solved == [prepared.choice]
    assert prepared.subject is not None


def test_another_first_press_than_the_one_solved_ahead_is_solved(prepared: CameraController) -> None:
    Subject.let_go.set()
    until(lambda: len(Subject.solved) == 1)
    prepared.choose(CameraChoice(seed=2))
    with pytest.raises(CameraError, match="no camera"):
        prepared.start()
    assert [choice.seed for choice in Subject.solved] == [1, 2]


NOW = datetime.now(UTC)


def scale(shape: tuple[int, int]) -> PixelScale:
    size = [MeasuredValue(value=value, sd=1e-3, unit="mm/px") for value in (0.3, 0.4)]
    return PixelScale(
        mm_per_pixel_x=size[0], mm_per_pixel_y=size[1], shape=shape, at_px=(20.0, 20.0), method="dots", count=63
    )


def calibration_with(**changes: Any) -> UsableCalibration:
    created = replace(sample_calibration(), camera=LIT, settings={"gain": 2.0}, **changes)
    return UsableCalibration(calibration=created, identity=calibration_sha256(created))


def test_presses_are_taken_under_it_with_its_scale_and_probe(instrument: Instrument) -> None:
    fits = calibration_with(scale=scale((ROWS, COLUMNS)))
    instrument.use_calibration(fits, by=ANN)  # before the camera tells what it is
    instrument.start(by=ANN)
    state = instrument.state()
    assert (state.calibration, state.calibration_identity, state.trouble) == ("bench", fits.identity, ())
    assert state.camera.mm_per_pixel == pytest.approx((0.3, 0.4))
    remaining = instrument.snapshot(by=ANN)
    assert (remaining.press.calibration, remaining.press.probe) == (fits.identity, "tsis-2011")
    assert remaining.press.mm_per_pixel == pytest.approx((0.3, 0.4))
    assert calibration_sha256(instrument.store.calibration(fits.identity)) == fits.identity


def test_another_setting_puts_it_out_of_force_until_it_is_set_back(instrument: Instrument) -> None:
    instrument.start(by=ANN)
    instrument.use_calibration(calibration_with(), by=ANN)
    instrument.adjust("gain", 5.0, by=ANN)
    assert instrument.calibration is None
    state = instrument.state()
    assert (state.calibration, state.calibration_identity) == ("", "")
    assert state.trouble == (
        "The calibration is inactive, and presses are saved without one: calibration 'bench' holds at gain = 2; the "
        "camera is at 5 (set it back, or calibrate at this setting).",
    )
    assert instrument.snapshot(by=ANN).press.calibration is None
    instrument.preset("default", by=ANN)
    assert instrument.state().trouble == ()
    assert instrument.snapshot(by=ANN).press.calibration == calibration_with().identity


def test_a_setting_that_was_changed_elsewhere_this_moment_is_noticed_by_the_snapshot(
    instrument: Instrument, world: World
) -> None:
    instrument.start(by=ANN)
    instrument.use_calibration(calibration_with(), by=ANN)
    world.cameras[0].gain = 9.0
    assert instrument.snapshot(by=ANN).press.calibration is None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"camera": "aravis:other"}, "must be of the camera in use, 'aravis:lit'; it is of 'aravis:other'"),
        ({"settings": {"gain": 3.0}}, "holds at gain = 3; the camera is at 2"),
        ({"scale": scale((492, 768))}, "is of frames of 768 x 492 pixels; the camera's have 64 x 48"),
        ({"made": NOW - timedelta(days=9), "expires": NOW - timedelta(days=1)}, "must not be expired"),
        ({"made": NOW + timedelta(days=1), "expires": NOW + timedelta(days=9)}, "must not come from the future"),
    ],
)
def test_one_that_does_not_fit_is_refused_and_the_one_before_stays(
    instrument: Instrument, changes: dict[str, Any], text: str
) -> None:
    instrument.use_calibration(calibration_with(), by=ANN)
    instrument.start(by=ANN)
    until(lambda: instrument.state().camera.rows > 0)
    other = UsableCalibration(calibration=replace(calibration_with().calibration, **changes), identity="0" * 64)
    with pytest.raises(CalibrationError, match=text):
        instrument.use_calibration(other, by=ANN)
    assert instrument.state().calibration_identity == calibration_with().identity


@pytest.mark.parametrize("changes", [{"camera": "aravis:other"}, {"scale": scale((492, 768))}])
def test_one_that_was_given_before_the_start_and_does_not_fit_is_told_and_nothing_is_kept_under_it(
    instrument: Instrument, changes: dict[str, Any]
) -> None:
    other = replace(calibration_with().calibration, **changes)
    instrument.use_calibration(UsableCalibration(calibration=other, identity=calibration_sha256(other)), by=ANN)
    instrument.start(by=ANN)
    until(lambda: instrument.state().camera.rows > 0)
    assert "The calibration is inactive" in instrument.state().trouble[0]
    assert instrument.snapshot(by=ANN).press.calibration is None
    until(lambda: instrument.frame_analysis is not None)  # the live view goes on
    assert np.sum(instrument.frame_analysis.histogram if instrument.frame_analysis else 0) == ROWS * COLUMNS


def test_of_a_file_at_the_start(tmp_path: Path) -> None:
    good, old = tmp_path / "good.json", tmp_path / "old.json"
    write_calibration(calibration_with().calibration, good)
    write_calibration(
        replace(calibration_with().calibration, made=NOW - timedelta(days=9), expires=NOW - timedelta(days=1)), old
    )
    with lit_instrument(tmp_path, calibration=good) as instrument:
        instrument.start(by=ANN)
        assert instrument.state().calibration_identity == calibration_with().identity
    with pytest.raises(CalibrationError, match="must not be expired"):
        lit_instrument(tmp_path, calibration=old)
    with pytest.raises(FileInputError):
        lit_instrument(tmp_path, calibration=tmp_path / "none.json")


def test_the_parts_of_one_judgement_belong_together_though_the_camera_is_set_anew_meanwhile(
    instrument: Instrument, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody turns a knob at the camera: each look at its settings finds another gain."""
    fits = calibration_with(scale=scale((ROWS, COLUMNS)))
    instrument.start(by=ANN)
    instrument.use_calibration(fits, by=ANN)
    usual, other = (
        instrument.camera_controller.settings(),
        tuple(replace(item, value=9.0) for item in instrument.camera_controller.settings()),
    )
    checks = cycle((usual, other, other))
    monkeypatch.setattr(instrument.camera_controller, "settings", lambda: next(checks))
    result = []
    for _ in range(6):
        press = instrument.snapshot(by=ANN).press
        result.append((press.calibration is None, press.mm_per_pixel is None, press.probe == "tsis-domed"))
        state = instrument.state()
        result.append((state.calibration == "", state.camera.mm_per_pixel is None, bool(state.trouble)))
    assert set(result) == {(False, False, False), (True, True, True)}


def test_the_next_run_activates_it_again_for_its_camera(tmp_path: Path) -> None:
    fits = calibration_with()
    with lit_instrument(tmp_path) as first:
        first.use_calibration(fits, by=ANN)
    with lit_instrument(tmp_path) as again:
        assert again.state().trouble == ("Calibration 'bench' of the last session is active again.",)
        assert again.state().good_news == again.state().trouble
        again.start(by=ANN)
        state = again.state()
        assert (state.calibration_identity, state.trouble) == (fits.identity, ())
        assert again.snapshot(by=ANN).press.calibration == fits.identity
        again.choose(CameraChoice(), by=ANN)
        again.use_calibration(None, by=ANN)
        again.choose(CameraChoice(spec=LIT), by=ANN)
        assert again.state().calibration_identity == fits.identity
    with lit_instrument(tmp_path, camera="virtual") as other:
        assert other.state().trouble == ()
    with lit_instrument(tmp_path) as last:
        last.use_calibration(None, by=ANN)
    with lit_instrument(tmp_path) as without:
        assert (without.state().calibration, without.state().trouble) == ("", ())


@pytest.mark.parametrize("damage", [b"", b"{}"])
def test_a_calibration_that_cannot_be_read_again_says_so(tmp_path: Path, damage: bytes) -> None:
    with lit_instrument(tmp_path) as first:
        first.use_calibration(calibration_with(), by=ANN)
    (file,) = (tmp_path / "workspace" / "active-calibrations").iterdir()
    file.write_bytes(damage)
    with lit_instrument(tmp_path) as again:
        (message,) = again.state().trouble
        assert message.startswith("The calibration of the last session was not activated: ")
        assert again.state().good_news == ()
        assert again.calibration is None


def test_one_that_was_given_at_the_start_comes_first(tmp_path: Path) -> None:
    with lit_instrument(tmp_path) as first:
        first.use_calibration(calibration_with(), by=ANN)
    other = calibration_with(name="other")
    write_calibration(other.calibration, tmp_path / "other.json")
    with lit_instrument(tmp_path, calibration=tmp_path / "other.json") as again:
        assert (again.state().calibration_identity, again.state().trouble) == (other.identity, ())
