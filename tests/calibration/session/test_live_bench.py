from __future__ import annotations

import itertools
import threading
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.instrument.scripted_camera import BREAK, END, ScriptedCamera, frame
from tests.waiting import HANGS_S, until

from tsis.calibration.session import LiveCalibration
from tsis.errors import CameraError, GaugeError
from tsis.instrument.acquisition import Acquisition
from tsis.instrument.gauge import ForceAtTime

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.calibration.session import CalibrationFrame


class Log:
    """Stands in for a gauge's log: the force is the frame's arrival time, newtons."""

    def __init__(self) -> None:
        self.fails = False

    def wait_until(self, time_s: float, *, timeout_s: float) -> bool:
        return True

    def at(self, time_s: float) -> ForceAtTime:
        if self.fails:
            raise GaugeError("the gauge was silent for 1 s; check its cable")
        return ForceAtTime(force_n=time_s % 1, error_n=0.0, gap_s=0.01)


@pytest.fixture
def camera() -> ScriptedCamera:
    return ScriptedCamera()


@pytest.fixture
def acquisition(camera: ScriptedCamera, monkeypatch: pytest.MonkeyPatch) -> Iterator[Acquisition]:
    monkeypatch.setattr("tsis.calibration.session.TIMEOUT_S", HANGS_S)
    with Acquisition(lambda: camera, reconnect=False, lost_after_s=HANGS_S) as running:
        yield running


def test_only_frames_from_now_on_count_and_no_more_than_asked(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    for number in range(3):
        camera.script.put(frame(number, level=number))
    until(lambda: acquisition.ring.end == 3)
    shots = LiveCalibration(acquisition).still(2)
    taken: list[int] = []
    taker = threading.Thread(target=lambda: taken.extend(int(shot.image.grey[0, 0]) for shot in shots))
    taker.start()
    until(lambda: not camera.script.qsize())
    number = 10
    while len(taken) < 2 and taker.is_alive():  # the taker may begin to listen a little later
        camera.script.put(frame(number, level=number))
        number += 1
        taker.join(0.02)
    taker.join(HANGS_S)
    assert len(taken) == 2
    assert taken[1] == taken[0] + 1
    assert min(taken) >= 10


def test_the_last_frame_asked_for_may_be_the_last_that_comes(
    camera: ScriptedCamera, acquisition: Acquisition, monkeypatch: pytest.MonkeyPatch
) -> None:
    shots = LiveCalibration(acquisition).still(2)
    monkeypatch.setattr(type(acquisition.ring), "end", 0)
    camera.script.put(frame(0, level=4))
    camera.script.put(frame(1, level=5))
    camera.script.put(END)
    assert [int(shot.image.grey[0, 0]) for shot in shots] == [4, 5]


def test_a_camera_that_is_lost_is_one_sentence(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    camera.script.put(BREAK)
    until(lambda: acquisition.ring.closed)
    with pytest.raises(CameraError, match=r"must bring frames; none came .*bulk transfer failed"):
        next(LiveCalibration(acquisition).still(4))


def test_a_typed_force_belongs_to_the_next_frame(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    found = []
    taker = threading.Thread(target=lambda: found.append(LiveCalibration(acquisition).take_frame(0.75)))
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number, level=9))
        number += 1
        taker.join(0.02)
    assert found[0].force_n == 0.75
    np.testing.assert_array_equal(found[0].image.grey, 9.0)


def test_a_loading_takes_forces_at_the_frames_until_it_is_over(
    camera: ScriptedCamera, acquisition: Acquisition
) -> None:
    over = itertools.chain([False] * 5, itertools.repeat(True))
    shots: list[CalibrationFrame] = []

    def take() -> None:
        shots.extend(LiveCalibration(acquisition, Log()).loading(lambda: next(over), every_s=0.0))  # type: ignore[arg-type]

    taker = threading.Thread(target=take)
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number, level=number % 200))
        number += 1
        taker.join(0.01)
    assert len(shots) == 5
    levels = [int(shot.image.grey[0, 0]) for shot in shots]
    assert levels == list(range(levels[0], levels[0] + 5))
    for shot in shots:
        assert shot.time_s is not None
        assert shot.force_n == pytest.approx(shot.time_s % 1)


def test_a_loading_takes_no_more_often_than_told(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    over = itertools.chain([False] * 20, itertools.repeat(True))
    shots: list[CalibrationFrame] = []

    def take() -> None:
        shots.extend(LiveCalibration(acquisition, Log()).loading(lambda: next(over), every_s=1e6))  # type: ignore[arg-type]

    taker = threading.Thread(target=take)
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number))
        number += 1
        taker.join(0.005)
    assert len(shots) == 1


def test_a_silent_gauge_ends_the_loading(camera: ScriptedCamera, acquisition: Acquisition) -> None:
    log, raised = Log(), []
    log.fails = True

    def take() -> None:
        try:
            list(LiveCalibration(acquisition, log).loading(lambda: False))  # type: ignore[arg-type]
        except GaugeError as error:
            raised.append(str(error))

    taker = threading.Thread(target=take)
    taker.start()
    number = 0
    while taker.is_alive():
        camera.script.put(frame(number))
        number += 1
        taker.join(0.01)
    assert raised == ["the gauge was silent for 1 s; check its cable"]
