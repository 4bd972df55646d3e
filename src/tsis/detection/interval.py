"""An interval that says how it was made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.model.check import require_number

if TYPE_CHECKING:
    from collections.abc import Iterator

LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Both ends of a confidence interval; ``low, high = interval`` takes them apart.

    Attributes
    ----------
    low, high
        Ends, which belong to the interval; an end may be infinite where nothing bounds it.
    level
        Probability with which such intervals hold the truth, in (0, 1).
    method
        How it was made, e.g. ``"wilson"``.

    Examples
    --------
    >>> low, high = Interval(low=0.4, high=0.9, level=0.95, method="wilson")
    >>> low, high
    (0.4, 0.9)
    """

    low: float
    high: float
    level: float
    method: str

    def __iter__(self) -> Iterator[float]:
        return iter((self.low, self.high))

    def holds(self, value: float) -> bool:
        """Whether a value lies in the interval, its ends included."""
        return self.low <= value <= self.high


def checked_level(level: float) -> float:
    """Return a level of confidence, or say that it is none."""
    return require_number("level", level, 1e-6, 1 - 1e-9, hint="a probability, such as 0.95")


__all__ = ["LEVEL", "Interval", "checked_level"]
