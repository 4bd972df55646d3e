"""A gauge at a terminal of this machine: readings when they come, one sentence when nothing does."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from tests.instrument.gauge.sending_gauge import sending

from tsis.errors import GaugeError, InputError
from tsis.instrument.force_log import connected_gauge

if TYPE_CHECKING:
    from pathlib import Path


def test_a_gauge_that_sends_is_read_in_newtons() -> None:
    with sending(b"500 mN\r\n") as port:
        log = connected_gauge(port, sends=True)
        try:
            assert log.state().error == ""
            assert {round(reading.force_n, 12) for reading in log.readings()} == {0.5}
        finally:
            log.stop()


def test_a_port_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(GaugeError, match="nowhere"):
        connected_gauge(str(tmp_path / "nowhere"))


def test_a_speed_that_is_none_is_refused() -> None:
    with pytest.raises(InputError, match="baud"):
        connected_gauge("/dev/null", baud=-1)
