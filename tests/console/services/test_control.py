"""Who holds the camera, on a clock that stands still, and one command at a time."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from tests.waiting import HANGS_S

from tsis.console.services.control import Commands, ControlLock, Owner
from tsis.errors import ControlError, InputError


class Clock:
    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def control(clock: Clock) -> ControlLock:
    control = ControlLock(clock=clock)
    control.take("a", "Ann")
    return control


def test_a_holder_who_is_heard_of_keeps_the_camera(control: ControlLock, clock: Clock) -> None:
    for _ in range(5):
        clock.now_s += 9.0
        control.heard_of("a")
        control.heard_of("b")  # who is nobody
    assert control.owner() == Owner(identity="a", name="Ann")


def test_every_act_is_a_sign_of_life(control: ControlLock, clock: Clock) -> None:
    clock.now_s += 9.0
    control.require("a")
    clock.now_s += 9.0
    control.require("a")


@pytest.mark.parametrize("looked_at", [True, False])
def test_a_silent_holder_has_gone_whether_anybody_looked_or_not(
    control: ControlLock, clock: Clock, looked_at: bool
) -> None:
    clock.now_s += 10.5
    if looked_at:
        assert control.owner() is None
    control.heard_of("a")  # too late
    assert control.owner() is None
    with pytest.raises(ControlError, match="nobody controls the camera; take it first"):
        control.require("a")
    control.take("b", "Bob")
    with pytest.raises(ControlError, match="controlled by Bob"):
        control.take("a", "Ann")


def test_the_end_of_the_time_still_belongs_to_the_holder(control: ControlLock, clock: Clock) -> None:
    clock.now_s += 10.0
    control.require("a")


def test_a_script_may_be_silent_for_as_long_as_it_said(control: ControlLock, clock: Clock) -> None:
    control.take("a", "Ann", held_s=3600.0)
    clock.now_s += 3599.0
    control.require("a")
    control.take("a", "Ann")  # again as pages do
    clock.now_s += 11.0
    assert control.owner() is None


def test_taking_over_tells_the_former(control: ControlLock) -> None:
    with pytest.raises(ControlError, match="the camera is controlled by Ann; watch, or take it over"):
        control.take("b", "Bob")
    control.take("b", "Bob", over=True)
    with pytest.raises(ControlError, match="Bob has taken the camera over; watch, or take it back"):
        control.require("a")
    with pytest.raises(ControlError, match="the camera is controlled by Bob; watch, or take it over"):
        control.require("c")
    control.take("a", "Ann", over=True)
    control.require("a")
    with pytest.raises(ControlError, match="Ann has taken the camera over"):
        control.require("b")


def test_only_the_holder_gives_it_back(control: ControlLock) -> None:
    control.release("b")
    control.require("a")
    control.release("a")
    assert control.owner() is None


def test_whoever_acts_is_not_silent(control: ControlLock, clock: Clock) -> None:
    with control.acting("a"):
        clock.now_s += 60.0
        assert control.owner() is not None
    clock.now_s += 9.0
    control.require("a")


def test_the_camera_can_be_taken_from_who_acts(control: ControlLock, clock: Clock) -> None:
    with control.acting("a"):
        control.take("b", "Bob", over=True)
        clock.now_s += 11.0
    assert control.owner() is None  # Bob was silent, and Ann holds nothing


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"name": ""}, "1 to 60 characters"),
        ({"name": "a\nb"}, "1 to 60 characters"),
        ({"name": "x" * 61}, "1 to 60 characters"),
        ({"name": 3}, "name must be a str"),
        ({"identity": None}, "identity must be a str"),
        ({"held_s": 0.5}, "held_s must lie in"),
        ({"held_s": float("nan")}, "held_s must lie in"),
    ],
)
def test_a_holder_that_cannot_be_shown_is_refused(control: ControlLock, given: dict[str, Any], text: str) -> None:
    expected: dict[str, Any] = {"identity": "a", "name": "Ann"} | given
    with pytest.raises(InputError, match=text):
        control.take(expected["identity"], expected["name"], held_s=expected.get("held_s", 10.0), over=True)
    control.require("a")


def test_of_many_who_take_it_one_gets_it() -> None:
    control, guarded_app = ControlLock(), threading.Barrier(8)
    got: list[str] = []

    def take(identity: str) -> None:
        guarded_app.wait(HANGS_S)
        try:
            control.take(identity, identity)
        except ControlError:
            return
        got.append(identity)

    threads = [threading.Thread(target=take, args=(f"tab {number}",)) for number in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(HANGS_S)
    holder = control.owner()
    assert holder is not None
    assert got == [holder.identity]


@pytest.fixture
def held() -> ControlLock:
    held = ControlLock()
    held.take("a", "Ann", held_s=600.0)
    return held


class Lasting:
    """An act that lasts until it is let go."""

    def __init__(self, commands: Commands) -> None:
        self._acts, self._over, self._begun = commands, threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()
        assert self._begun.wait(HANGS_S)

    def _run(self) -> None:
        with self._acts.run("a", "moving the probe"):
            self._begun.set()
            self._over.wait(HANGS_S)

    def end(self) -> None:
        self._over.set()
        self._thread.join(HANGS_S)


@pytest.fixture
def hurried(held: ControlLock) -> Commands:
    return Commands(held, timeout_s=0.01)


def test_who_comes_meanwhile_is_told_what_is_being_done(hurried: Commands) -> None:
    lasting = Lasting(hurried)
    assert hurried.busy == "moving the probe"
    with pytest.raises(ControlError, match="the instrument is busy moving the probe; try again"), hurried.run("a", "x"):
        pytest.fail("two acts at once")
    lasting.end()
    with hurried.run("a", "x"):
        assert hurried.busy == "x"
    assert hurried.busy == ""


def test_of_an_act_that_lasts_is_told_for_how_long(held: ControlLock) -> None:
    now_s = [5.0]
    commands = Commands(held, timeout_s=0.01, clock=lambda: now_s[0])
    lasting = Lasting(commands)
    assert commands.busy == "moving the probe"
    now_s[0] += 75.0
    assert commands.busy == "moving the probe (75 s so far)"
    with pytest.raises(ControlError, match=r"busy moving the probe \(75 s so far\); try again"), commands.run("a", "x"):
        pytest.fail("two acts at once")
    lasting.end()
    assert commands.busy == ""


def test_who_lost_the_camera_while_he_waited_does_not_act(held: ControlLock) -> None:
    commands, refused = Commands(held, timeout_s=10.0), []
    lasting = Lasting(commands)

    def wait() -> None:
        try:
            with commands.run("a", "x"):
                pytest.fail("an act of who no longer holds the camera")
        except ControlError as error:
            refused.append(str(error))

    waiting = threading.Thread(target=wait)
    waiting.start()
    held.take("b", "Bob", over=True)
    lasting.end()
    waiting.join(HANGS_S)
    assert refused == ["Bob has taken the camera over; watch, or take it back"]


def test_an_act_that_fails_lets_the_next_one_pass(hurried: Commands) -> None:
    with pytest.raises(InputError), hurried.run("a", "x"):
        raise InputError("wrong")
    with hurried.run("a", "y"):
        assert hurried.busy == "y"


def test_a_closed_bench_lets_nothing_pass_but_what_is_under_way(hurried: Commands) -> None:
    lasting = Lasting(hurried)
    hurried.close()
    lasting.end()
    with pytest.raises(ControlError, match="the console is shutting down"), hurried.run("a", "x"):
        pytest.fail("an act after the end")
