"""What a force gauge is to the rest of tsis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tsis.instrument.gauge.reading import ForceReading


@runtime_checkable
class Gauge(Protocol):
    """A source of force readings, used in the order open, readings, close."""

    @property
    def name(self) -> str:
        """What a person calls it."""

    @property
    def lost(self) -> bool:
        """True when it stopped answering before it was closed."""

    @property
    def skipped(self) -> int:
        """How many replies since it was opened were no reading and were left out."""

    def open(self) -> None:
        """Take hold of the gauge; `GaugeError` or `FileInputError` when that cannot be done."""

    def readings(self) -> Iterator[ForceReading]:
        """Yield readings with ascending times until it is closed or its file ends; `GaugeError` when it fails."""

    def tare(self) -> None:
        """Make the present force the zero; `GaugeError` when it has no such command."""

    def close(self) -> None:
        """End the readings and let go of the gauge; calling it again does nothing."""
