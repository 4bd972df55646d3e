"""Force gauges: on a serial line, simulated, recorded; their readings beside the frames of a camera."""

from tsis.instrument.gauge.alignment import ForceAtTime, force_at
from tsis.instrument.gauge.force_log import ForceLog, LogState
from tsis.instrument.gauge.latency import Latency, find_latency
from tsis.instrument.gauge.protocol import Gauge
from tsis.instrument.gauge.reading import ForceReading
from tsis.instrument.gauge.recorded import RecordedGauge, write_readings
from tsis.instrument.gauge.serial_gauge import SerialGauge
from tsis.instrument.gauge.serial_port import SerialPort, find_ports
from tsis.instrument.gauge.simulated import SimulatedGauge

__all__ = [
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
    "find_latency",
    "find_ports",
    "force_at",
    "write_readings",
]
