from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest
from tests.waiting import HANGS_S

from tsis.errors import GaugeError
from tsis.instrument.force_log import ForceLog
from tsis.instrument.gauge import ForceReading

if TYPE_CHECKING:
    from collections.abc import Iterator


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
