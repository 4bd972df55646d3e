"""One act at a time."""

from __future__ import annotations

import threading

import pytest
from tests.waiting import HANGS_S

from tsis.console.services.control import Commands, ControlLock
from tsis.errors import ControlError, InputError


@pytest.fixture
def control() -> ControlLock:
    control = ControlLock()
    control.take("a", "Ann", held_s=600.0)
    return control


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
def hurried(control: ControlLock) -> Commands:
    return Commands(control, timeout_s=0.01)


def test_who_comes_meanwhile_is_told_what_is_being_done(hurried: Commands) -> None:
    lasting = Lasting(hurried)
    assert hurried.busy == "moving the probe"
    with pytest.raises(ControlError, match="the instrument is busy moving the probe; try again"), hurried.run("a", "x"):
        pytest.fail("two acts at once")
    lasting.end()
    with hurried.run("a", "x"):
        assert hurried.busy == "x"
    assert hurried.busy == ""


def test_of_an_act_that_lasts_is_told_for_how_long(control: ControlLock) -> None:
    now_s = [5.0]
    commands = Commands(control, timeout_s=0.01, clock=lambda: now_s[0])
    lasting = Lasting(commands)
    assert commands.busy == "moving the probe"
    now_s[0] += 75.0
    assert commands.busy == "moving the probe (75 s so far)"
    with pytest.raises(ControlError, match=r"busy moving the probe \(75 s so far\); try again"), commands.run("a", "x"):
        pytest.fail("two acts at once")
    lasting.end()
    assert commands.busy == ""


def test_who_lost_the_camera_while_he_waited_does_not_act(control: ControlLock) -> None:
    commands, refused = Commands(control, timeout_s=10.0), []
    lasting = Lasting(commands)

    def wait() -> None:
        try:
            with commands.run("a", "x"):
                pytest.fail("an act of who no longer holds the camera")
        except ControlError as error:
            refused.append(str(error))

    waiting = threading.Thread(target=wait)
    waiting.start()
    control.take("b", "Bob", over=True)
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
