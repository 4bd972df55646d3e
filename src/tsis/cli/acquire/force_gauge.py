"""The force gauge that the command line names, read beside the camera."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING

from tsis.instrument.gauge import ForceLog, SerialGauge

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.instrument.gauge import ForceAtTime

FIRST_READINGS, FIRST_S = 4, 5.0


@contextmanager
def gauge_log(port: str | None, unit: str | None) -> Iterator[ForceLog | None]:
    """Readings of the gauge at a serial port, once the first have come; None without a port."""
    if port is None:
        yield None
        return
    with ForceLog(SerialGauge(port, unit=unit)) as log:
        log.wait_for(FIRST_READINGS, timeout_s=FIRST_S)
        yield log


def force_then(log: ForceLog, time_s: float) -> ForceAtTime:
    """The force at a time, once the reading after it has come; `GaugeError` when none comes."""
    log.wait_until(time_s, timeout_s=1.0)
    return log.at(time_s)
