from __future__ import annotations

import errno
from itertools import islice
from typing import TYPE_CHECKING, Any

import pytest
import serial
from hypothesis import given
from hypothesis import strategies as st
from tests.instrument.gauge.fake_port import FakePort

from tsis.errors import GaugeError, InputError
from tsis.instrument.gauge import Gauge
from tsis.instrument.serial_gauge import MOST_SKIPPED_IN_A_ROW, SerialGauge, find_ports

if TYPE_CHECKING:
    from collections.abc import Callable


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
