"""A number that was measured, with how well it is known."""

from __future__ import annotations

import math
from dataclasses import dataclass

import scipy

from tsis.errors import InputError
from tsis.model import require_number, require_type


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredValue:
    """A number and its standard uncertainty.

    Parameters
    ----------
    value
        The number, finite.
    sd
        Its standard deviation in the same unit, finite and not negative.
    degrees_of_freedom
        On how many degrees of freedom ``sd`` rests, 1 or more; infinite when it is known.
    unit
        Unit of both, e.g. ``"mm"``; empty for a pure number.

    Raises
    ------
    InputError
        When a number is not finite or out of its range.

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
        """Ends of the interval of Student's t around the value that holds the truth with probability ``level``."""
        require_number("level", level, 1e-6, 1 - 1e-9, hint="a probability")
        half = float(scipy.stats.t.ppf(0.5 + level / 2, self.degrees_of_freedom)) * self.sd
        return self.value - half, self.value + half
