from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from tsis.errors import GaugeError, InputError
from tsis.instrument.gauge import ForceReading, Gauge, SimulatedGauge


class Clock:
    def __init__(self) -> None:
        self.now_s = 50.0

    def __call__(self) -> float:
        return self.now_s

    def wait(self, seconds: float) -> None:
        self.now_s += seconds


def _gauge(clock: Clock, **settings: float) -> SimulatedGauge:
    gauge = SimulatedGauge(
        lambda time_s: 0.5 + 0.1 * (time_s - 50),
        rng=np.random.default_rng(7),
        clock=clock,
        wait=clock.wait,
        **settings,
    )
    gauge.open()
    return gauge


def _taken(gauge: SimulatedGauge, count: int) -> list[ForceReading]:
    return list(islice(gauge.readings(), count))


def test_noise_gain_zero_and_rate_are_those_stated() -> None:
    clock = Clock()
    gauge = _gauge(clock, noise_n=0.02, resolution_n=0.0, zero_n=0.3, gain=1.1, rate_per_s=25.0)
    assert isinstance(gauge, Gauge)
    readings = _taken(gauge, 4000)
    times = np.array([reading.time_s for reading in readings])
    forces = np.array([reading.force_n for reading in readings])
    assert np.diff(times) == pytest.approx(0.04)
    errors = forces - 1.1 * (0.5 + 0.1 * (times - 50)) - 0.3
    # Of 4000 draws the mean lies within 4 sd/sqrt(4000), the sd within 4 sd/sqrt(8000).
    assert abs(errors.mean()) < 4 * 0.02 / np.sqrt(4000)
    assert abs(errors.std() - 0.02) < 4 * 0.02 / np.sqrt(8000)
    assert abs(np.corrcoef(errors[1:], errors[:-1])[0, 1]) < 4 / np.sqrt(4000)


def test_the_display_has_steps() -> None:
    readings = _taken(_gauge(Clock(), noise_n=0.004, resolution_n=0.02, rate_per_s=50.0), 200)
    steps = np.array([reading.force_n for reading in readings]) / 0.02
    assert steps == pytest.approx(np.round(steps))
    assert len(set(np.round(steps))) > 10
    assert {reading.resolution_n for reading in readings} == {0.02}


def test_tare_takes_the_present_force_off() -> None:
    clock = Clock()
    gauge = _gauge(clock, noise_n=0.0, resolution_n=0.0, zero_n=0.4, gain=2.0)
    clock.now_s += 3
    gauge.tare()
    (reading,) = _taken(gauge, 1)
    assert reading.force_n == pytest.approx(0.0, abs=1e-12)
    clock.now_s += 1
    (reading,) = _taken(gauge, 1)
    assert reading.force_n == pytest.approx(0.2)


def test_readings_nobody_fetched_are_never_made() -> None:
    clock = Clock()
    readings = _gauge(clock, rate_per_s=10.0).readings()
    first = next(readings)
    clock.now_s += 1.05
    second = next(readings)
    assert first.time_s == 50.0
    assert second.time_s == pytest.approx(51.0)


def test_it_must_be_open_and_ends_when_closed() -> None:
    gauge = _gauge(Clock())
    readings = gauge.readings()
    next(readings)
    gauge.close()
    assert list(readings) == []
    with pytest.raises(GaugeError, match="must be opened first"):
        gauge.tare()
    with pytest.raises(GaugeError, match="must be opened first"):
        next(gauge.readings())
    with pytest.raises(InputError, match="rate_per_s"):
        _gauge(Clock(), rate_per_s=0.0)
