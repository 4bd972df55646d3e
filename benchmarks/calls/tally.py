"""What came back: counts by status, and every answer that should not have been."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

KEPT = 40  # faults that are told of at length


@dataclass(slots=True, kw_only=True)
class Tally:
    """Counts, as they grow.

    Attributes
    ----------
    statuses
        Cases by (way of making them up, status).
    calls
        Cases by (call, status).
    seconds
        How long each case took, by call.
    faults
        What should not have been, by its sentence.
    """

    statuses: Counter[tuple[str, int]] = field(default_factory=Counter)
    calls: Counter[tuple[str, int]] = field(default_factory=Counter)
    seconds: dict[str, list[float]] = field(default_factory=dict)
    faults: Counter[str] = field(default_factory=Counter)

    @property
    def cases(self) -> int:
        """How many in all."""
        return sum(self.statuses.values())

    @property
    def server_errors(self) -> int:
        """Answers from 500 on that the description does not tell of."""
        return sum(count for fault, count in self.faults.items() if fault.startswith("server error"))

    def add(self, way: str, call: str, status: int, seconds: float) -> None:
        """Count a case."""
        self.statuses[way, status] += 1
        self.calls[call, status] += 1
        self.seconds.setdefault(call, []).append(seconds)
