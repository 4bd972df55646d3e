"""Frames exposed in a process of their own: the same as here, and what becomes of them when a program is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.waiting import until

from tsis.imaging.sensor import Sensor
from tsis.virtual.camera import ExposingProcess, exposed

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
SENSOR = Sensor(rows=24, columns=32, mm_per_pixel=(0.1, 0.1))
LIGHT = np.linspace(0.0, 200.0, SENSOR.rows * SENSOR.columns).reshape(SENSOR.rows, SENSOR.columns)


@pytest.fixture
def apart() -> Iterator[ExposingProcess]:
    with closing(ExposingProcess(np.random.default_rng(5))) as process:
        yield process


def _first_apart(process: ExposingProcess, light: NDArray[np.float64], sensor: Sensor = SENSOR) -> NDArray[np.uint8]:
    """The first frame that comes from the process."""
    frames: list[NDArray[np.uint8]] = []

    def ready() -> bool:
        frames.append(process.expose(light, 1.0, sensor))
        return process.pid is not None

    until(ready)
    return frames[-1]


def test_frames_are_those_of_a_spawned_generator(apart: ExposingProcess) -> None:
    rng = np.random.default_rng(5).spawn(1)[0]
    np.testing.assert_array_equal(_first_apart(apart, LIGHT), exposed(LIGHT, 1.0, SENSOR, rng))
    assert apart.pid not in (None, os.getpid())
    for light, factor, sensor in (
        (LIGHT, 0.5, SENSOR),
        (LIGHT[::-1], 1.0, SENSOR),
        (LIGHT, 1.0, Sensor(rows=24, columns=32, mm_per_pixel=(0.1, 0.1), full_scale=4095.0, background_grey=200.0)),
    ):
        frame = apart.expose(light, factor, sensor)
        np.testing.assert_array_equal(frame, exposed(light, factor, sensor, rng))
        assert frame.dtype == (np.uint8 if sensor is SENSOR else np.uint16)


def test_a_later_stream_has_other_noise() -> None:
    rng = np.random.default_rng(5)
    with closing(ExposingProcess(rng)) as first:
        before = _first_apart(first, LIGHT)
    with closing(ExposingProcess(rng)) as second:
        assert (_first_apart(second, LIGHT) != before).mean() > 0.3


def test_frames_go_on_when_the_process_was_killed(apart: ExposingProcess) -> None:
    _first_apart(apart, LIGHT)
    assert apart.pid is not None
    os.kill(apart.pid, signal.SIGKILL)
    expected = exposed(LIGHT, 1.0, SENSOR, np.random.default_rng(8)).astype(float)
    for _ in range(3):
        frame = apart.expose(LIGHT, 1.0, SENSOR).astype(float)
        assert np.abs(frame - expected).mean() < 3.0  # noise, twice
    assert apart.pid is None


PROGRAM = """
import numpy as np
from tests.virtual.test_exposure import LIGHT, _first_apart
from tsis.virtual.camera import ExposingProcess

if __name__ == "__main__":
    process = ExposingProcess(np.random.default_rng(1))
    _first_apart(process, LIGHT)
    print(process.pid, flush=True)
    input()
"""


def test_the_process_ends_with_a_program_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "program.py"
    script.write_text(PROGRAM)
    command = [sys.executable, str(script)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)}
    ) as program:
        assert program.stdout is not None
        there = int(program.stdout.readline())
        program.kill()

    def ended() -> bool:
        try:
            os.kill(there, 0)
        except ProcessLookupError:
            return True
        return False

    until(ended)
