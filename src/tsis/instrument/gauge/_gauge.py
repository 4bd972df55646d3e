"""The gauge protocol, and a reading of a force gauge."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from tsis.model.require import require_number

if TYPE_CHECKING:
    from collections.abc import Iterator


LARGEST_FORCE_N = 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceReading:
    """A force with its time.

    Raises `InputError` when a number is not finite or out of its range.

    Parameters
    ----------
    time_s
        Seconds on the host's monotonic clock.
    force_n
        Force in newtons, with the gauge's sign.
    resolution_n
        Step of the gauge's display in newtons, 0 when unknown.
    time_error_s
        Half-width of the interval in which the gauge took the reading, in seconds; 0 when unknown.

    Examples
    --------
    >>> ForceReading(time_s=12.5, force_n=0.8).force_n
    0.8
    """

    time_s: float
    force_n: float
    resolution_n: float = 0.0
    time_error_s: float = 0.0

    def __post_init__(self) -> None:
        require_number("time_s", self.time_s, -1e12, 1e12)
        require_number("force_n", self.force_n, -LARGEST_FORCE_N, LARGEST_FORCE_N)
        require_number("resolution_n", self.resolution_n, 0.0, LARGEST_FORCE_N)
        require_number("time_error_s", self.time_error_s, 0.0, 1e6)


@runtime_checkable
class Gauge(Protocol):
    """A source of force readings, used in the order open, readings, close."""

    @property
    def name(self) -> str:
        """Display name."""

    @property
    def lost(self) -> bool:
        """True when it stopped answering before it was closed."""

    @property
    def skipped(self) -> int:
        """Number of invalid replies since it was opened."""

    def open(self) -> None:
        """Connect to the gauge; `GaugeError` or `FileInputError` when that fails."""

    def readings(self) -> Iterator[ForceReading]:
        """Yield readings with ascending times until it is closed or its file ends; `GaugeError` when it fails."""

    def tare(self) -> None:
        """Make the present force the zero; `GaugeError` when it has no such command."""

    def close(self) -> None:
        """End the readings and release the gauge; another call does nothing."""
