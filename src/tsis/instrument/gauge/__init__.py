"""Force gauges: serial, simulated, recorded; their readings at the times of camera frames."""

from tsis.instrument.gauge._alignment import ForceAtTime, force_at
from tsis.instrument.gauge._force_log import BAUD, ForceLog, LogState, connected_gauge
from tsis.instrument.gauge._gauge import ForceReading, Gauge
from tsis.instrument.gauge._latency import Latency, find_latency
from tsis.instrument.gauge._recorded import RecordedGauge, write_readings
from tsis.instrument.gauge._serial_gauge import SerialGauge
from tsis.instrument.gauge._serial_line import SerialPort, find_ports
from tsis.instrument.gauge._simulated import SimulatedGauge

__all__ = [
    "BAUD",
    "ForceAtTime",
    "ForceLog",
    "ForceReading",
    "Gauge",
    "Latency",
    "LogState",
    "RecordedGauge",
    "SerialGauge",
    "SerialPort",
    "SimulatedGauge",
    "connected_gauge",
    "find_latency",
    "find_ports",
    "force_at",
    "write_readings",
]
