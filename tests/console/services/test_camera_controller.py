"""The camera controller: settings remembered, frames only of after the last change, losses, drivers that hang."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, ClassVar

import pytest
from tests.console.services.instruments import LIT
from tests.console.services.lit_camera import COLUMNS, ROWS, World, observed
from tests.waiting import HANGS_S, until

from tsis.console.services import camera
from tsis.console.services.camera import CameraController
from tsis.console.services.choice import CameraChoice
from tsis.errors import CameraError, ControlError, InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterator


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
