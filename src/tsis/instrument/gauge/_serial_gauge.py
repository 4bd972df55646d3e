"""A force gauge with ASCII replies on a serial line, as those of Mecmesin and Mark-10."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import serial

from tsis.errors import GaugeError, InputError
from tsis.instrument.gauge._gauge import LARGEST_FORCE_N, ForceReading
from tsis.instrument.gauge._replies import Reply, ReplyKind, force_unit, newtons, read_reply
from tsis.instrument.gauge._serial_line import PORT_FAILURES, SerialLine, opened
from tsis.model.require import require_integer, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from tsis.instrument.gauge._serial_line import Line


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

    Raises
    ------
    InputError
        When a parameter is out of its range.

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
        """Open the port; older bytes are dropped.

        Raises `GaugeError` when there is no such port, another program uses it, or this user has no permission.
        """
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
        """Command the gauge to set its zero, without confirmation.

        Raises `GaugeError` when it has no such command or was lost.
        """
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
        deadline_s = self._clock() + self._timeout_s
        while not serial_line.closed:
            try:
                line = serial_line.take()
            except PORT_FAILURES as error:
                raise self._unplugged(error) from error
            reading = self._reading(line) if line is not None else None
            if reading is not None:
                return reading
            if self._clock() >= deadline_s:
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
