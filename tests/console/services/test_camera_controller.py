"""The camera on the desk: settings remembered, frames only of after the last change, losses, drivers that hang."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest
from tests.console.services.lit_camera import COLUMNS, ROWS, World, seen
from tests.console.services.instruments import LIT
from tests.waiting import HANGS_S, until

from tsis.console.services import CameraChoice
from tsis.console.services._camera import CameraController
from tsis.errors import CameraError, ControlError, InputError, UnknownNameError

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture
def desk(world: World) -> Iterator[CameraController]:
    desk = CameraController(CameraChoice(spec=LIT), connect_to=world.connect)
    yield desk
    desk.close()


def gain(desk: CameraController) -> float:
    return {each.name: each.value for each in desk.settings()}["gain"]


def test_settings_are_remembered_over_stop_and_start_and_forgotten_with_another_choice(
    desk: CameraController, world: World
) -> None:
    desk.start()
    desk.adjust("gain", 6.0)
    assert gain(desk) == 6.0
    desk.stop()
    assert desk.settings() == ()
    desk.start()
    assert gain(desk) == 6.0
    assert len(world.cameras) == 2
    desk.choose(CameraChoice(spec=LIT))
    desk.start()
    assert gain(desk) == 2.0


def test_settings_are_made_again_when_a_lost_camera_is_back(desk: CameraController, world: World) -> None:
    desk.start()
    desk.adjust("gain", 6.0)
    world.plugged = False
    until(lambda: desk.acquisition is not None and desk.acquisition.lost)
    assert desk.settings() == ()
    with pytest.raises(CameraError, match="not connected; wait"):
        desk.adjust("gain", 7.0)
    world.plugged = True
    until(lambda: desk.acquisition is not None and not desk.acquisition.lost)
    assert world.cameras[-1].adjusted == [6.0]
    assert gain(desk) == 6.0


def test_presets_go_back_to_how_the_camera_came_also_after_a_stop(desk: CameraController) -> None:
    desk.start()
    desk.adjust("gain", 6.0)
    desk.stop()
    desk.start()
    desk.preset("minimal")
    assert gain(desk) == 0.0
    desk.preset("default")
    assert gain(desk) == 2.0
    with pytest.raises(UnknownNameError, match="did you mean 'default'"):
        desk.preset("defaults")


def test_a_setting_that_is_refused_is_not_remembered(desk: CameraController) -> None:
    desk.start()
    for wrong in (25.0, float("nan")):
        with pytest.raises(InputError, match="gain must lie in"):
            desk.adjust("gain", wrong)
    with pytest.raises(UnknownNameError, match="no setting is called 'force_n'"):
        desk.adjust("force_n", 1.0)
    desk.stop()
    desk.start()
    assert gain(desk) == 2.0


def test_a_remembered_setting_that_the_camera_no_longer_takes_does_not_keep_it_from_starting(
    desk: CameraController, world: World
) -> None:
    desk.start()
    desk.adjust("gain", 20.0)
    desk.stop()
    world.most_gain = 12.0  # another camera answers by the same name
    with pytest.raises(InputError, match=r"gain must lie in \[0, 12\]; got 20"):
        desk.start()
    desk.start()
    assert gain(desk) == 2.0


def test_what_is_changed_elsewhere_is_seen_and_told(world: World) -> None:
    told = threading.Event()
    desk = CameraController(CameraChoice(spec=LIT), changed=told.set, connect_to=world.connect)
    desk.start()
    assert not told.is_set()
    world.cameras[0].gain = 9.0
    assert told.wait(HANGS_S)  # looked at every second
    assert gain(desk) == 9.0
    desk.close()


@pytest.mark.parametrize("queued", [0, 2])
def test_a_frame_is_never_of_before_the_last_change(desk: CameraController, world: World, queued: int) -> None:
    """A frame may be exposed, and others wait in the driver, while the change is made."""
    world.queued = queued
    desk.start()
    for step in range(12):
        world.level, wanted = 40 + 10 * step, float(step)
        desk.adjust("gain", wanted)
        arrival = desk.fresh()
        assert (arrival.frame.pixels == seen(world.level, wanted)).all()
        world.level = 45 + 10 * step
        desk.hold("plain" if step % 2 else "target", 0.1 * step)
        assert (desk.fresh().frame.pixels == seen(world.level, wanted)).all()


def test_without_a_change_it_is_the_newest_frame(desk: CameraController) -> None:
    desk.start()
    until(lambda: desk.acquisition is not None and desk.acquisition.ring.end > 3)
    assert desk.acquisition is not None
    before = desk.acquisition.latest()
    fresh = desk.fresh()
    assert before is not None
    assert fresh.frame.sequence >= before.frame.sequence


def test_no_frame_of_before_a_loss(desk: CameraController, world: World) -> None:
    desk.start()
    desk.fresh()
    world.plugged = False
    until(lambda: desk.acquisition is not None and desk.acquisition.lost)
    with pytest.raises(CameraError, match="aravis:lit is away; nothing was saved"):
        desk.fresh()
    world.level, world.plugged = 90, True
    until(lambda: desk.acquisition is not None and not desk.acquisition.lost)
    assert (desk.fresh().frame.pixels == seen(90, 2.0)).all()


def test_a_camera_that_cannot_be_opened_can_be_started_once_it_can(desk: CameraController, world: World) -> None:
    world.refuses = "lit is held by another program; close it"
    for _ in range(2):
        with pytest.raises(CameraError, match="held by another program"):
            desk.start()
        assert not desk.running
        assert desk.name == ""
    world.refuses = ""
    desk.start()
    assert (desk.fresh().frame.pixels.shape, desk.name) == ((ROWS, COLUMNS), LIT)


def test_a_mode_that_it_does_not_have_is_refused_and_another_can_be_chosen(desk: CameraController) -> None:
    desk.choose(CameraChoice(spec=LIT, mode="Mono16-64x48@100"))
    with pytest.raises(UnknownNameError, match="did you mean 'Mono8-64x48@100'"):
        desk.start()
    desk.choose(CameraChoice(spec=LIT, mode="Mono8-64x48@100"))
    desk.start()
    assert desk.fresh().frame.pixels.shape == (ROWS, COLUMNS)


def test_closing_does_not_wait_for_a_driver_that_hangs(desk: CameraController, world: World) -> None:
    world.opening, said = threading.Event(), list[str]()

    def start() -> None:
        try:
            desk.start()
        except (CameraError, ControlError) as error:
            said.append(str(error))

    starting = threading.Thread(target=start)
    starting.start()
    assert world.waits.wait(HANGS_S)
    desk.close()
    assert not world.opening.is_set()
    world.opening.set()
    starting.join(HANGS_S)
    assert said == ["the console is being ended; the camera was not started (start the console again)"]
    assert not desk.running
    with pytest.raises(ControlError, match="being ended"):
        desk.start()


def test_a_stopped_camera_has_no_frame_and_no_setting(desk: CameraController) -> None:
    for act in (desk.fresh, lambda: desk.adjust("gain", 3.0)):
        with pytest.raises(CameraError, match=r"must run for this; it is stopped \(start it\)"):
            act()


@pytest.mark.parametrize("force_n", [-0.1, 1000.5, float("nan"), float("inf"), "1"])
def test_a_force_that_nobody_presses_with_is_refused(desk: CameraController, force_n: float) -> None:
    desk.hold("ball", 2.0)
    with pytest.raises(InputError, match="force_n must"):
        desk.hold("plain", force_n)
    assert (desk.role, desk.force_n) == ("ball", 2.0)
    with pytest.raises(UnknownNameError, match="no role is called 'tissue'"):
        desk.hold("tissue", 1.0)
    desk.hold(*desk.completed(None, None, forget=True))
    assert desk.force_n is None
