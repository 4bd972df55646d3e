"""A simulated force gauge with the faults of a real one."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

from tsis.errors import GaugeError
from tsis.instrument.gauge._gauge import ForceReading
from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    import numpy as np


class SimulatedGauge:
    """A gauge that reads a course of force at a steady rate, with gain, zero, noise and steps of its display.

    It shows ``resolution_n * round((gain * force(t) + zero_n - tared + noise) / resolution_n)``. Readings that are not
    fetched in time are skipped, as with a gauge whose display goes on.

    Parameters
    ----------
    force
        True force in newtons at a time of ``clock``.
    rng
        Draws the noise.
    noise_n
        Standard deviation of the noise in newtons.
    resolution_n
        Step of the display in newtons; 0 shows every digit.
    zero_n
        Reading without a load, in newtons, until `tare` is called.
    gain
        Reading at 1 N, in newtons.
    rate_per_s
        Readings a second.
    clock
        Seconds, monotonic.
    wait
        Waits for seconds; by default in real time, interrupted by `close`.

    Examples
    --------
    >>> import numpy as np
    >>> gauge = SimulatedGauge(lambda time_s: 0.5, rng=np.random.default_rng(0), rate_per_s=1000.0)
    >>> gauge.open()
    >>> reading = next(gauge.readings())
    >>> abs(reading.force_n - 0.5) < 0.01
    True
    """

    def __init__(
        self,
        force: Callable[[float], float],
        *,
        rng: np.random.Generator,
        noise_n: float = 1e-3,
        resolution_n: float = 1e-3,
        zero_n: float = 0.0,
        gain: float = 1.0,
        rate_per_s: float = 20.0,
        clock: Callable[[], float] = time.monotonic,
        wait: Callable[[float], object] | None = None,
    ) -> None:
        self._force, self._rng, self._clock = force, rng, clock
        self._noise_n = require_number("noise_n", noise_n, 0.0, 1e3)
        self._resolution_n = require_number("resolution_n", resolution_n, 0.0, 1e3)
        self._zero_n = require_number("zero_n", zero_n, -1e3, 1e3)
        self._gain = require_number("gain", gain, -1e3, 1e3)
        self._interval_s = 1.0 / require_number("rate_per_s", rate_per_s, 1e-3, 1e5)
        self._closed = threading.Event()
        self._closed.set()
        self._wait = wait or self._closed.wait

    name, lost, skipped = "simulated gauge", False, 0

    def open(self) -> None:
        """Begin anew."""
        self._closed.clear()

    def readings(self) -> Iterator[ForceReading]:
        """Yield a reading each interval of the clock until the gauge is closed."""
        self._require_open()
        due_s = self._clock()
        while not self._closed.is_set():
            late_s = self._clock() - due_s
            if late_s < 0:
                self._wait(-late_s)
                continue
            due_s += self._interval_s * int(late_s / self._interval_s)
            yield ForceReading(time_s=due_s, force_n=self._shown(due_s), resolution_n=self._resolution_n)
            due_s += self._interval_s

    def tare(self) -> None:
        """Make the present display the zero, noise included, as a real gauge does."""
        self._require_open()
        self._zero_n -= self._shown(self._clock())

    def close(self) -> None:
        """End the readings."""
        self._closed.set()

    def _require_open(self) -> None:
        if self._closed.is_set():
            raise GaugeError(f"the {self.name} must be opened first; call open()")

    def _shown(self, time_s: float) -> float:
        force_n = self._gain * self._force(time_s) + self._zero_n + self._noise_n * float(self._rng.standard_normal())
        return self._resolution_n * round(force_n / self._resolution_n) if self._resolution_n else force_n
