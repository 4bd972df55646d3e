"""Force readings in a CSV file, and the file as a gauge."""

from __future__ import annotations

import csv
import io
import math
import threading
from array import array
from itertools import pairwise
from typing import TYPE_CHECKING

from tsis.errors import FileInputError, GaugeError, InputError
from tsis.files.atomic import write_durably
from tsis.files.reading import as_path, printable_path, read_bytes, text_lines
from tsis.instrument.gauge._gauge import ForceReading

if TYPE_CHECKING:
    import os
    from collections.abc import Iterable, Iterator
    from pathlib import Path


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
    if any(after.time_s <= before.time_s for before, after in pairwise(rows)):
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
    newtons.
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
    lines = text_lines(content, most=MOST_READINGS)
    head = tuple(cell.strip() for cell in next(lines, (1, ""))[1].split(","))
    if head[:_NEEDED] != HEAD[:_NEEDED] or head != HEAD[: len(head)]:
        raise _LineError(f"must begin with the header {','.join(HEAD[:_NEEDED])} (s and N); got {','.join(head)!r:.80}")
    before_s = -math.inf
    for number, line in lines:
        if not line.strip():
            continue
        cells = line.split(",")
        if len(cells) != len(head):
            raise _LineError(f"line {number} must have {len(head)} columns as the header; got {len(cells)}")
        try:
            reading = ForceReading(**{name: float(cell) for name, cell in zip(head, cells, strict=True)})
        except InputError as error:
            raise _LineError(f"line {number}: {error}") from error
        except ValueError as error:
            raise _LineError(f"line {number} must hold numbers; got {line!r:.80}") from error
        if reading.time_s <= before_s:
            raise _LineError(
                f"line {number} must be later than the line before; got {reading.time_s!r} s after {before_s!r} s"
            )
        before_s = reading.time_s
        yield reading
    if before_s == -math.inf:
        raise _LineError("must hold at least one reading; got none")
