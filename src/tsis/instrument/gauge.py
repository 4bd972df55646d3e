"""The protocol of force gauges, and the force at the time of a frame.

`tsis.instrument.serial_gauge` has gauges on a serial line, `tsis.instrument.force_log` a log of their readings.
"""

from __future__ import annotations

import csv
import io
import itertools
import math
import threading
import time
from array import array
from bisect import bisect_right
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import scipy

from tsis.errors import FileInputError, GaugeError, InputError
from tsis.files.atomic import write_durably
from tsis.files.reading import as_path, printable_path, read_bytes, text_lines
from tsis.files.tables import parse_csv_rows, table_text
from tsis.model.require import require_number

if TYPE_CHECKING:
    import os
    from collections.abc import Callable, Iterable, Iterator, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


LARGEST_FORCE_N = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceReading:
    """A force with its time.

    Raises `InputError` when a number is not finite or out of its range.

    Parameters
    ----------
    time_s
        Seconds on the host's monotonic clock.
    force_n
        Force in newtons, with the gauge's sign.
    resolution_n
        Step of the gauge's display in newtons, 0 when unknown.
    time_error_s
        Half-width of the interval in which the gauge took the reading, in seconds; 0 when unknown.

    Examples
    --------
    >>> ForceReading(time_s=12.5, force_n=0.8).force_n
    0.8
    """

    time_s: float
    force_n: float
    resolution_n: float = 0.0
    time_error_s: float = 0.0

    def __post_init__(self) -> None:
        require_number("time_s", self.time_s, -1e12, 1e12)
        require_number("force_n", self.force_n, -LARGEST_FORCE_N, LARGEST_FORCE_N)
        require_number("resolution_n", self.resolution_n, 0.0, LARGEST_FORCE_N)
        require_number("time_error_s", self.time_error_s, 0.0, 1e6)


@runtime_checkable
class Gauge(Protocol):
    """A source of force readings, used in the order open, readings, close."""

    @property
    def name(self) -> str:
        """Display name."""

    @property
    def lost(self) -> bool:
        """True when it stopped answering before it was closed."""

    @property
    def skipped(self) -> int:
        """Number of invalid replies since it was opened."""

    def open(self) -> None:
        """Connect to the gauge; `GaugeError` or `FileInputError` when that fails."""

    def readings(self) -> Iterator[ForceReading]:
        """Yield readings with ascending times until it is closed or its file ends; `GaugeError` when it fails."""

    def tare(self) -> None:
        """Make the present force the zero; `GaugeError` when it has no such command."""

    def close(self) -> None:
        """End the readings and release the gauge; another call does nothing."""


class SimulatedGauge:
    """A gauge that reads a course of force at a steady rate, with gain, zero, noise and steps of its display.

    It shows ``resolution_n * round((gain * force(t) + zero_n - tared + noise) / resolution_n)``. Readings that are not
    fetched in time are skipped, as with a gauge whose display goes on.

    Parameters
    ----------
    force
        True force in newtons at a time of ``clock``.
    rng
        Draws the noise.
    noise_n
        Standard deviation of the noise in newtons.
    resolution_n
        Step of the display in newtons; 0 shows every digit.
    zero_n
        Reading without a load, in newtons, until `tare` is called.
    gain
        Reading at 1 N, in newtons.
    rate_per_s
        Readings a second.
    clock
        Seconds, monotonic.
    wait
        Waits for seconds; by default in real time, interrupted by `close`.

    Examples
    --------
    >>> gauge = SimulatedGauge(lambda time_s: 0.5, rng=np.random.default_rng(0), rate_per_s=1000.0)
    >>> gauge.open()
    >>> reading = next(gauge.readings())
    >>> abs(reading.force_n - 0.5) < 0.01
    True
    """

    def __init__(
        self,
        force: Callable[[float], float],
        *,
        rng: np.random.Generator,
        noise_n: float = 1e-3,
        resolution_n: float = 1e-3,
        zero_n: float = 0.0,
        gain: float = 1.0,
        rate_per_s: float = 20.0,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] | None = None,
    ) -> None:
        self._force, self._rng, self._clock = force, rng, clock
        self._noise_n = require_number("noise_n", noise_n, 0.0, 1e3)
        self._resolution_n = require_number("resolution_n", resolution_n, 0.0, 1e3)
        self._zero_n = require_number("zero_n", zero_n, -1e3, 1e3)
        self._gain = require_number("gain", gain, -1e3, 1e3)
        self._interval_s = 1.0 / require_number("rate_per_s", rate_per_s, 1e-3, 1e5)
        self._closed = threading.Event()
        self._closed.set()
        self._wait = wait or self._closed.wait

    name, lost, skipped = "simulated gauge", False, 0

    def open(self) -> None:
        """Begin anew."""
        self._closed.clear()

    def readings(self) -> Iterator[ForceReading]:
        """Yield a reading each interval of the clock until the gauge is closed."""
        self._require_open()
        due_s = self._clock()
        while not self._closed.is_set():
            late_s = self._clock() - due_s
            if late_s < 0:
                self._wait(-late_s)
                continue
            due_s += self._interval_s * int(late_s / self._interval_s)
            yield ForceReading(time_s=due_s, force_n=self._shown(due_s), resolution_n=self._resolution_n)
            due_s += self._interval_s

    def tare(self) -> None:
        """Make the present display the zero, noise included, as a real gauge does."""
        self._require_open()
        self._zero_n -= self._shown(self._clock())

    def close(self) -> None:
        """End the readings."""
        self._closed.set()

    def _require_open(self) -> None:
        if self._closed.is_set():
            raise GaugeError(f"the {self.name} must be opened first; call open()")

    def _shown(self, time_s: float) -> float:
        force_n = self._gain * self._force(time_s) + self._zero_n + self._noise_n * float(self._rng.standard_normal())
        return self._resolution_n * round(force_n / self._resolution_n) if self._resolution_n else force_n


LARGEST_BYTES, MOST_READINGS = 160 * 2**20, 4_000_000  # more than an hour at 1 kHz; a line takes about 40 bytes
HEAD = ("time_s", "force_n", "resolution_n", "time_error_s")
_NEEDED = 2  # columns required of a file from elsewhere


def write_readings(path: str | os.PathLike[str], readings: Iterable[ForceReading]) -> Path:
    """Write readings as CSV with the columns time_s, force_n, resolution_n, time_error_s, without rounding.

    Times of the host's monotonic clock restart with the machine: they align with frames of the same run, not with a
    date. Raises `InputError` when there are none or too many to read back, or their times do not ascend;
    `FileInputError` when the file exists or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = write_readings(Path(folder) / "force.csv", [ForceReading(time_s=1.5, force_n=0.25)])
    ...     path.read_text().splitlines()
    ['time_s,force_n,resolution_n,time_error_s', '1.5,0.25,0.0,0.0']
    """
    file, rows = as_path(path), list(readings)
    cure = "write parts of a long run as files of their own"
    if not 0 < len(rows) <= MOST_READINGS:
        number = len(rows) or "none"
        raise InputError(f"readings must be 1 to {MOST_READINGS}, so that they can be read back; got {number} ({cure})")
    if any(after.time_s <= before.time_s for before, after in itertools.pairwise(rows)):
        raise InputError("readings must have ascending times; sort them, or select those of one run")
    if file.exists():
        raise FileInputError(f"{printable_path(file)} exists and is not overwritten; choose another name")
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEAD)
    writer.writerows([float(getattr(row, name)) for name in HEAD] for row in rows)
    content = text.getvalue().encode()
    if len(content) > LARGEST_BYTES:
        raise InputError(
            f"readings must take at most {LARGEST_BYTES} bytes, so that they can be read back; got {len(content)} "
            f"({cure})"
        )
    try:
        write_durably(file, content)
    except OSError as error:
        raise FileInputError(f"{printable_path(file)} must be writable; got: {error.strerror}") from error
    return file


class RecordedGauge:
    """A file of readings behind the gauge protocol, without delays.

    ``path`` is CSV with the header ``time_s,force_n``, optionally with ``resolution_n`` and ``time_error_s``: seconds,
    newtons; or a table of another program whose headings name time and force with their units, as
    `tsis.files.tables.parse_csv_rows` reads it.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._path = as_path(path)
        self._numbers = array("d")  # compact: an hour of objects would take a gigabyte
        self._running = threading.Event()

    @property
    def name(self) -> str:
        """The file's name."""
        return self._path.name

    lost, skipped = False, 0  # an incomplete file or one with invalid lines is refused

    def open(self) -> None:
        """Read the file; `FileInputError` when it is missing, or a line is not finite numbers with ascending times."""
        content = read_bytes(self._path, most=LARGEST_BYTES)
        try:
            self._numbers = array("d", (getattr(row, name) for row in _parsed(content) for name in HEAD))
        except _LineError as error:
            raise FileInputError(f"{printable_path(self._path)} {error}") from error
        except FileInputError as error:
            raise FileInputError(f"{printable_path(self._path)} must be CSV text: {error}") from error
        self._running.set()

    def readings(self) -> Iterator[ForceReading]:
        """Yield the file's readings until its end, or until it is closed."""
        if not self._running.is_set():
            raise GaugeError(f"{printable_path(self._path)} must be opened first; call open()")
        for start in range(0, len(self._numbers), len(HEAD)):
            if not self._running.is_set():
                return
            yield ForceReading(**dict(zip(HEAD, self._numbers[start : start + len(HEAD)], strict=True)))

    def tare(self) -> None:
        """Refuse: the zero of stored readings is fixed."""
        raise GaugeError(f"{printable_path(self._path)} holds stored readings, whose zero cannot be set")

    def close(self) -> None:
        """End the readings."""
        self._running.clear()


class _LineError(Exception):
    """What is wrong with the content of a file, as the end of a message."""


def _parsed(content: bytes) -> Iterator[ForceReading]:
    first = content[:200].split(b"\n", 1)[0].removeprefix(b"\xef\xbb\xbf").decode("latin-1")
    head = tuple(cell.strip() for cell in first.split(","))
    own = head[:_NEEDED] == HEAD[:_NEEDED] and head == HEAD[: len(head)]
    before_s = -math.inf
    for number, reading in _own_lines(content, head) if own else _lines_of_others(content, first):
        if reading.time_s <= before_s:
            raise _LineError(
                f"line {number} must be later than the line before; got {reading.time_s!r} s after {before_s!r} s"
            )
        before_s = reading.time_s
        yield reading
    if before_s == -math.inf:
        raise _LineError("must hold at least one reading; got none")


def _own_lines(content: bytes, head: tuple[str, ...]) -> Iterator[tuple[int, ForceReading]]:
    """Readings of a file in the form of `write_readings`, with the numbers of their lines."""
    for number, line in itertools.islice(text_lines(content, most=MOST_READINGS), 1, None):
        if not line.strip():
            continue
        cells = line.split(",")
        if len(cells) != len(head):
            raise _LineError(f"line {number} must have {len(head)} columns as the header; got {len(cells)}")
        try:
            yield number, ForceReading(**{name: float(cell) for name, cell in zip(head, cells, strict=True)})
        except InputError as error:
            raise _LineError(f"line {number}: {error}") from error
        except ValueError as error:
            raise _LineError(f"line {number} must hold numbers; got {line!r:.80}") from error


def _lines_of_others(content: bytes, first: str) -> Iterator[tuple[int, ForceReading]]:
    """Readings of a table of another program, by the names and units of its columns."""
    table_text(content, "it")
    rows = parse_csv_rows(content, "it", HEAD[:_NEEDED], HEAD[_NEEDED:], ignore_others=True, most_rows=MOST_READINGS)
    try:
        for row in rows:
            number = int(row.where.rpartition(" ")[2])
            values = {name: value for name in HEAD if (value := row.number(name)) is not None}
            if not set(HEAD[:_NEEDED]) <= set(values):
                raise _LineError(f"line {number} must hold a time and a force; got an empty cell")
            try:
                yield number, ForceReading(**values)
            except InputError as error:
                raise _LineError(f"line {number}: {error}") from error
    except FileInputError as error:
        raise _LineError(
            f"must begin with the header {','.join(HEAD[:_NEEDED])} (s and N), or name both with their units, as time "
            f"(s) and force (mN); got {first.strip()!r:.80}: {error}"
        ) from error


_SPAN = 4  # successive readings: one more than the three parameters of a parabola


def reading_noise(times: Floats, forces: Floats) -> tuple[float, float]:
    """Standard deviation of independent noise in readings of a smooth course, and its degrees of freedom.

    One combination of any four successive readings vanishes for every parabola; scaled to length 1 it has the noise's
    standard deviation. Combinations with common readings are correlated, so the degrees of freedom are Satterthwaite's
    for their quadratic form, fewer than the combinations. A course that bends within four readings counts as noise.

    Examples
    --------
    >>> times = np.arange(12.0)
    >>> reading_noise(times, 3 * times**2)[0] < 1e-9
    True
    """
    count = len(times) - _SPAN + 1
    rows = np.arange(count)[:, None] + np.arange(_SPAN)
    difference = times[rows][:, :, None] - times[rows][:, None, :]
    difference[:, np.arange(_SPAN), np.arange(_SPAN)] = 1.0
    # The third divided difference, the sum of f(t_i) / prod(t_i - t_j) over j != i, vanishes for every parabola.
    weights = 1.0 / difference.prod(axis=2)
    weights /= np.linalg.norm(weights, axis=1, keepdims=True)
    combinations = np.zeros((count, len(times)))
    np.put_along_axis(combinations, rows, weights, axis=1)
    # Satterthwaite: f = (trace G)^2 / trace G^2 of the Gram matrix G, whose diagonal is 1.
    gram = combinations @ combinations.T
    freedom = count**2 / float(np.sum(gram**2))
    return float(np.sqrt(np.mean((combinations @ forces) ** 2))), freedom


LONGEST_GAP_S = 0.5
LEVEL = 0.95  # probability that the true force lies within error_n
_NEIGHBOURS = 8  # readings for the noise
_LEAST = 4  # readings: a line, its curvature, and one for the noise
# Parabolas smooth the curvature that they measure: for nine readings a period it is up to 1.098 times as large.
_SMOOTHED = 1.1


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceAtTime:
    """The force at a time.

    Parameters
    ----------
    force_n
        In newtons.
    error_n
        Bound of the error relative to the gauge's display without noise, with at least 95 % probability. It excludes
        the gauge's own calibration.
    gap_s
        Time between the two readings around it.
    """

    force_n: float
    error_n: float
    gap_s: float


def force_at(
    readings: Sequence[ForceReading],
    time_s: float,
    *,
    latency_s: float = 0.0,
    time_error_s: float = 0.0,
    longest_gap_s: float = LONGEST_GAP_S,
) -> ForceAtTime:
    """Interpolate the force at a frame's time linearly.

    Parameters
    ----------
    readings
        At least 4 with ascending times.
    time_s
        Time of the frame, on the same clock.
    latency_s
        Delay of the gauge relative to frames: the force is interpolated at ``time_s + latency_s``; `find_latency`
        measures it.
    time_error_s
        Half-width of the uncertainty of ``time_s + latency_s``.
    longest_gap_s
        Longest interval of interpolation.

    Raises
    ------
    InputError
        When an argument is out of its range or the times do not ascend.
    GaugeError
        When there are fewer than 4 readings, the time lies before the first or more than one interval after the
        last one, or in a gap that is too long.

    Examples
    --------
    >>> readings = [ForceReading(time_s=0.1 * k, force_n=0.01 * k**2, resolution_n=0.001) for k in range(12)]
    >>> force = force_at(readings, 0.55)
    >>> round(force.force_n, 4), round(force.error_n, 4), round(force.gap_s, 3)
    (0.305, 0.0033, 0.1)

    The true course at 0.55 s is 0.3025 N.
    """
    at_s = require_number("time_s", time_s, -1e12, 1e12) + require_number("latency_s", latency_s, -1e3, 1e3)
    require_number("time_error_s", time_error_s, 0.0, 1e3)
    require_number("longest_gap_s", longest_gap_s, 1e-6, 1e6)
    right = _right(readings, at_s)
    around = readings[max(right - _NEIGHBOURS, 0) : right + _NEIGHBOURS]
    right -= max(right - _NEIGHBOURS, 0)
    times = np.array([reading.time_s for reading in around]) - at_s
    forces = np.array([reading.force_n for reading in around])
    if not (np.diff(times) > 0).all():
        raise InputError("readings must have ascending times; sort them, or select those of one run")
    gap = float(times[right] - times[right - 1])
    if max(gap, -float(times[right])) > longest_gap_s:
        raise GaugeError(
            f"the force readings around {at_s:.3f} s must lie at most {longest_gap_s:g} s apart; got {gap:.3g} s; "
            "raise the gauge's rate, or state a longer longest_gap_s"
        )
    weight = float(-times[right - 1] / gap)
    pair = around[right - 1 : right + 1]
    slope = float(forces[right] - forces[right - 1]) / gap
    curvature = _curvature(times, forces, right)
    sd, freedom = reading_noise(times, forces)
    time_error = time_error_s + max(reading.time_error_s for reading in pair)
    # Remainder of the linear interpolation, half a step of the display, error of the time, and noise of both readings.
    error = (
        curvature * abs(float(times[right - 1] * times[right])) / 2
        + max(reading.resolution_n for reading in pair) / 2
        + (abs(slope) + curvature * gap / 2) * time_error
        + float(scipy.special.stdtrit(freedom, 0.5 + LEVEL / 2)) * sd * float(np.hypot(weight, 1 - weight))
    )
    force = float(forces[right - 1]) + slope * float(-times[right - 1])
    return ForceAtTime(force_n=force, error_n=error, gap_s=gap)


def _right(readings: Sequence[ForceReading], at_s: float) -> int:
    """Index of the reading after the time, or of the last one up to an interval before the time."""
    if len(readings) < _LEAST:
        raise GaugeError(f"at least {_LEAST} force readings are needed around a frame; got {len(readings)}")
    first_s, before_s, last_s = readings[0].time_s, readings[-2].time_s, readings[-1].time_s
    if at_s < first_s:
        raise GaugeError(f"the frame lies {first_s - at_s:.3g} s before the first force reading; start the gauge first")
    if at_s > 2 * last_s - before_s:
        raise GaugeError(
            f"the frame lies {at_s - last_s:.3g} s after the last force reading, more than one interval of "
            f"{last_s - before_s:.3g} s; wait for the gauge, or see whether it was lost"
        )
    return min(bisect_right(readings, at_s, key=lambda reading: reading.time_s), len(readings) - 1)


def _curvature(times: Floats, forces: Floats, right: int) -> float:
    """Bound of the course's second derivative between two readings."""
    slopes = np.diff(forces) / np.diff(times)
    second = 2 * np.diff(slopes) / (times[2:] - times[:-2])
    touching = second[max(right - 2, 0) : right]
    if len(touching) == 2:
        return _SMOOTHED * float(np.abs(touching).max())
    # At an end there is only one parabola; its curvature may continue to change at the same rate.
    inner = second[1] if right == 1 else second[-2]
    return _SMOOTHED * float(abs(touching[0]) + abs(touching[0] - inner))
