"""A log of a gauge's readings, and its delay relative to a camera.

The delay is constant and follows from presses that both recorded. The sum of grey levels follows the force with unknown
gain and offset. Both courses are smoothed over twice the longer of the two sampling intervals, so that noise between
samples does not favour some delays. The correlation of their rates of change is insensitive to slow drift of the light
or of the gauge's zero; the delay maximises it. The uncertainty of the delay is that of the jackknife over eight
stretches of the record, which needs no model of the noise.
"""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from tsis.errors import GaugeError, InputError, TsisError
from tsis.instrument.gauge import LONGEST_GAP_S, ForceAtTime, force_at, reading_noise
from tsis.instrument.serial_gauge import SerialGauge
from tsis.model.require import require_array, require_integer, require_number
from tsis.plugins import find_plugins, load_plugin

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from types import TracebackType

    from numpy.typing import ArrayLike, NDArray

    from tsis.instrument.gauge import ForceReading, Gauge

    Floats = NDArray[np.float64]


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


_LEAST = 24  # frames, and readings: three per stretch
_STRETCHES = 8
_STEPS = 4  # of the common grid in the shorter interval
_SMOOTHING = 2.0  # in longer intervals
_LEAST_CORRELATION = 0.5
_RIVAL = 0.95  # fraction of the highest correlation that no other delay may have
_LEAST_CHANGE = 10.0  # in standard deviations of the gauge's noise, and in steps of its display
_MOST_STEPS = 400_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """A measured delay.

    Parameters
    ----------
    latency_s
        Delay of the gauge relative to frames, in seconds; an argument of `force_at`.
    sd_s
        Its standard deviation.
    degrees_of_freedom
        Of ``sd_s``.
    correlation
        Of the two rates of change at this delay, at most 1.
    """

    latency_s: float
    sd_s: float
    degrees_of_freedom: int
    correlation: float

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval of Student's t that covers the delay with probability ``level``."""
        require_number("level", level, 1e-6, 1 - 1e-9, hint="a probability")
        half = float(scipy.stats.t.ppf(0.5 + level / 2, self.degrees_of_freedom)) * self.sd_s
        return self.latency_s - half, self.latency_s + half


def find_latency(
    frame_times_s: ArrayLike,
    frame_sums: ArrayLike,
    readings: Sequence[ForceReading],
    *,
    longest_s: float = 0.5,
) -> Latency:
    """Measure the delay of the gauge relative to the frames.

    Press and release several times, unevenly and for different times, while both run; ten seconds are enough.

    Parameters
    ----------
    frame_times_s
        Times of the frames, on the readings' clock, shape (n,), ascending.
    frame_sums
        Sum of grey levels of each frame, or any other monotonic function of the force, shape (n,).
    readings
        Readings over the same time.
    longest_s
        Largest delay in the search, of either sign.

    Raises
    ------
    InputError
        When the arrays differ in length or times do not ascend.
    GaugeError
        When a course is flat, the two are not correlated, the delay is not unique, or it exceeds ``longest_s``.

    Examples
    --------
    >>> from tsis.instrument.gauge import ForceReading
    >>> def course(time_s):
    ...     return 1 - np.cos(2 * np.pi * (0.2 * time_s + 0.02 * time_s**2))
    >>> frames = np.arange(0.0, 12.0, 1 / 30)
    >>> taken = np.arange(0.01, 12.0, 0.05)
    >>> readings = [ForceReading(time_s=t, force_n=course(t - 0.08)) for t in taken]
    >>> round(find_latency(frames, 500 + 3e4 * course(frames), readings).latency_s, 3)
    0.08
    """
    require_number("longest_s", longest_s, 1e-3, 60.0)
    frames = _series("frame", require_array("frame_times_s", frame_times_s, ndim=1), frame_sums)
    forces = _series("reading", [reading.time_s for reading in readings], [reading.force_n for reading in readings])
    step_n = max(reading.resolution_n for reading in readings)
    _refuse_flat("force", *forces, step=step_n, cure="press and release while both run")
    _refuse_flat("sum of grey levels", *frames, step=0.0, cure="let the camera see the press")
    intervals = [float(np.median(np.diff(times))) for times, _ in (frames, forces)]
    smoothing, step = _SMOOTHING * max(intervals), min(intervals) / _STEPS
    origin = frames[0][0]
    lit = _rate(frames, origin, step, smoothing)
    pressed = _rate(forces, origin, step, smoothing)
    first, last = forces[0][0] + longest_s + smoothing, forces[0][-1] - longest_s - smoothing
    selected = (lit[0] >= first - origin) & (lit[0] <= last - origin)
    if step * np.count_nonzero(selected) < 4 * longest_s:
        raise GaugeError(
            f"frames and readings must overlap for more than {6 * longest_s:g} s to find delays up to {longest_s:g} s; "
            "record longer, or lower longest_s"
        )
    return _highest(lit[0][selected], lit[1][selected], pressed, longest_s, step)


def _series(what: str, times: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats]:
    if len(np.atleast_1d(np.asarray(times))) < _LEAST:
        raise GaugeError(f"at least {_LEAST} {what}s are needed to find a delay; got {np.size(times)}")
    checked = require_array(f"{what} times", times, ndim=1), require_array(f"{what} values", values, ndim=1)
    if checked[0].shape != checked[1].shape:
        raise InputError(f"each {what} must have a time and a value; got {checked[0].size} and {checked[1].size}")
    if not (np.diff(checked[0]) > 0).all():
        raise InputError(f"{what} times must ascend; sort them, or select those of one run")
    return checked


def _refuse_flat(what: str, times: Floats, values: Floats, *, step: float, cure: str) -> None:
    # The median of the noise over stretches, so that the bends of a press do not count.
    stretches = max(len(times) // 12, 1)
    pairs = zip(np.array_split(times, stretches), np.array_split(values, stretches), strict=True)
    noise = float(np.median([reading_noise(*stretch)[0] for stretch in pairs]))
    change, needed = float(np.ptp(values)), _LEAST_CHANGE * max(noise, step)
    if change <= needed:
        raise GaugeError(f"the {what} must change by more than {needed:.3g} to find a delay; got {change:.3g}; {cure}")


def _rate(series: tuple[Floats, Floats], origin: float, step: float, smoothing: float) -> tuple[Floats, Floats]:
    """Times from ``origin`` and the smoothed rate of change there."""
    times, values = series[0] - origin, series[1]
    count = int((times[-1] - times[0]) / step) + 1
    if count > _MOST_STEPS:
        raise InputError(
            f"a record must span at most {_MOST_STEPS // _STEPS} of its shorter intervals; got {count // _STEPS}; "
            "give a part of it"
        )
    grid = times[0] + step * np.arange(count)
    level = np.interp(grid, times, values - values.mean())
    return grid, scipy.ndimage.gaussian_filter1d(level, smoothing / step, order=1, mode="nearest") / step


def _highest(times: Floats, lit: Floats, pressed: tuple[Floats, Floats], longest_s: float, step: float) -> Latency:
    extent = int(longest_s / step)
    delays = step * np.arange(-extent, extent + 1, dtype=float)
    starts = len(times) * np.arange(_STRETCHES) // _STRETCHES
    # Sums over each stretch; the sum over all stretches but one is a difference.
    shifted = [np.interp(times + delay, *pressed) for delay in delays]
    sums = np.array([_moments(lit, force, starts) for force in shifted])  # (delay, moment, stretch)
    whole = sums.sum(axis=2)
    without = whole[:, :, None] - sums
    correlation = _correlation(whole)
    sign = float(np.sign(correlation[np.argmax(np.abs(correlation))]))  # grey may fall with force
    best, height = _peak(delays, sign * correlation)
    _refuse_unclear(delays, sign * correlation, best, height, longest_s)
    left_out = [_peak(delays, sign * _correlation(without[:, :, k]))[0] for k in range(_STRETCHES)]
    spread = (_STRETCHES - 1) / _STRETCHES  # of the jackknife's sum of squares
    sd = float(np.sqrt(spread * np.sum((np.array(left_out) - np.mean(left_out)) ** 2)))
    return Latency(latency_s=best, sd_s=sd, degrees_of_freedom=_STRETCHES - 1, correlation=height)


def _moments(lit: Floats, force: Floats, starts: NDArray[np.int_]) -> Floats:
    """Sums of 1, x, y, xx, yy, xy over each stretch, shape (6, stretches)."""
    products = np.stack((np.ones_like(lit), lit, force, lit * lit, force * force, lit * force))
    return np.asarray(np.add.reduceat(products, starts, axis=1))


def _correlation(moments: Floats) -> Floats:
    """Pearson's, from the moments in the second axis."""
    count, x, y, xx, yy, xy = moments.T
    scatter = (xx - x * x / count) * (yy - y * y / count)
    return np.asarray((xy - x * y / count) / np.sqrt(np.maximum(scatter, np.finfo(float).tiny)))


def _peak(delays: Floats, correlation: Floats) -> tuple[float, float]:
    """Vertex of the parabola through the highest value and its neighbours."""
    top = int(np.clip(np.argmax(correlation), 1, len(delays) - 2))
    before, at, after = correlation[top - 1 : top + 2]
    bend = before - 2 * at + after
    shift = 0.0 if bend >= 0 else float(np.clip((before - after) / (2 * bend), -1, 1))
    return float(delays[top] + shift * (delays[1] - delays[0])), float(at - (before - after) * shift / 4)


def _refuse_unclear(delays: Floats, correlation: Floats, best: float, height: float, longest_s: float) -> None:
    if height < _LEAST_CORRELATION:
        raise GaugeError(
            f"force and grey levels must go together, with a correlation of at least {_LEAST_CORRELATION:g} at some "
            f"delay up to {longest_s:g} s; got {height:.2f}; check that both saw the same press"
        )
    if np.argmax(correlation) in (0, len(delays) - 1):
        raise GaugeError(f"the delay must be shorter than {longest_s:g} s; got no peak within; raise longest_s")
    inner = correlation[1:-1]
    peaks = (inner >= correlation[:-2]) & (inner >= correlation[2:])
    rivals = delays[1:-1][peaks & (inner > _RIVAL * height)]
    far = rivals[np.abs(rivals - best) > 2 * (delays[1] - delays[0])]
    if far.size:
        raise GaugeError(
            f"the delay must be unique; {best:.3f} s and {far[0]:.3f} s fit alike because the course repeats itself; "
            "press unevenly, or lower longest_s"
        )
