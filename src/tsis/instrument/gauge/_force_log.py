"""A log of a gauge's readings, filled by a thread."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.errors import GaugeError, TsisError
from tsis.instrument.gauge._alignment import LONGEST_GAP_S, ForceAtTime, force_at
from tsis.instrument.gauge._serial_gauge import SerialGauge
from tsis.model.require import require_integer, require_number
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Callable
    from types import TracebackType

    from tsis.instrument.gauge._gauge import ForceReading, Gauge


_LONGEST_END_S = 5.0  # a gauge closes within its own timeout; longer than this it hangs


@dataclass(frozen=True, slots=True, kw_only=True)
class LogState:
    """State of a log since its start.

    Parameters
    ----------
    running
        True while readings may arrive.
    received
        Number of readings.
    discarded
        Number of the oldest readings that were dropped from a full log.
    skipped
        Number of invalid replies.
    lost
        True when the gauge stopped answering.
    error
        Reason of an early end; empty otherwise.
    """

    running: bool
    received: int
    discarded: int
    skipped: int
    lost: bool
    error: str


class ForceLog:
    """The latest readings of a gauge; every call may come from any thread.

    Parameters
    ----------
    gauge
        Source of readings; the log opens and closes it.
    capacity
        Largest number of readings; older ones are discarded and counted.
    latency_s
        Delay of the gauge relative to frames, in [-10, 10] s; `find_latency` measures it.

    Examples
    --------
    >>> import numpy as np
    >>> from tsis.instrument.gauge import SimulatedGauge
    >>> gauge = SimulatedGauge(lambda time_s: 0.5, rng=np.random.default_rng(0), rate_per_s=1000.0)
    >>> with ForceLog(gauge) as log:
    ...     _ = log.wait_for(8, timeout_s=10.0)
    ...     force = log.at(log.readings()[4].time_s)
    >>> abs(force.force_n - 0.5) < 0.01, log.state().error
    (True, '')
    """

    def __init__(self, gauge: Gauge, *, capacity: int = 100_000, latency_s: float = 0.0) -> None:
        self._gauge, self._latency_s = gauge, require_number("latency_s", latency_s, -10.0, 10.0, hint="seconds")
        self._readings: deque[ForceReading] = deque(maxlen=require_integer("capacity", capacity, 8, 10_000_000))
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._running, self._received, self._error = False, 0, ""

    @property
    def name(self) -> str:
        """Display name of the gauge."""
        return self._gauge.name

    def start(self) -> None:
        """Open the gauge and collect its readings; those of an earlier start are dropped.

        Raises `GaugeError` when it runs already, or the gauge cannot be opened.
        """
        if self._thread is not None:
            raise GaugeError(f"the log of {self._gauge.name} was started already; stop it first")
        self._gauge.open()
        with self._changed:
            self._readings.clear()
            self._running, self._received, self._error = True, 0, ""
        self._thread = threading.Thread(target=self._gather, name=f"log of {self._gauge.name}", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close the gauge; the readings stay. Another call does nothing; `GaugeError` when the gauge does not close."""
        self._gauge.close()
        thread, self._thread = self._thread, None
        if thread is not None:
            thread.join(_LONGEST_END_S)
            if thread.is_alive():
                raise GaugeError(f"{self._gauge.name} did not end its readings within {_LONGEST_END_S:g} s; unplug it")

    def __enter__(self) -> ForceLog:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def readings(self, *, since_s: float | None = None) -> tuple[ForceReading, ...]:
        """The stored readings in the order of time, from ``since_s`` on."""
        with self._changed:
            if since_s is None:
                return tuple(self._readings)
            recent = []
            for reading in reversed(self._readings):
                if reading.time_s < since_s:
                    break
                recent.append(reading)
        return tuple(reversed(recent))

    def at(self, time_s: float, *, longest_gap_s: float = LONGEST_GAP_S) -> ForceAtTime:
        """The force at a frame's time; see `force_at`.

        Raises `GaugeError` as `force_at`; the message also states why the readings ended.
        """
        # `force_at` uses eight readings before and eight after the time; without gaps they lie in this interval.
        recent = self.readings(since_s=time_s + self._latency_s - 8 * longest_gap_s)
        if len(recent) < 8:  # the message should describe the present readings
            recent = self.readings()
        try:
            return force_at(recent, time_s, latency_s=self._latency_s, longest_gap_s=longest_gap_s)
        except GaugeError as error:
            ended = self.state().error
            raise GaugeError(f"{error}; the readings ended: {ended}" if ended else str(error)) from error

    def wait_for(self, received: int, *, timeout_s: float) -> bool:
        """Wait for a number of readings since the start; False when they ended before or at the timeout."""
        return self._wait(lambda: self._received >= received, timeout_s)

    def wait_until(self, time_s: float, *, timeout_s: float) -> bool:
        """Wait for the reading after a frame's time, so that the force there is no extrapolation."""
        last_s = time_s + self._latency_s
        return self._wait(lambda: bool(self._readings) and self._readings[-1].time_s > last_s, timeout_s)

    def state(self) -> LogState:
        """State since the start."""
        with self._changed:
            return LogState(
                running=self._running,
                received=self._received,
                discarded=self._received - len(self._readings),
                skipped=self._gauge.skipped,
                lost=self._gauge.lost,
                error=self._error,
            )

    def _gather(self) -> None:
        error = ""
        try:
            for reading in self._gauge.readings():
                with self._changed:
                    self._readings.append(reading)
                    self._received += 1
                    self._changed.notify_all()
        except TsisError as refusal:
            error = str(refusal)
        except Exception as failure:  # the thread has no caller
            error = f"{self._gauge.name} failed with {type(failure).__name__}: {failure!s:.200}"
        with self._changed:
            self._running, self._error = False, error
            self._changed.notify_all()

    def _wait(self, reached: Callable[[], bool], timeout_s: float) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: reached() or not self._running, timeout_s)
            return reached()


FIRST_READINGS, FIRST_S = 4, 5.0
BAUD = 9600


def connected_gauge(
    port: str, *, unit: str | None = None, baud: int = BAUD, sends: bool = False, latency_s: float = 0.0
) -> ForceLog:
    """The running log of a gauge at a serial port; the caller must stop it.

    Parameters
    ----------
    port, unit, baud
        As of `SerialGauge`. A port ``"NAME:..."`` is the gauge of the plug-in NAME, which has settings of its own.
    sends
        Whether it sends on its own, without requests.
    latency_s
        As of `ForceLog`.

    Raises
    ------
    InputError
        When a value is out of its range.
    GaugeError
        When the port cannot be opened, or no readings arrive within 5 s.
    """
    name, colon, identity = str(port).partition(":")
    gauge: Gauge
    if colon and name in find_plugins("gauges"):
        gauge = load_plugin("gauges", name)(identity)
    else:
        gauge = SerialGauge(port, unit=unit, baud=baud, poll=None) if sends else SerialGauge(port, unit=unit, baud=baud)
    log = ForceLog(gauge, latency_s=latency_s)
    log.start()
    if not log.wait_for(FIRST_READINGS, timeout_s=FIRST_S):
        error = log.state().error
        log.stop()
        raise GaugeError(error or f"{gauge.name} must send readings; none came for {FIRST_S:g} s")
    return log
