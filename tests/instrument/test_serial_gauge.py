"""Replies of serial gauges, on a port in memory whose clock only its reads move: forces in newtons or one sentence."""

from __future__ import annotations

import errno
import math
from itertools import islice
from typing import TYPE_CHECKING, Any

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st

from tsis.errors import GaugeError, InputError
from tsis.instrument.gauge import Gauge
from tsis.instrument.serial_gauge import (
    LONGEST_REPLY_BYTES,
    MOST_SKIPPED_IN_A_ROW,
    NEWTONS,
    Line,
    LineBuffer,
    ReplyKind,
    SerialGauge,
    find_ports,
    force_unit,
    newtons,
    read_reply,
)

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


# From NIST SP 811, appendix B.8, and multiples by SI prefixes.
IN_NEWTONS = {
    "N": 1.0,
    "mN": 0.001,
    "kN": 1000.0,
    "gf": 9.80665e-3,
    "kgf": 9.80665,
    "lbf": 4.4482216152605,
    "ozf": 0.27801385095378125,
    "cN": 1e-2,
    "daN": 10.0,
    "µN": 1e-6,
}


@pytest.mark.parametrize("unit", IN_NEWTONS)
def test_every_unit_is_converted(unit: str) -> None:
    force, step = newtons(read_reply(b"-2.50 " + unit.encode()), unit=unit)
    assert force == pytest.approx(-2.5 * IN_NEWTONS[unit], rel=1e-14)
    assert step == pytest.approx(0.01 * IN_NEWTONS[unit], rel=1e-14)


def test_all_known_units_are_tested() -> None:
    assert set(IN_NEWTONS) == set(NEWTONS)


@pytest.mark.parametrize(
    ("line", "number", "step", "unit"),
    [
        (b"+0.123", 0.123, 0.001, ""),
        (b" - 18.78 lbF\r", -18.78, 0.01, "lbf"),
        (b"4.285 N", 4.285, 0.001, "N"),
        (b"12KGF", 12.0, 1.0, "kgf"),
        (b".5 n", 0.5, 0.1, "N"),
        (b"5. mN", 5.0, 1.0, "mN"),
    ],
)
def test_what_gauges_send_is_read(line: bytes, number: float, step: float, unit: str) -> None:
    reply = read_reply(line)
    assert (reply.kind, reply.number, reply.step, reply.unit) == (ReplyKind.NUMBER, number, step, unit)


@pytest.mark.parametrize(
    "line",
    [
        b"",
        b".",
        b"N",
        b"+",
        b"-",
        b"1,5 N",
        b"1.2.3 N",
        b"1e3 N",
        b"nan",
        b"inf N",
        b"0x10",
        b"--1",
        b"1 2 N",
        b"5 MN",  # no gauge reads meganewtons: a millinewton misspelt would be a billion times too large
        b"0.12 N.m",
        b"0.12 Nm",
        b"12 kg",
        b"18.780 N Peak",
        "١٢ N".encode(),
        b"\x00\xff\x80",
        b"1" * 65,
        b"1" * 10,
    ],
)
def test_what_is_no_force_is_garbage(line: bytes) -> None:
    assert read_reply(line).kind is ReplyKind.GARBAGE
    with pytest.raises(GaugeError, match="no reading"):
        newtons(read_reply(line), unit="N")


@pytest.mark.parametrize("line", [b"OL", b"-OL N", b"+O.L", b"OVER", b"overload", b"----", b"--", b"HELP", b"- OL"])
def test_an_overload_is_no_number(line: bytes) -> None:
    assert read_reply(line).kind is ReplyKind.OVERLOAD
    with pytest.raises(GaugeError, match="overload"):
        newtons(read_reply(line), unit="N")


@pytest.mark.parametrize("line", [b"xxxx", b"*10", b"ERR 3"])
def test_a_fault_of_the_gauge_is_no_number(line: bytes) -> None:
    with pytest.raises(GaugeError, match="fault of its own"):
        newtons(read_reply(line), unit="N")


def test_units_must_agree_and_be_known() -> None:
    with pytest.raises(GaugeError, match=r"must be in N; got one in lbf; .*unit='lbf'"):
        newtons(read_reply(b"1.0 lbf"), unit="N")
    with pytest.raises(GaugeError, match="without a unit; state"):
        newtons(read_reply(b"1.0"), unit=None)
    assert newtons(read_reply(b"1.0"), unit="kN") == (1000.0, 100.0)
    assert force_unit("LBF") == "lbf"
    for wrong in ("", "kg", "MN", "N.m", 3):
        with pytest.raises(InputError, match="unit must be one of N, mN"):
            force_unit(wrong)  # type: ignore[arg-type]


@given(st.binary(max_size=200))
def test_no_bytes_raise_anything_but_a_gauge_error(line: bytes) -> None:
    reply = read_reply(line)
    try:
        force, step = newtons(reply, unit="N")
    except GaugeError:
        return
    assert reply.kind is ReplyKind.NUMBER
    assert math.isfinite(force)
    assert step > 0


@given(
    st.integers(-(10**9) + 1, 10**9 - 1),
    st.integers(0, 6),
    st.sampled_from(sorted(IN_NEWTONS)),
    st.sampled_from(["", " ", "   "]),
)
def test_numbers_come_back(digits: int, places: int, unit: str, space: str) -> None:
    number = digits / 10**places
    reply = read_reply(f"{number:+.{places}f}{space}{unit}".encode())
    assert (reply.kind, reply.unit) == (ReplyKind.NUMBER, unit)
    assert reply.number == float(f"{number:.{places}f}")
    assert reply.step == pytest.approx(10.0**-places)


def _fed(buffer: LineBuffer, *chunks: bytes) -> list[Line]:
    return [line for k, chunk in enumerate(chunks) for line in buffer.feed(chunk, since_s=float(k), now_s=k + 1.0)]


def test_a_line_that_was_entered_in_the_middle_is_not_whole() -> None:
    lines = _fed(LineBuffer(), b"23 N\r\n0.125 N\r", b"\n0.130 N\n")
    assert [(line.content, line.whole) for line in lines] == [(b"23 N", False), (b"0.125 N", True), (b"0.130 N", True)]


def test_a_line_is_dated_by_its_first_byte() -> None:
    first, second, third = _fed(LineBuffer(), b"\r\n12", b"34\r\nabcd\r", b"\nx\n")
    assert (first.content, first.time_s, first.time_error_s) == (b"1234", 0.5, 0.5)
    assert (second.content, second.time_s, second.time_error_s) == (b"abcd", 1 + 4 / 9, 5 / 9)
    assert 2 < third.time_s < 3


@given(st.lists(st.binary(max_size=300), max_size=20))
def test_memory_is_bounded_and_lines_are_those_of_the_text(chunks: list[bytes]) -> None:
    buffer = LineBuffer()
    lines = []
    for chunk in chunks:
        lines += buffer.feed(chunk, since_s=0.0, now_s=1.0)
        assert buffer.pending <= LONGEST_REPLY_BYTES
    whole = [line.content for line in lines if line.whole]
    # The slow reference: cut the whole text at once.
    text = b"".join(chunks).replace(b"\r", b"\n")
    *complete, _unfinished = text.split(b"\n")
    assert whole == [part for part in complete[1:] if part and len(part) <= LONGEST_REPLY_BYTES]
    assert all(len(line.content) <= LONGEST_REPLY_BYTES for line in lines)


def _ramp(time_s: float) -> bytes:
    return f"{time_s - 100:+.3f} N\r\n".encode()


def test_asked_readings_are_dated_between_question_and_reply() -> None:
    port = FakePort(_ramp, delay_s=0.02)
    gauge = port.gauge()
    assert isinstance(gauge, Gauge)
    readings = list(islice(gauge.readings(), 20))
    assert port.settings["port"] == "FAKE"
    assert port.settings["baudrate"] == 9600
    assert port.settings["exclusive"] is True
    assert set(port.written) == {b"?\r"}
    for reading in readings:
        # The fake reads its force at the question: the truth lies within the stated half-width.
        assert abs(reading.force_n - (reading.time_s - 100)) <= reading.time_error_s + 0.0005
        assert reading.time_error_s == pytest.approx(0.01)
        assert reading.resolution_n == pytest.approx(0.001)
    assert (gauge.skipped, gauge.lost) == (0, False)


def test_a_gauge_that_sends_on_its_own_is_not_asked() -> None:
    sent = [(0.1 * k, f"{0.01 * k:.2f} N\r\n".encode()) for k in range(10)]
    port = FakePort(unasked=[(0.0, b"99 N\r\n"), *[(0.05 + at_s, line) for at_s, line in sent]])
    gauge = port.gauge(poll=None)
    readings = list(islice(gauge.readings(), 10))
    assert port.written == []
    assert [reading.force_n for reading in readings] == pytest.approx([0.01 * k for k in range(10)])
    assert [reading.time_s for reading in readings] == pytest.approx([100.05 + 0.1 * k for k in range(10)])


def test_readings_that_waited_say_how_old_they_may_be() -> None:
    port = FakePort(unasked=[(0.0, b"9 N\r\n"), *[(0.1 * k, b"%d.0 N\r\n" % k) for k in range(1, 9)]])
    readings = port.gauge(poll=None).readings()
    first = next(readings)
    port.now_s += 0.55  # the program does something else while five lines come
    waited = list(islice(readings, 5))
    assert first.time_error_s == 0
    for reading in waited:
        assert abs(reading.time_s - (100 + 0.1 * reading.force_n)) <= reading.time_error_s
    times = [reading.time_s for reading in (first, *waited)]
    assert times == sorted(set(times))


@pytest.mark.parametrize(
    ("answer", "settings", "message"),
    [
        (lambda _: b"+1.0 lbf\r\n", {"unit": "N"}, "must be in N; got one in lbf"),
        (lambda _: b"+1.0\r\n", {}, "without a unit; state"),
        (lambda now_s: b"1.0 N\r\n" if now_s < 100.2 else b"0.2 lbf\r\n", {}, "must be in N; got one in lbf"),
        (lambda _: b"OL\r\n", {}, "gives no force: it reports an overload; take the load off"),
        (lambda _: b"xxxx\r\n", {}, "fault of its own"),
        (lambda _: b"0.5 N.m\r\n", {}, rf"{MOST_SKIPPED_IN_A_ROW} lines in a row .*0.5 N.m.*baud"),
        (lambda _: b"\x80\xfe" * 40, {}, r"sent \d+ lines in a row that are no force|sent bytes but no reading"),
        (lambda _: b"0.5", {}, "sent bytes but no reading within 1 s; set it to 9600 baud"),
        (lambda _: b"", {}, "gauge at FAKE was silent for 1 s at 9600 baud; check that it is switched on"),
        (None, {"poll": None, "timeout_s": 0.2}, r"silent for 0\.2 s .* sends on its own"),
    ],
)
def test_what_is_no_force_ends_the_readings(
    answer: Callable[[float], bytes] | None, settings: dict[str, Any], message: str
) -> None:
    port = FakePort(answer)
    gauge = port.gauge(**settings)
    with pytest.raises(GaugeError, match=message):
        list(islice(gauge.readings(), 100))
    assert port.now_s - 100 <= 2.5  # seconds of the fake's clock
    assert gauge.lost == ("silent" in message)


def test_silence_is_noticed_within_the_timeout() -> None:
    port = FakePort(unasked=[(0.0, b"9 N\r\n"), (0.5, b"1 N\r\n")])
    readings = port.gauge(poll=None, timeout_s=1.0).readings()
    next(readings)
    since_s = port.now_s
    with pytest.raises(GaugeError, match="silent"):
        next(readings)
    assert 1.0 <= port.now_s - since_s <= 1.05


def test_a_machine_that_stops_in_a_wait_does_not_lose_its_gauge(monkeypatch: pytest.MonkeyPatch) -> None:
    port = FakePort(unasked=[(0.0, b"9 N\r\n"), (0.5, b"8 N\r\n"), (60.0, b"1 N\r\n2 N\r\n")])
    readings = port.gauge(poll=None, timeout_s=1.0).readings()
    next(readings)
    read = port.read

    def stopped(size: int) -> bytes:
        monkeypatch.setattr(port, "read", read)
        port.now_s += 60.0
        return b""

    monkeypatch.setattr(port, "read", stopped)
    assert [next(readings).force_n, next(readings).force_n] == [1.0, 2.0]


def test_a_trickle_of_garbage_does_not_hold_the_program() -> None:
    port = FakePort(unasked=[(0.3 * k, b"\xff") for k in range(100)])
    with pytest.raises(GaugeError, match="sent bytes but no reading"):
        next(port.gauge(poll=None).readings())
    assert port.now_s - 100 <= 1.05


def test_single_bad_lines_are_skipped_and_counted() -> None:
    answers = iter([b"1 N\r", *[b"1.0 N\r\n", b"1.\x80 N\r\n", b"x" * 300 + b"\r\n"] * 30])
    port = FakePort(lambda _: next(answers))
    gauge = port.gauge()
    assert {reading.force_n for reading in islice(gauge.readings(), 30)} == {1.0}
    assert gauge.skipped == 29 * (1 + 5)  # 300 bytes are cut into five


@pytest.mark.parametrize("unit", ["N", None])
def test_after_a_unit_a_reply_without_one_is_skipped_and_counted(unit: str | None) -> None:
    answers = iter([b"1 N\r", b"0.800 N\r\n", b"800\r\n", b"0.8\r\n", b"0.801 N\r\n"])
    gauge = FakePort(lambda _: next(answers)).gauge(unit=unit)
    assert [reading.force_n for reading in islice(gauge.readings(), 2)] == [0.8, 0.801]
    assert gauge.skipped == 2  # the first line, which is never whole, is dropped uncounted


def test_a_gauge_that_stops_sending_its_unit_is_refused_and_one_that_never_does_is_not() -> None:
    answers = iter([b"1 N\r", b"1.0 N\r\n", *[b"2.0\r\n"] * MOST_SKIPPED_IN_A_ROW])
    readings = FakePort(lambda _: next(answers)).gauge(unit="N").readings()
    assert next(readings).force_n == 1.0
    with pytest.raises(GaugeError, match=r"lines in a row that are no force, the last b'2\.0'"):
        next(readings)
    never = FakePort(lambda _: b"2.0\r\n").gauge(unit="N")
    assert [reading.force_n for reading in islice(never.readings(), 5)] == [2.0] * 5


def test_a_gauge_opened_again_is_heard_anew() -> None:
    answers = iter([b"1 N\r", b"1.0 N\r\n", b"2.0\r\n", b"3.0\r\n"])
    gauge = FakePort(lambda _: next(answers)).gauge(unit="N")
    next(gauge.readings())
    gauge.open()
    assert next(gauge.readings()).force_n == 3.0


def test_forces_beyond_any_gauge_are_skipped() -> None:
    answers = iter([b"1 N\r", b"999999999 kN\r", b"1 kN\r"])
    gauge = FakePort(lambda _: next(answers)).gauge(unit="kN")
    assert next(gauge.readings()).force_n == 1000
    assert gauge.skipped == 1


def test_a_gauge_that_is_unplugged_is_lost() -> None:
    port = FakePort(_ramp)
    gauge = port.gauge()
    readings = gauge.readings()
    next(readings)
    port.unplugged = True
    with pytest.raises(GaugeError, match=r"was lost; plug it in and open it again .*Input/output error"):
        next(readings)
    assert gauge.lost
    assert port.closed
    port.unplugged = False
    again = port.gauge()
    assert not again.lost
    assert next(again.readings()).time_s < port.now_s


def test_closing_ends_the_readings() -> None:
    port = FakePort(_ramp)
    gauge = port.gauge()
    readings = gauge.readings()
    next(readings)
    gauge.close()
    gauge.close()
    assert list(readings) == []
    assert port.closed
    with pytest.raises(GaugeError, match="must be opened first"):
        next(gauge.readings())


def test_tare_sends_its_command() -> None:
    port = FakePort(_ramp)
    gauge = port.gauge(tare_command=b"Z\r")
    gauge.tare()
    assert port.written == [b"Z\r"]
    with pytest.raises(GaugeError, match="no command that sets its zero"):
        FakePort(_ramp).gauge(tare_command=None).tare()
    port.unplugged = True
    with pytest.raises(GaugeError, match="was lost"):
        gauge.tare()


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (serial.SerialException(errno.ENOENT, "no such file"), r"no serial port is called 'P'; .*\(found: "),
        (serial.SerialException(errno.EACCES, "denied"), "must be open to you"),
        (serial.SerialException(errno.EBUSY, "busy"), "in use by another program"),
        (serial.SerialException(errno.EAGAIN, "Could not exclusively lock"), "in use by another program"),
        (serial.SerialException("could not open port 'P': FileNotFoundError(2, '')"), "no serial port is called 'P'"),
        (serial.SerialException("could not open port 'P': PermissionError(13, '')"), "must be open to you"),
        (serial.SerialException("Could not configure port: (25, '')"), "cannot be opened as a serial port; got: Could"),
        (ValueError("Failed to set custom baud rate"), "cannot be opened as a serial port"),
    ],
)
def test_a_port_that_cannot_be_opened_is_one_sentence(error: Exception, message: str) -> None:
    def refuse(*_: Any, **__: Any) -> Any:
        raise error

    with pytest.raises(GaugeError, match=message) as caught:
        SerialGauge("P", open_port=refuse).open()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "settings",
    [
        {"port": ""},
        {"port": None},
        {"baud": 0},
        {"baud": 9600.5},
        {"unit": "kg"},
        {"poll": "?"},
        {"poll": b""},
        {"tare_command": b"x" * 65},
        {"timeout_s": 0},
        {"timeout_s": float("nan")},
    ],
)
def test_parameters_are_checked(settings: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(settings))):
        SerialGauge(**{"port": "P", **settings})


def test_ports_are_listed_by_name() -> None:
    devices = [port.device for port in find_ports()]
    assert devices == sorted(devices)


@given(st.lists(st.tuples(st.floats(0, 0.3), st.binary(max_size=100)), max_size=30))
def test_no_stream_of_bytes_raises_anything_but_a_gauge_error(sent: list[tuple[float, bytes]]) -> None:
    unasked, at_s = [], 0.0
    for pause_s, chunk in sent:
        at_s += pause_s
        if chunk:
            unasked.append((at_s, chunk))
    readings = FakePort(unasked=unasked).gauge(poll=None).readings()
    with pytest.raises(GaugeError):  # in the end: the fake falls silent
        list(readings)


@pytest.mark.parametrize(
    ("line", "force_n", "step_n"),
    [
        (b"12.5 cN", 0.125, 1e-3),
        (b"0.5 daN", 5.0, 1.0),
        ("0.5 µN".encode(), 5e-7, 1e-7),
        ("0.5 μN".encode(), 5e-7, 1e-7),
        ("0.5 µN".encode("latin-1"), 5e-7, 1e-7),
        (b"0.5 uN", 5e-7, 1e-7),
        (b"@253.4 N", 253.4, 0.1),
        (b"R-012.34N", -12.34, 0.01),
    ],
)
def test_lines_of_further_families_of_gauges_are_read(line: bytes, force_n: float, step_n: float) -> None:
    assert newtons(read_reply(line), unit=None) == pytest.approx((force_n, step_n))


def test_a_reading_after_the_letter_r_has_the_stated_unit() -> None:
    assert newtons(read_reply(b"R+012.34"), unit="N") == pytest.approx((12.34, 0.01))
    assert read_reply(b"R").kind is ReplyKind.GARBAGE
