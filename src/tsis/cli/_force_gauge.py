"""The force gauge of the command line, read beside the camera."""

from __future__ import annotations

from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import typer

import tsis
from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.instrument.force_log import ForceLog
    from tsis.instrument.gauge import ForceAtTime


GaugePort = Annotated[
    str | None,
    typer.Option("--gauge", help="Serial port of a force gauge, e.g. /dev/ttyUSB0.", rich_help_panel="Gauge"),
]
GaugeUnit = Annotated[
    str | None,
    typer.Option("--gauge-unit", help="Unit of its display, when it sends none.", rich_help_panel="Gauge"),
]
GaugeBaud = Annotated[
    int | None,
    typer.Option("--gauge-baud", help="Its baud rate, bits per second.", show_default="9600", rich_help_panel="Gauge"),
]
GaugeSends = Annotated[
    bool,
    typer.Option("--gauge-sends", help="It sends by itself, without requests.", rich_help_panel="Gauge"),
]
GaugeLatency = Annotated[
    float,
    typer.Option("--gauge-latency-ms", help="Delay of its reading after the frame.", rich_help_panel="Gauge"),
]


@contextmanager
def gauge_log(
    port: str | None, *, unit: str | None, baud: int | None, sends: bool, latency_ms: float
) -> Iterator[ForceLog | None]:
    """Readings of the gauge at a serial port, after the first have arrived; None without a port."""
    if port is None:
        if unit is not None or sends:
            raise InputError("--gauge-unit and --gauge-sends need --gauge, the port of the gauge")
        yield None
        return
    log = tsis.instrument.force_log.connected_gauge(
        port, unit=unit, baud=baud or tsis.instrument.force_log.BAUD, sends=sends, latency_s=latency_ms / 1000
    )
    try:
        yield log
    finally:
        log.stop()


def force_then(log: ForceLog, time_s: float) -> ForceAtTime:
    """The force at a time, after the next reading has arrived; `GaugeError` when none arrives."""
    log.wait_until(time_s, timeout_s=1.0)
    return log.at(time_s)
