"""An open serial port as lines with the times at which the gauge took what they say."""

from __future__ import annotations

import threading
from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tsis.instrument.gauge.line_buffer import Line, LineBuffer
from tsis.instrument.gauge.serial_port import PORT_FAILURES

if TYPE_CHECKING:
    from collections.abc import Callable

_LARGEST_CHUNK = 4096


class SerialLine:
    """Asks, listens and cuts what comes into lines; one thread reads, any may write or close.

    Parameters
    ----------
    port
        An open port like ``serial.Serial`` whose reads end within a short timeout.
    poll
        What asks for one line; None where they come without being asked for.
    clock
        Seconds, monotonic.
    """

    def __init__(self, port: Any, *, poll: bytes | None, clock: Callable[[], float]) -> None:
        self._port, self._poll, self._clock = port, poll, clock
        self._buffer, self._lines = LineBuffer(), deque[Line]()
        self._asked_s: float | None = None
        self._looked_s = clock()
        self._lock = threading.Lock()  # a port is not closed while a thread reads from it
        self._first, self._closed, self.heard = True, False, False

    @property
    def closed(self) -> bool:
        """True when no more lines come."""
        return self._closed

    def take(self) -> Line | None:
        """The next line, or None when none was complete within the port's timeout; ``heard`` tells whether bytes came.

        A line's time is when its first byte came. After a question it is the middle between that and the question,
        with half the time between them as its error: the gauge answered somewhere in between.
        """
        if not self._lines:
            with self._lock:
                if not self._closed:
                    self._exchange()
        if not self._lines:
            return None
        line = self._lines.popleft()
        asked_s, self._asked_s = self._asked_s, None
        first, self._first = self._first, False
        return self.take() if first and not line.whole else _answered(line, asked_s)

    def write(self, command: bytes) -> None:
        """Send bytes."""
        self._port.write(command)

    def close(self) -> None:
        """Let go of the port."""
        self._closed = True
        with self._lock:
            try:
                self._port.close()
            except PORT_FAILURES:  # a port that is gone cannot be closed, and need not be
                return

    def _exchange(self) -> None:
        waiting = min(self._port.in_waiting, _LARGEST_CHUNK)
        # While something still comes a question would have its answer queue behind that, and be older than it looks.
        if self._poll is not None and self._asked_s is None and not waiting and not self._buffer.held:
            self._asked_s = self._clock()
            self._port.write(self._poll)
        chunk = self._port.read(waiting or 1)
        now_s = self._clock()
        # Bytes that already waited came since the last look; a byte that was waited for came now.
        since_s = self._looked_s if waiting else now_s
        self._looked_s = now_s
        self.heard = self.heard or bool(chunk)
        self._lines.extend(self._buffer.feed(chunk, since_s=since_s, now_s=now_s))


def _answered(line: Line, asked_s: float | None) -> Line:
    latest_s = line.time_s + line.time_error_s
    if asked_s is None or latest_s < asked_s:
        return line
    return replace(line, time_s=(asked_s + latest_s) / 2, time_error_s=(latest_s - asked_s) / 2)
