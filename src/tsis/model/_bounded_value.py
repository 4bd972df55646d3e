"""A value that is known within limits."""

from __future__ import annotations

from dataclasses import dataclass

from tsis.errors import InputError
from tsis.model._require import require_number


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundedValue:
    """A value that is known within limits; every value between them is possible.

    Parameters
    ----------
    value
        The best value; the middle of the limits when None.
    low, high
        The limits; both the value itself where they are None, for a value that is exact.

    Raises
    ------
    InputError
        When a number is not finite, a limit is missing, or the value does not lie between the limits.

    Examples
    --------
    >>> BoundedValue(low=100.0, high=200.0).value
    150.0
    >>> BoundedValue(value=5.5).exact
    True
    """

    value: float | None = None
    low: float | None = None
    high: float | None = None

    def __post_init__(self) -> None:
        if (self.low is None) != (self.high is None) or (self.value is None and self.low is None):
            raise InputError(f"a value must have low and high, or be one number; got {self!r}")
        low = self.value if self.low is None else self.low
        high = self.value if self.high is None else self.high
        assert low is not None
        assert high is not None
        numbers = [require_number(name, part, -1e9, 1e9) for name, part in (("low", low), ("high", high))]
        middle = sum(numbers) / 2 if self.value is None else require_number("value", self.value, -1e9, 1e9)
        if not numbers[0] <= middle <= numbers[1]:
            raise InputError(f"value must lie between low = {low:g} and high = {high:g}; got {middle:g}")
        for name, number in zip(("low", "high", "value"), (*numbers, middle), strict=True):
            object.__setattr__(self, name, number)

    @property
    def best(self) -> float:
        """The best value, as a number."""
        assert self.value is not None
        return self.value

    @property
    def limits(self) -> tuple[float, float]:
        """The limits (low, high), as numbers."""
        assert self.low is not None
        assert self.high is not None
        return self.low, self.high

    @property
    def exact(self) -> bool:
        """Whether the limits leave no room."""
        return self.low == self.high

    def __str__(self) -> str:
        return f"{self.value:g}" if self.exact else f"{self.value:g} ({self.low:g} to {self.high:g})"
