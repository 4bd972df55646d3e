"""A gauge behind a pseudo-terminal: a real serial port to the driver, the operating system and pyserial."""

from __future__ import annotations

import os
import time
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from tests.system.gauge_peer import GaugeInTerminal
from tests.waiting import HANGS_S

from tsis.errors import GaugeError
from tsis.instrument.force_log import ForceLog
from tsis.instrument.serial_gauge import SerialGauge

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from typing import TypeAlias

    Plug: TypeAlias = Callable[..., "GaugeInTerminal"]

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(not hasattr(os, "openpty"), reason="this system has no pseudo-terminals"),
]


@pytest.fixture
def plug() -> Iterator[Callable[..., GaugeInTerminal]]:
    plugged: list[GaugeInTerminal] = []

    def make(say: Callable[[int], bytes | None], **settings: Any) -> GaugeInTerminal:
        plugged.append(GaugeInTerminal(say, **settings))
        return plugged[-1]

    yield make
    for each in plugged:
        each.unplug()


def _count(k: int) -> bytes:
    return f"{k / 1000:+.3f} N\r\n".encode()


def test_steady_readings_ascend_in_time_and_none_is_missing(plug: Plug) -> None:
    terminal = plug(_count)
    gauge = SerialGauge(terminal.port)
    gauge.open()
    before_s = time.monotonic()
    readings = list(islice(gauge.readings(), 300))
    after_s = time.monotonic()
    gauge.close()
    # The first reply is dropped: nobody can tell a cut one from a whole one.
    assert [round(reading.force_n * 1000) for reading in readings] == list(range(1, 301))
    times = [reading.time_s for reading in readings]
    assert times == sorted(set(times))
    assert before_s <= times[0] < times[-1] <= after_s
    assert gauge.skipped == 0
    assert b"".join(terminal.commands).startswith(b"?\r?\r")


def test_a_gauge_that_sends_on_its_own(plug: Plug) -> None:
    gauge = SerialGauge(plug(_count, every_s=0.005).port, poll=None)
    gauge.open()
    forces = [round(reading.force_n * 1000) for reading in islice(gauge.readings(), 50)]
    gauge.close()
    assert forces == list(range(forces[0], forces[0] + 50))


def test_a_gauge_through_a_log_while_a_frame_waits(plug: Plug) -> None:
    with ForceLog(SerialGauge(plug(lambda _: b" 0.750 N\r\n").port)) as log:
        assert log.wait_for(10, timeout_s=HANGS_S)
        frame_s = time.monotonic()
        assert log.wait_until(frame_s, timeout_s=HANGS_S)
        force = log.at(frame_s)
    assert force.force_n == pytest.approx(0.75)
    assert force.error_n == pytest.approx(0.0005)
    assert log.state().error == ""


@pytest.mark.parametrize(
    ("say", "settings", "message"),
    [
        (lambda _: None, {}, "was silent for 0.3 s at 9600 baud"),
        (lambda k: bytes(128 + (31 * k + 7 * each) % 128 for each in range(40)), {}, "no force|no reading"),
        (lambda _: b"\xff\xfe\r\n", {}, "20 lines in a row that are no force"),
        (lambda _: b"0.12", {}, "no reading within 0.3 s|20 lines in a row"),
        (lambda _: b"1.20 lbf\r\n", {"unit": "N"}, "must be in N; got one in lbf"),
        (lambda k: b"1.20 N\r\n" if k < 20 else b"0.27 lbf\r\n", {}, "must be in N; got one in lbf"),
        (lambda _: b"1.20\r\n", {}, "without a unit"),
        (lambda k: b"1.20 N\r\n" if k < 20 else b"OL\r\n", {}, "reports an overload"),
        (lambda k: b"1.20 N\r\n" if k < 20 else b"------\r\n", {}, "reports an overload"),
    ],
)
def test_what_is_no_force_ends_in_one_sentence(
    plug: Plug, say: Callable[[int], bytes | None], settings: dict[str, Any], message: str
) -> None:
    gauge = SerialGauge(plug(say).port, timeout_s=0.3, **settings)
    gauge.open()
    with pytest.raises(GaugeError, match=message) as caught:
        list(islice(gauge.readings(), 1000))
    gauge.close()
    assert "\n" not in str(caught.value)


def test_an_unplugged_gauge_is_lost_at_once_and_its_readings_stay(plug: Plug) -> None:
    terminal = plug(_count)
    gauge = SerialGauge(terminal.port, timeout_s=HANGS_S)
    with ForceLog(gauge) as log:
        assert log.wait_for(20, timeout_s=HANGS_S)
        terminal.unplug()
        assert not log.wait_for(10**6, timeout_s=HANGS_S)  # ends long before its timeout
        state = log.state()
    assert not state.running
    assert state.lost
    assert "was lost; plug it in and open it again" in state.error
    assert len(log.readings()) == state.received >= 20


def test_reconnecting_builds_a_new_port(plug: Plug) -> None:
    for _ in range(10):
        terminal = plug(_count)
        gauge = SerialGauge(terminal.port)
        gauge.open()
        readings = gauge.readings()
        assert next(readings).force_n == pytest.approx(0.001)
        terminal.unplug()
        with pytest.raises(GaugeError, match="was lost"):
            list(readings)


def test_no_descriptor_stays_open(plug: Plug) -> None:
    listed = Path("/proc/self/fd")
    if not listed.is_dir():
        pytest.skip("this system does not list open descriptors")
    terminal = plug(_count)
    gauge = SerialGauge(terminal.port)
    before = len(list(listed.iterdir()))
    for _ in range(50):
        gauge.open()
        next(gauge.readings())
    gauge.close()
    assert len(list(listed.iterdir())) == before


def test_closing_from_another_thread_ends_a_silent_wait(plug: Plug) -> None:
    gauge = SerialGauge(plug(lambda _: None).port, timeout_s=600.0)
    with ForceLog(gauge) as log:
        assert log.state().running
    assert (log.state().running, log.state().error) == (False, "")


def test_tare_reaches_the_gauge(plug: Plug) -> None:
    terminal = plug(_count)
    gauge = SerialGauge(terminal.port)
    gauge.open()
    gauge.tare()
    list(islice(gauge.readings(), 3))
    gauge.close()
    assert b"".join(terminal.commands).startswith(b"\x05?\r")


def test_a_port_that_another_program_holds_is_refused(plug: Plug) -> None:
    terminal = plug(_count)
    first, second = SerialGauge(terminal.port), SerialGauge(terminal.port)
    first.open()
    with pytest.raises(GaugeError, match="is in use by another program; close that one"):
        second.open()
    first.close()
    second.open()
    second.close()


def test_what_is_no_port_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "no port"
    file.write_text("0.5 N")
    for name, message in (
        ("/dev/tsis-no-such-port", r"no serial port is called '/dev/tsis-no-such-port'"),
        (str(file), "cannot be opened as a serial port"),
        (str(tmp_path), "cannot be opened as a serial port"),
        ("/dev/null", "cannot be opened as a serial port"),
        ("a\0b", "cannot be opened as a serial port"),
    ):
        with pytest.raises(GaugeError, match=message):
            SerialGauge(name).open()
