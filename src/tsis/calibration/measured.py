"""A measured number with its standard uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass

import scipy

from tsis.errors import InputError
from tsis.model.require import require_number, require_type


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredValue:
    """A number and its standard uncertainty.

    Raises `InputError` when a number is not finite or out of its range.

    Parameters
    ----------
    value
        The number, finite.
    sd
        Its standard deviation in the same unit, finite and not negative.
    degrees_of_freedom
        Degrees of freedom of ``sd``, 1 or more; infinite for an exactly known ``sd``.
    unit
        Unit of both, e.g. ``"mm"``; empty for a pure number.

    Examples
    --------
    >>> low, high = MeasuredValue(value=2.0, sd=0.1, degrees_of_freedom=9).interval(0.95)
    >>> round(low, 3), round(high, 3)
    (1.774, 2.226)
    """

    value: float
    sd: float
    degrees_of_freedom: float = math.inf
    unit: str = ""

    def __post_init__(self) -> None:
        require_number("value", self.value, -1e300, 1e300, hint=self.unit)
        require_number("sd", self.sd, 0.0, 1e300, hint=self.unit)
        if not self.degrees_of_freedom >= 1:
            raise InputError(f"degrees_of_freedom must be at least 1; got {self.degrees_of_freedom!r}")
        require_type("unit", self.unit, str)

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Interval of Student's t that covers the true value with probability ``level``."""
        require_number("level", level, 1e-6, 1 - 1e-9, hint="a probability")
        # Not scipy.stats.t.ppf, which is the same: its package takes a second to load.
        half = float(scipy.special.stdtrit(self.degrees_of_freedom, 0.5 + level / 2)) * self.sd
        return self.value - half, self.value + half
