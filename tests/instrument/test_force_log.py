"""Readings of a gauge as they come, and the delay of its forces behind the frames."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from tests.instrument.sending_gauge import sending
from tests.waiting import HANGS_S

from tsis.errors import GaugeError, InputError
from tsis.instrument.force_log import ForceLog, connected_gauge, find_latency
from tsis.instrument.gauge import ForceReading

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class ScriptedGauge:
    """Delivers what it is told, then stays until it is closed or fails."""

    def __init__(self, count: int, *, failure: Exception | None = None) -> None:
        self.name, self.lost, self.skipped = "scripted gauge", failure is not None, 3
        self.count, self.failure, self.opened = count, failure, 0
        self.closed = threading.Event()

    def open(self) -> None:
        self.opened += 1
        self.closed.clear()

    def readings(self) -> Iterator[ForceReading]:
        for k in range(self.count):
            yield ForceReading(time_s=k / 10, force_n=0.2 * k / 10)
        if self.failure is not None:
            raise self.failure
        self.closed.wait(HANGS_S)

    def tare(self) -> None:
        raise NotImplementedError

    def close(self) -> None:
        self.closed.set()


def test_it_keeps_the_latest_and_counts_the_rest() -> None:
    with ForceLog(ScriptedGauge(100), capacity=30) as log:
        assert log.wait_for(100, timeout_s=HANGS_S)
        state = log.state()
        assert [reading.time_s for reading in log.readings()] == [k / 10 for k in range(70, 100)]
        assert [reading.time_s for reading in log.readings(since_s=9.65)] == [9.7, 9.8, 9.9]
        assert log.at(9.45).force_n == pytest.approx(1.89)
    assert (state.running, state.received, state.discarded, state.skipped) == (True, 100, 70, 3)
    assert (log.state().running, log.state().error) == (False, "")
    assert len(log.readings()) == 30


def test_a_gauge_that_lags_is_looked_up_later() -> None:
    with ForceLog(ScriptedGauge(100), latency_s=0.05) as log:
        assert log.wait_for(100, timeout_s=HANGS_S)
        assert log.at(9.40).force_n == pytest.approx(1.89)
        assert log.wait_until(9.84, timeout_s=0.0)  # the last reading is of 9.9
        assert not log.wait_until(9.86, timeout_s=0.0)


@pytest.mark.parametrize(
    ("failure", "message"),
    [
        (GaugeError("the gauge was lost"), "the gauge was lost"),
        (RuntimeError("driver\nbroke"), "scripted gauge failed with RuntimeError: driver"),
    ],
)
def test_why_readings_ended_is_kept(failure: Exception, message: str) -> None:
    with ForceLog(ScriptedGauge(10, failure=failure)) as log:
        assert not log.wait_for(11, timeout_s=HANGS_S)
        state = log.state()
        assert (state.running, state.received, state.lost) == (False, 10, True)
        assert state.error.startswith(message)
        assert log.at(0.45).force_n == pytest.approx(0.09)  # readings stay
        with pytest.raises(GaugeError, match=rf"after the last force reading.*; the readings ended: {message}"):
            log.at(50.0)


def test_waiting_spares_an_extrapolation() -> None:
    with ForceLog(ScriptedGauge(20)) as log:
        assert log.wait_until(1.85, timeout_s=HANGS_S)
        assert log.readings()[-1].time_s > 1.85
        assert not log.wait_until(1.95, timeout_s=0.01)


def test_it_starts_once_and_again_after_a_stop() -> None:
    gauge = ScriptedGauge(10)
    log = ForceLog(gauge)
    log.start()
    with pytest.raises(GaugeError, match="was started already; stop it first"):
        log.start()
    assert log.wait_for(10, timeout_s=HANGS_S)
    log.stop()
    log.stop()
    gauge.count = 5
    log.start()
    assert log.wait_for(5, timeout_s=HANGS_S)
    assert (log.state().received, gauge.opened) == (5, 2)
    log.stop()


def test_many_threads_may_read_while_it_fills() -> None:
    # Every snapshot is a run of successive readings, whatever is discarded meanwhile.
    broken: list[str] = []

    def look(log: ForceLog) -> None:
        for _ in range(100):
            times = [reading.time_s for reading in log.readings()]
            if [round(10 * at_s) for at_s in times] != list(range(round(10 * times[0]), round(10 * times[-1]) + 1)):
                broken.append("a snapshot has gaps")

    with ForceLog(ScriptedGauge(20_000), capacity=50) as log:
        assert log.wait_for(1, timeout_s=HANGS_S)
        threads = [threading.Thread(target=look, args=(log,)) for _ in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert log.wait_for(20_000, timeout_s=HANGS_S)
        assert log.state().discarded == 19_950
    assert broken == []


def test_a_gauge_that_sends_is_read_in_newtons() -> None:
    with sending(b"500 mN\r\n") as port:
        log = connected_gauge(port, sends=True)
        try:
            assert log.state().error == ""
            assert {round(reading.force_n, 12) for reading in log.readings()} == {0.5}
        finally:
            log.stop()


def test_a_port_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(GaugeError, match="nowhere"):
        connected_gauge(str(tmp_path / "nowhere"))


def test_a_speed_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="baud"):
        connected_gauge("/dev/null", baud=-1)


def _presses(rng: np.random.Generator, span_s: float) -> Callable[[Floats], Floats]:
    """Presses of random times, depths and lengths."""
    count = max(int(span_s / 1.5), 3)
    centres, widths = np.sort(rng.uniform(0, span_s, count)), rng.uniform(0.25, 0.9, count)
    depths = rng.uniform(0.2, 1.5, count)
    return lambda times: np.asarray(np.exp(-(((times[:, None] - centres) / widths) ** 2)) @ depths)


def _seen(
    rng: np.random.Generator,
    latency_s: float,
    *,
    span_s: float = 20.0,
    frames_per_s: float = 30.0,
    rate_per_s: float = 15.0,
    noise_n: float = 0.002,
    grey_noise: float = 0.5,
    sign: float = 1.0,
) -> tuple[Floats, Floats, list[ForceReading]]:
    """Frames whose grey is neither linear in force nor steady, and the readings of a gauge that is late."""
    force = _presses(rng, span_s)
    frame_times = rng.uniform(0, 0.1) + np.arange(0, span_s, 1 / frames_per_s)
    frame_times += rng.normal(0, 0.001, len(frame_times))
    drift = 1 + 0.01 * np.sin(frame_times / 7)
    sums = 100 + sign * 50 * force(frame_times) ** 1.05 * drift + grey_noise * rng.standard_normal(len(frame_times))
    times = rng.uniform(0, 0.1) + np.arange(0, span_s, 1 / rate_per_s)
    forces = 0.001 * np.round((force(times - latency_s) + noise_n * rng.standard_normal(len(times))) / 0.001)
    readings = [
        ForceReading(time_s=at_s, force_n=force_n, resolution_n=0.001)
        for at_s, force_n in zip(times, forces, strict=True)
    ]
    return frame_times, sums, readings


@pytest.mark.parametrize(
    "settings",
    [{}, {"noise_n": 0.02}, {"rate_per_s": 10.0}, {"rate_per_s": 30.0}, {"span_s": 10.0}, {"grey_noise": 2.5}],
)
def test_the_interval_holds_the_delay_as_often_as_stated(settings: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    held, missed = [], []
    for _ in range(40):
        latency_s = rng.uniform(-0.2, 0.3)
        found = find_latency(*_seen(rng, latency_s, **settings))
        low, high = found.interval(0.95)
        held.append(low <= latency_s <= high)
        missed.append(found.latency_s - latency_s)
    # At 95 % fewer than 33 of 40 would be seen in one of 1,000 runs.
    assert np.sum(held) >= 33
    assert abs(np.mean(missed)) < 0.001
    assert np.sqrt(np.mean(np.square(missed))) < 0.006


def test_grey_may_fall_with_force() -> None:
    found = find_latency(*_seen(np.random.default_rng(1), 0.12, sign=-1.0))
    assert found.latency_s == pytest.approx(0.12, abs=0.005)
    assert found.correlation > 0.98


def test_what_holds_no_delay_is_refused() -> None:
    rng = np.random.default_rng(4)
    times, sums, readings = _seen(rng, 0.1)
    flat = [
        ForceReading(time_s=each.time_s, force_n=0.5 + 0.001 * (k % 2), resolution_n=0.001)
        for k, each in enumerate(readings)
    ]
    with pytest.raises(GaugeError, match=r"the force must change by more than .* press and release"):
        find_latency(times, sums, flat)
    with pytest.raises(GaugeError, match="sum of grey levels must change"):
        find_latency(times, 100 + rng.standard_normal(len(times)), readings)
    with pytest.raises(GaugeError, match="must go together"):
        find_latency(times, _seen(np.random.default_rng(99), 0.0)[1], readings)
    with pytest.raises(GaugeError, match="overlap for more than 3 s"):
        find_latency(times + 18, sums, readings)
    late = _seen(np.random.default_rng(6), 0.3)
    with pytest.raises(GaugeError, match=r"shorter than 0\.1 s|must go together"):
        find_latency(*late, longest_s=0.1)


def test_a_course_that_repeats_itself_is_refused() -> None:
    times = np.arange(0.0, 20.0, 1 / 30)
    readings = [ForceReading(time_s=t, force_n=float(np.sin(2 * np.pi * 4 * t))) for t in np.arange(0.0, 20.0, 0.02)]
    with pytest.raises(GaugeError, match="fit alike because the course repeats itself; press unevenly"):
        find_latency(times, np.sin(2 * np.pi * 4 * times), readings)


def test_arrays_are_checked() -> None:
    times, sums, readings = _seen(np.random.default_rng(4), 0.1)
    with pytest.raises(InputError, match="each frame must have a time and a value"):
        find_latency(times, sums[:-1], readings)
    with pytest.raises(InputError, match="frame times must ascend"):
        find_latency(times[::-1], sums, readings)
    with pytest.raises(GaugeError, match="at least 24 readings"):
        find_latency(times, sums, readings[:5])
    with pytest.raises(GaugeError, match="at least 24 readings"):
        find_latency(times, sums, [])
    with pytest.raises(InputError, match="finite"):
        find_latency(times, np.full_like(sums, np.nan), readings)
    with pytest.raises(InputError, match="longest_s"):
        find_latency(times, sums, readings, longest_s=0.0)
    with pytest.raises(InputError, match="give a part of it"):
        find_latency(np.r_[times, 1e9], np.r_[sums, 0.0], readings)
