"""A serial gauge that is read from now on, once its first readings have come."""

from __future__ import annotations

from tsis.instrument.gauge.force_log import ForceLog
from tsis.instrument.gauge.serial_gauge import SerialGauge
from tsis.model.errors import GaugeError

FIRST_READINGS, FIRST_S = 4, 5.0
BAUD = 9600


def connected_gauge(
    port: str, *, unit: str | None = None, baud: int = BAUD, sends: bool = False, latency_s: float = 0.0
) -> ForceLog:
    """The log of a gauge at a serial port, which whoever takes it must stop.

    Parameters
    ----------
    port, unit, baud
        As of `SerialGauge`.
    sends
        Whether it sends on its own and is not to be asked.
    latency_s
        As of `ForceLog`.

    Raises
    ------
    InputError
        When a value is out of its range.
    GaugeError
        When the port cannot be opened, or readings do not come within 5 s.
    """
    gauge = SerialGauge(port, unit=unit, baud=baud, poll=None) if sends else SerialGauge(port, unit=unit, baud=baud)
    log = ForceLog(gauge, latency_s=latency_s)
    log.start()
    if not log.wait_for(FIRST_READINGS, timeout_s=FIRST_S):
        error = log.state().error
        log.stop()
        raise GaugeError(error or f"{gauge.name} must send readings; none came for {FIRST_S:g} s")
    return log
