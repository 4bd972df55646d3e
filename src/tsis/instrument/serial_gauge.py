"""Force gauges with ASCII replies on a serial line.

A reply is a sign, a number and perhaps a unit: ``-0.123 N``, ``+1.20``, ``  18.78 lbF``, ``R+012.34``, ``@253.4 N``.
Each line has the time of its arrival, so that the force at the time of a camera frame can be told.
"""

from __future__ import annotations

import errno
import math
import re
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import TYPE_CHECKING, Any

import serial
from serial.tools import list_ports

from tsis.errors import GaugeError, InputError
from tsis.files.tables import UNITS
from tsis.instrument.camera import AwakeClock
from tsis.instrument.gauge import LARGEST_FORCE_N, ForceReading
from tsis.model.require import require_integer, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator


NEWTONS = {unit: UNITS["force"][unit] for unit in ("N", "mN", "kN", "cN", "daN", "µN", "gf", "kgf", "lbf", "ozf")}
LONGEST_REPLY_BYTES = 64

# Gauges differ in capitals (lbF, KGF); only a capital M would change the meaning, and no gauge reads meganewtons.
_BY_LOWER_CASE = {unit.lower(): unit for unit in NEWTONS} | {"un": "µN"}
# Some gauges put R (a reading) or @ before the number; micro comes in UTF-8, as either letter, or in Latin 1.
_NUMBER = re.compile(rb"(?:[Rr@] *)?([+-]?) *(\d{0,9})(?:\.(\d{0,9}))? *((?:\xc2\xb5|\xce\xbc|\xb5)[Nn]|[A-Za-z]*)")
_OVERLOAD = re.compile(rb"[+-]? *(?:O\.?L|OVER(?:LOAD| LOAD)?|HELP|-{2,})(?: *[A-Za-z]{1,3})?", re.IGNORECASE)
_FAULT = re.compile(rb"x{3,}|\*\d\d|ERR.*", re.IGNORECASE)


class ReplyKind(Enum):
    """Kind of a gauge's line."""

    NUMBER = auto()
    OVERLOAD = auto()  # more force than the gauge can measure
    FAULT = auto()  # the gauge reports an error of its own
    GARBAGE = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """A parsed line of a gauge; only a number has the further fields."""

    kind: ReplyKind
    number: float = 0.0  # in the gauge's unit
    step: float = 0.0  # value of its last digit
    unit: str = ""  # one of `NEWTONS`; empty when the gauge did not send one


def read_reply(line: bytes) -> Reply:
    """Parse a line without its end; it never raises.

    Examples
    --------
    >>> read_reply(b" -18.78 lbF")
    Reply(kind=<ReplyKind.NUMBER: 1>, number=-18.78, step=0.01, unit='lbf')
    >>> read_reply(b"OL").kind, read_reply(b"0.12 N.m").kind
    (<ReplyKind.OVERLOAD: 2>, <ReplyKind.GARBAGE: 4>)
    """
    text = line.strip()
    if len(text) > LONGEST_REPLY_BYTES:
        return Reply(kind=ReplyKind.GARBAGE)
    if _OVERLOAD.fullmatch(text):
        return Reply(kind=ReplyKind.OVERLOAD)
    if _FAULT.fullmatch(text):
        return Reply(kind=ReplyKind.FAULT)
    return _number(text) or Reply(kind=ReplyKind.GARBAGE)


def _number(text: bytes) -> Reply | None:
    match = _NUMBER.fullmatch(text)
    if match is None:
        return None
    *numbers, spelled = match.groups(b"")
    sign, whole, fraction = (part.decode() for part in numbers)
    letters = spelled.decode() if spelled.isascii() else "µN"
    unit = _unit(letters)
    if not whole + fraction or unit is None:
        return None
    return Reply(
        kind=ReplyKind.NUMBER,
        number=float(f"{sign}{whole or 0}.{fraction or 0}"),
        step=float(f"1e-{len(fraction)}"),
        unit=unit,
    )


def _unit(letters: str) -> str | None:
    """The unit of that spelling, empty without one, None for any other unit."""
    if letters.startswith("M"):
        return None
    return _BY_LOWER_CASE.get(letters.lower()) if letters else ""


def force_unit(unit: str) -> str:
    """The unit of that spelling; `InputError` when it is not one of the forces in `NEWTONS`."""
    name = _unit(unit) if isinstance(unit, str) else None
    if not name:
        raise InputError(f"unit must be one of {', '.join(NEWTONS)}; got {unit!r:.40}")
    return name


def newtons(reply: Reply, *, unit: str | None) -> tuple[float, float]:
    """Force and step of the display in newtons, with the required unit of replies, None before one is known.

    Raises `GaugeError` when the reply is no number, has another unit, or the unit is unknown.

    Examples
    --------
    >>> newtons(read_reply(b"+250 mN"), unit="mN")
    (0.25, 0.001)
    """
    if reply.kind is ReplyKind.OVERLOAD:
        raise GaugeError("it reports an overload; take the load off, check its zero, and start the readings again")
    if reply.kind is ReplyKind.FAULT:
        raise GaugeError("it reports a fault of its own; look at its display and its manual")
    if reply.kind is ReplyKind.GARBAGE:
        raise GaugeError("it sent something that is no reading")
    if not reply.unit and unit is None:
        raise GaugeError("it sends numbers without a unit; state the unit that its display shows, e.g. unit='N'")
    if unit is not None and reply.unit not in ("", unit):
        raise GaugeError(
            f"its replies must be in {unit}; got one in {reply.unit}; set the gauge, or state unit={reply.unit!r}"
        )
    scale = NEWTONS[reply.unit or str(unit)]
    return reply.number * scale, reply.step * scale


_ENDS = b"\r\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line from the port."""

    content: bytes  # without the end, at most `LONGEST_REPLY_BYTES`
    time_s: float  # arrival of its first byte
    time_error_s: float  # bound of the error of that time
    whole: bool = True  # False without its beginning or its end


class LineBuffer:
    r"""Collects bytes until a line is complete; never more than `LONGEST_REPLY_BYTES`.

    The first line is never whole: the port may open in the middle of it, and the end of ``-0.123 N`` is a number too.

    Examples
    --------
    >>> lines = LineBuffer()
    >>> [(line.content, line.whole) for line in lines.feed(b"23 N\r\n0.12", since_s=1.0, now_s=1.0)]
    [(b'23 N', False)]
    >>> [(line.content, line.whole) for line in lines.feed(b"5 N\r\n", since_s=1.0, now_s=1.1)]
    [(b'0.125 N', True)]
    """

    def __init__(self) -> None:
        self._content = bytearray()
        self._cut = True
        self._began: tuple[float, float] | None = None

    @property
    def pending(self) -> int:
        """Number of bytes of an unfinished line."""
        return len(self._content)

    def feed(self, chunk: bytes, *, since_s: float, now_s: float) -> list[Line]:
        """Take bytes that arrived evenly between two times; return the lines that they complete."""
        lines = []
        for index, byte in enumerate(chunk):
            if byte in _ENDS:
                if self._began is not None:
                    lines.append(self._line(whole=not self._cut))
                self._cut = False
                continue
            if self._began is None:
                self._began = _arrival_time(index / len(chunk), since_s, now_s)
            if len(self._content) == LONGEST_REPLY_BYTES:
                lines.append(self._line(whole=False))
                self._cut = True
                self._began = _arrival_time(index / len(chunk), since_s, now_s)
            self._content.append(byte)
        return lines

    def _line(self, *, whole: bool) -> Line:
        time_s, error_s = self._began or (0.0, 0.0)
        line = Line(content=bytes(self._content), time_s=time_s, time_error_s=error_s, whole=whole)
        self._content.clear()
        self._began = None
        return line


def _arrival_time(fraction: float, since_s: float, now_s: float) -> tuple[float, float]:
    time_s = since_s + fraction * (now_s - since_s)
    return time_s, max(time_s - since_s, now_s - time_s)


# Exceptions of a driver when a port is lost or closed by another thread; termios' error is not an OSError.
PORT_FAILURES: tuple[type[Exception], ...] = (OSError, ValueError, TypeError)
with suppress(ImportError):  # on Windows
    import termios

    PORT_FAILURES += (termios.error,)

# Errors of Windows' ports have no number: the name of the error is in the text.
_CAUSES = {"FileNotFoundError": errno.ENOENT, "PermissionError": errno.EACCES}


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialPort:
    """A serial port of this machine: its name, as ``"/dev/ttyUSB0"`` or ``"COM3"``, and the system's description."""

    device: str
    description: str


def find_ports() -> tuple[SerialPort, ...]:
    """The serial ports of this machine, by name; `GaugeError` when the system does not list them.

    Examples
    --------
    >>> all(port.device for port in find_ports())
    True
    """
    try:
        ports = list_ports.comports()
    except PORT_FAILURES as error:
        raise GaugeError(f"the serial ports of this machine cannot be listed; got: {error!s:.120}") from error
    return tuple(
        SerialPort(device=str(port.device), description=str(port.description))
        for port in sorted(ports, key=lambda port: str(port.device))
    )


def opened(port: str, open_port: Callable[..., Any], **settings: Any) -> Any:
    """Open the port for this program exclusively.

    Raises `GaugeError` when there is no such port, another program uses it, or this user has no permission.
    """
    try:
        return open_port(port, exclusive=True, **settings)
    except PORT_FAILURES as error:
        raise GaugeError(_refusal(port, error)) from error


def _refusal(port: str, error: Exception) -> str:
    number = getattr(error, "errno", None)
    number = number or next((code for name, code in _CAUSES.items() if name in str(error)), None)
    shown = f"{port!r:.120}"
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        ports = ", ".join(found.device for found in find_ports()) or "none"
        return f"no serial port is called {shown}; check the cable and the name (found: {ports})"
    if number in (errno.EBUSY, errno.EAGAIN):
        return f"serial port {shown} is in use by another program; close that one"
    if number in (errno.EACCES, errno.EPERM):
        return (
            f"serial port {shown} must be open to you; close other programs that use it, or on Linux have "
            "yourself added to its group (often dialout) and log in again"
        )
    return f"{shown} cannot be opened as a serial port; got: {error!s:.120}"


_LARGEST_CHUNK = 4096


class SerialLine:
    """Sends requests and splits the replies into lines; one thread reads, any may write or close.

    The reads of the open port end within a short timeout. ``poll`` requests one line; None where lines come without
    requests.
    """

    def __init__(self, port: Any, *, poll: bytes | None, clock: Callable[[], float]) -> None:
        self._port, self._poll, self._clock = port, poll, clock
        self._buffer, self._lines = LineBuffer(), deque[Line]()
        self._requested_s: float | None = None
        self._checked_s = clock()
        self._lock = threading.Lock()  # a port is not closed while a thread reads from it
        self._first = True
        self.closed = False  # True when no more lines come
        self.heard = False  # True after any byte

    def take(self) -> Line | None:
        """The next line, or None when none was complete within the port's timeout.

        A line's time is the arrival of its first byte. After a request it is the middle between that and the request,
        with half the time between them as its error.
        """
        if not self._lines:
            with self._lock:
                if not self.closed:
                    self._exchange()
        if not self._lines:
            return None
        line = self._lines.popleft()
        requested_s, self._requested_s = self._requested_s, None
        first, self._first = self._first, False
        return self.take() if first and not line.whole else _with_request_time(line, requested_s)

    def write(self, command: bytes) -> None:
        """Send bytes."""
        self._port.write(command)

    def close(self) -> None:
        """Release the port."""
        self.closed = True
        with self._lock, suppress(*PORT_FAILURES):  # a lost port cannot be closed, and need not be
            self._port.close()

    def _exchange(self) -> None:
        waiting = min(self._port.in_waiting, _LARGEST_CHUNK)
        # A request during an arrival would be answered late, and its reply be older than it looks.
        if self._poll is not None and self._requested_s is None and not waiting and not self._buffer.pending:
            self._requested_s = self._clock()
            self._port.write(self._poll)
        chunk = self._port.read(waiting or 1)
        now_s = self._clock()
        # Bytes already waiting came since the last check; a byte that was waited for came now.
        since_s = self._checked_s if waiting else now_s
        self._checked_s = now_s
        self.heard = self.heard or bool(chunk)
        self._lines.extend(self._buffer.feed(chunk, since_s=since_s, now_s=now_s))


def _with_request_time(line: Line, requested_s: float | None) -> Line:
    latest_s = line.time_s + line.time_error_s
    if requested_s is None or latest_s < requested_s:
        return line
    return replace(line, time_s=(requested_s + latest_s) / 2, time_error_s=(latest_s - requested_s) / 2)


MOST_SKIPPED_IN_A_ROW = 20
_SLICE_S = 0.05  # length of one wait for bytes, so the delay of `close`


class SerialGauge:
    r"""A force gauge on a serial line: 8 data bits, no parity, 1 stop bit.

    A reading's time is the middle of the interval in which the gauge took it: between the request and the first byte
    of the reply. Without requests it is the arrival of that byte.

    Parameters
    ----------
    port
        Name of the port, as ``"/dev/ttyUSB0"`` or ``"COM3"``; see `find_ports`.
    baud
        Speed of the gauge, in bits per second.
    unit
        Required unit of its replies: N, mN, kN, gf, kgf, lbf or ozf. None takes the unit of its first reply, and
        refuses a gauge that sends none. After a reply with a unit, one without is skipped: it was cut short.
    poll
        Request of one reading; None for a gauge that sends on its own.
    tare_command
        Command that sets the zero: ``b"\x05"`` for Mecmesin, ``b"Z\r"`` for Mark-10; None without one.
    timeout_s
        Longest time without a reading, in seconds.
    open_port
        Opens a port like ``serial.Serial``.
    clock
        Seconds, monotonic.

    Raises `InputError` when a parameter is out of its range.

    Examples
    --------
    >>> SerialGauge("/dev/ttyUSB0", unit="N").name
    'gauge at /dev/ttyUSB0'
    """

    def __init__(
        self,
        port: str,
        *,
        baud: int = 9600,
        unit: str | None = None,
        poll: bytes | None = b"?\r",
        tare_command: bytes | None = b"\x05",
        timeout_s: float = 1.0,
        open_port: Callable[..., Any] = serial.Serial,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        require_type("port", port, str)
        if not port:
            raise InputError(name="port", requirement="must be the name of a serial port", value="an empty one")
        self._name, self._baud = port, require_integer("baud", baud, 50, 4_000_000, hint="bits per second")
        self._stated_unit = None if unit is None else force_unit(unit)
        self._poll, self._tare_command = _command("poll", poll), _command("tare_command", tare_command)
        self._timeout_s = require_number("timeout_s", timeout_s, 0.01, 3600.0)
        self._open_port, self._clock = open_port, clock
        self._line: SerialLine | None = None
        self._lost, self._skipped = False, 0

    @property
    def name(self) -> str:
        """Display name."""
        return f"gauge at {self._name}"

    @property
    def lost(self) -> bool:
        """True when it stopped answering before it was closed."""
        return self._lost

    @property
    def skipped(self) -> int:
        """Number of invalid lines since it was opened."""
        return self._skipped

    def open(self) -> None:
        """Open the port; older bytes are dropped. Raises as `opened`."""
        self.close()
        port = opened(
            self._name,
            self._open_port,
            baudrate=self._baud,
            timeout=min(_SLICE_S, self._timeout_s),
            write_timeout=self._timeout_s,
        )
        self._unit, self._last_s, self._sends_unit = self._stated_unit, -math.inf, False
        self._lost, self._skipped, self._in_a_row = False, 0, 0
        self._line = SerialLine(port, poll=self._poll, clock=self._clock)

    def readings(self) -> Iterator[ForceReading]:
        """Yield readings until the gauge is closed.

        Raises `GaugeError` when it is silent or unplugged, sends garbage, reports an overload or a fault, or its unit
        differs or changes.
        """
        serial_line = self._opened()
        while not serial_line.closed:
            reading = self._next(serial_line)
            if reading is not None:
                yield reading

    def tare(self) -> None:
        """Command the gauge to set its zero, without confirmation; `GaugeError` when it cannot or was lost."""
        if self._tare_command is None:
            raise GaugeError(f"{self.name} has no command that sets its zero; press its zero key")
        serial_line = self._opened()
        try:
            serial_line.write(self._tare_command)
        except PORT_FAILURES as error:
            raise self._unplugged(error) from error

    def close(self) -> None:
        """End the readings and release the port."""
        serial_line, self._line = self._line, None
        if serial_line is not None:
            serial_line.close()

    def _opened(self) -> SerialLine:
        serial_line = self._line
        if serial_line is None:
            raise GaugeError(f"{self.name} must be opened first; call open()")
        return serial_line

    def _next(self, serial_line: SerialLine) -> ForceReading | None:
        """The next reading within the timeout; None when the gauge was closed meanwhile."""
        serial_line.heard, self._in_a_row = False, 0
        awake = AwakeClock(self._clock)
        deadline_s = awake() + self._timeout_s
        while not serial_line.closed:
            try:
                line = serial_line.take()
            except PORT_FAILURES as error:
                raise self._unplugged(error) from error
            reading = self._reading(line) if line is not None else None
            if reading is not None:
                return reading
            if awake() >= deadline_s:
                raise self._silent(heard=serial_line.heard)
        return None

    def _reading(self, line: Line) -> ForceReading | None:
        reply = read_reply(line.content) if line.whole else Reply(kind=ReplyKind.GARBAGE)
        # After a reply with a unit, one without is incomplete: "0.8" may begin "0.812 N" or "0.8 mN".
        cut = reply.kind is ReplyKind.NUMBER and not reply.unit and self._sends_unit
        if reply.kind is ReplyKind.GARBAGE or cut:
            self._skip(line)
            return None
        try:
            force_n, resolution_n = newtons(reply, unit=self._unit)
        except GaugeError as error:
            raise GaugeError(f"{self.name} gives no force: {error}") from error
        self._unit = self._unit or reply.unit
        self._sends_unit = self._sends_unit or bool(reply.unit)
        if abs(force_n) > LARGEST_FORCE_N:
            self._skip(line)
            return None
        # Times must ascend, even if the clock is coarser than the readings.
        self._last_s = max(line.time_s, math.nextafter(self._last_s, math.inf))
        return ForceReading(
            time_s=self._last_s, force_n=force_n, resolution_n=resolution_n, time_error_s=line.time_error_s
        )

    def _skip(self, line: Line) -> None:
        self._skipped += 1
        self._in_a_row += 1
        if self._in_a_row >= MOST_SKIPPED_IN_A_ROW:
            raise GaugeError(
                f"{self.name} sent {self._in_a_row} lines in a row that are no force, the last {line.content!r:.60}; "
                f"set it to {self._baud} baud or state its own, and to a live reading in a unit of force"
            )

    def _silent(self, *, heard: bool) -> GaugeError:
        if heard:
            return GaugeError(
                f"{self.name} sent bytes but no reading within {self._timeout_s:g} s; set it to {self._baud} baud or "
                "state its own, and to a live reading in a unit of force"
            )
        self._lost = True
        cure = "sends on its own" if self._poll is None else f"answers {self._poll!r:.20}"
        return GaugeError(
            f"{self.name} was silent for {self._timeout_s:g} s at {self._baud} baud; check that it is switched on, "
            f"its cable, its baud rate, and that it {cure}"
        )

    def _unplugged(self, error: Exception) -> GaugeError:
        self._lost = True
        self.close()
        return GaugeError(f"{self.name} was lost; plug it in and open it again (the port says: {error!s:.120})")


def _command(name: str, value: bytes | None) -> bytes | None:
    if value is not None and not (isinstance(value, bytes) and 0 < len(value) <= 64):
        raise InputError(f"{name} must be 1 to 64 bytes, or None; got {value!r:.80}")
    return value
