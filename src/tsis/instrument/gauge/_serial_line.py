"""Lines of a serial port with their arrival times, and the ports of this machine."""

from __future__ import annotations

import errno
import threading
from collections import deque
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from serial.tools import list_ports

from tsis.errors import GaugeError
from tsis.instrument.gauge._replies import LONGEST_REPLY_BYTES

if TYPE_CHECKING:
    from collections.abc import Callable


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
_CAUSES = {
    "FileNotFoundError": errno.ENOENT,
    "PermissionError": errno.EACCES,
}


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
        SerialPort(device=str(item.device), description=str(item.description))
        for item in sorted(ports, key=lambda item: str(item.device))
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
        ports = ", ".join(item.device for item in find_ports()) or "none"
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
        self._first, self._closed, self.heard = True, False, False

    @property
    def closed(self) -> bool:
        """True when no more lines come."""
        return self._closed

    def take(self) -> Line | None:
        """The next line, or None when none was complete within the port's timeout; ``heard`` is True after any byte.

        A line's time is the arrival of its first byte. After a request it is the middle between that and the request,
        with half the time between them as its error.
        """
        if not self._lines:
            with self._lock:
                if not self._closed:
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
        self._closed = True
        with self._lock:
            try:
                self._port.close()
            except PORT_FAILURES:  # a lost port cannot be closed, and need not be
                return

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
