"""Who holds the camera, on a clock that stands still until it is moved."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from tests.waiting import HANGS_S

from tsis.console.services.control import ControlLock, Owner
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
