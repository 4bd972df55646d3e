"""What one quantity of a sweep does: it keeps one value, is sampled in a range, or takes the values of a list."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tsis.model.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Range:
    """A range that is sampled evenly, or evenly in the logarithm.

    Parameters
    ----------
    low, high
        Ends of the range, in the quantity's unit; ``low < high``.
    logarithmic
        Sample the logarithm evenly; then ``low`` must be positive.

    Raises
    ------
    InputError
        When the ends are in the wrong order, or a logarithm does not exist.

    Examples
    --------
    >>> Range(low=10.0, high=1000.0, logarithmic=True).at(np.array([0.0, 0.5, 1.0])).round(9).tolist()
    [10.0, 100.0, 1000.0]
    """

    low: float
    high: float
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not self.low < self.high:
            raise InputError(
                f"a range must be [low, high] with low < high; got [{self.low:g}, {self.high:g}] "
                "(give one number to keep a value)"
            )
        if self.logarithmic and self.low <= 0:
            raise InputError(f"a logarithmic range must start above 0; got [{self.low:g}, {self.high:g}]")

    def at(self, unit: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values at ``unit`` in [0, 1], never outside the range."""
        if self.logarithmic:
            values = self.low * (self.high / self.low) ** unit
        else:
            values = self.low + (self.high - self.low) * unit
        return np.clip(values, self.low, self.high)


Quantity: TypeAlias = float | Range | tuple[float, ...]


def extremes(quantity: Quantity) -> tuple[float, float]:
    """Smallest and largest value that a quantity takes."""
    if isinstance(quantity, Range):
        return quantity.low, quantity.high
    if isinstance(quantity, tuple):
        return min(quantity), max(quantity)
    return quantity, quantity
