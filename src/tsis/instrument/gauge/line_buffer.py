"""Lines out of the bytes of a serial line, with when each began to arrive."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.instrument.gauge.ascii_reply import LONGEST_REPLY_BYTES

_ENDS = b"\r\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One line that came.

    Parameters
    ----------
    content
        Its bytes without the end, at most `LONGEST_REPLY_BYTES`.
    time_s, time_error_s
        When its first byte came, and how far from that it may truly lie.
    whole
        False for what was cut: a line whose beginning or whose end nobody saw.
    """

    content: bytes
    time_s: float
    time_error_s: float
    whole: bool = True


class LineBuffer:
    r"""Gathers bytes until a line is complete; never holds more than `LONGEST_REPLY_BYTES`.

    The first line is never whole: the port may have been opened in the middle of it, and the end of ``-0.123 N`` is
    a number too.

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
    def held(self) -> int:
        """How many bytes of an unfinished line it holds."""
        return len(self._content)

    def feed(self, chunk: bytes, *, since_s: float, now_s: float) -> list[Line]:
        """Take bytes that arrived between two times, evenly as far as anyone knows; return the lines they complete."""
        lines = []
        for index, byte in enumerate(chunk):
            if byte in _ENDS:
                if self._began is not None:
                    lines.append(self._line(whole=not self._cut))
                self._cut = False
                continue
            if self._began is None:
                self._began = _arrival(index / len(chunk), since_s, now_s)
            if len(self._content) == LONGEST_REPLY_BYTES:
                lines.append(self._line(whole=False))
                self._cut = True
                self._began = _arrival(index / len(chunk), since_s, now_s)
            self._content.append(byte)
        return lines

    def _line(self, *, whole: bool) -> Line:
        time_s, error_s = self._began or (0.0, 0.0)
        line = Line(content=bytes(self._content), time_s=time_s, time_error_s=error_s, whole=whole)
        self._content.clear()
        self._began = None
        return line


def _arrival(share: float, since_s: float, now_s: float) -> tuple[float, float]:
    time_s = since_s + share * (now_s - since_s)
    return time_s, max(time_s - since_s, now_s - time_s)
