"""A serial port in memory whose gauge is a function, on a clock that only its reads move."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.instrument.serial_gauge import SerialGauge

if TYPE_CHECKING:
    from collections.abc import Callable


class FakePort:
    """Answers each question by ``answer(time_s)`` after ``delay_s``, and sends ``unasked`` (time, bytes) on its own."""

    def __init__(
        self,
        answer: Callable[[float], bytes] | None = None,
        *,
        unasked: list[tuple[float, bytes]] | None = None,
        delay_s: float = 0.02,
    ) -> None:
        self.now_s, self.answer, self.delay_s = 100.0, answer, delay_s
        self.coming = [(self.now_s + at_s, chunk) for at_s, chunk in (unasked or [])]
        self.written: list[bytes] = []
        self.closed = self.unplugged = False
        self.settings: dict[str, Any] = {}

    def gauge(self, **settings: Any) -> SerialGauge:
        gauge = SerialGauge("FAKE", open_port=self._opened, clock=lambda: self.now_s, **settings)
        gauge.open()
        return gauge

    def _opened(self, port: str, **settings: Any) -> FakePort:
        self.settings = {"port": port, **settings}
        return self

    @property
    def in_waiting(self) -> int:
        self._alive()
        return sum(len(chunk) for at_s, chunk in self.coming if at_s <= self.now_s)

    def write(self, command: bytes) -> int:
        self._alive()
        self.written.append(command)
        if self.answer is not None and command.startswith(b"?"):
            self.coming.append((self.now_s + self.delay_s, self.answer(self.now_s)))
            self.coming.sort(key=lambda item: item[0])
        return len(command)

    def read(self, size: int) -> bytes:
        self._alive()
        if not self.in_waiting:
            next_s = self.coming[0][0] if self.coming else float("inf")
            self.now_s = min(next_s, self.now_s + float(self.settings["timeout"]))
        taken = b""
        while len(taken) < size and self.coming and self.coming[0][0] <= self.now_s:
            at_s, chunk = self.coming.pop(0)
            taken, rest = taken + chunk[: size - len(taken)], chunk[size - len(taken) :]
            if rest:
                self.coming.insert(0, (at_s, rest))
        return taken

    def close(self) -> None:
        self.closed = True

    def _alive(self) -> None:
        if self.unplugged:
            raise OSError(5, "Input/output error")
