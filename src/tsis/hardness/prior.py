"""What is believed of a touched sphere before the frames are seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tsis.model.check import require_number, require_pair
from tsis.model.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class HardnessPrior:
    """Ranges of the sphere; even in the logarithm of the modulus, and in Poisson's ratio.

    Parameters
    ----------
    young_kpa
        Least and greatest modulus, within [1, 1e5] kPa.
    poisson
        Least and greatest Poisson's ratio, within [0.45, 0.495].

    Raises
    ------
    InputError
        When a range is empty or lies outside.

    Examples
    --------
    >>> HardnessPrior(young_kpa=(20.0, 500.0)).young_kpa
    (20.0, 500.0)
    """

    young_kpa: tuple[float, float] = (10.0, 1000.0)
    poisson: tuple[float, float] = (0.45, 0.495)

    def __post_init__(self) -> None:
        for name, low, high in (("young_kpa", 1.0, 1e5), ("poisson", 0.45, 0.495)):
            least, most = require_pair(name, getattr(self, name))
            require_number(f"{name}[0]", least, low, high)
            require_number(f"{name}[1]", most, low, high)
            if not least < most:
                raise InputError(f"{name} must be a range that ascends; got {(least, most)}")
            object.__setattr__(self, name, (least, most))

    @property
    def young_sd_kpa(self) -> float:
        """Standard deviation of the modulus, kPa."""
        low, high = self.young_kpa
        span = float(np.log(high / low))
        mean, square = (high - low) / span, (high**2 - low**2) / (2 * span)
        return float(np.sqrt(square - mean**2))

    def __str__(self) -> str:
        (low, high), (least, most) = self.young_kpa, self.poisson
        return (
            f"modulus {low:g} to {high:g} kPa, even in its logarithm; Poisson's ratio {least:g} to {most:g}, even; "
            "a homogeneous sphere between a smooth plate and the probe"
        )
