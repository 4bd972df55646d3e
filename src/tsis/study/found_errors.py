"""Diameter, depth and modulus of inclusions that were found, beside what is true."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.detection import Proportion, bland_altman
from tsis.model.errors import InputError
from tsis.study.reading import QUANTITIES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tsis.detection import Interval
    from tsis.study.judged import DeviceResults


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundErrors:
    """Readings of one quantity and what is true.

    Attributes
    ----------
    quantity
        Its name.
    codes
        Of the targets.
    read, true
        Shape (targets,), in the unit that the name tells.
    covered
        How many of the 90 % intervals hold the truth, among those that the device gave; None where it gave none.
    not_identified
        How many of the readings say of themselves that the data told hardly more than was believed before.
    """

    quantity: str
    codes: tuple[str, ...]
    read: NDArray[np.float64]
    true: NDArray[np.float64]
    covered: Proportion | None
    not_identified: int

    @property
    def bias(self) -> float:
        """Mean of read less true."""
        return float((self.read - self.true).mean())

    @property
    def bias_interval(self) -> Interval | None:
        """Student's interval of it; None of one target alone, or where all errors are equal."""
        try:
            return bland_altman(self.read, self.true).bias_interval()
        except InputError:
            return None

    @property
    def rmse(self) -> float:
        """Root of the mean square of read less true."""
        return float(np.sqrt(np.mean((self.read - self.true) ** 2)))

    @property
    def largest(self) -> float:
        """The largest distance of read and true."""
        return float(np.abs(self.read - self.true).max())


def found_errors(judged: DeviceResults) -> tuple[FoundErrors, ...]:
    """Errors of every quantity that the device read of inclusions which it found."""
    return tuple(errors for quantity in QUANTITIES if (errors := _of(judged, quantity)) is not None)


def _of(judged: DeviceResults, quantity: str) -> FoundErrors | None:
    held = [(each, each.reading) for each in judged.found if each.reading and quantity in each.reading.values]
    if not held:
        return None
    inside = [
        reading.interval_90[quantity][0] <= target.truth.values[quantity] <= reading.interval_90[quantity][1]
        for target, reading in held
        if quantity in reading.interval_90
    ]
    return FoundErrors(
        quantity=quantity,
        codes=tuple(target.code for target, _ in held),
        read=np.array([reading.values[quantity] for _, reading in held]),
        true=np.array([target.truth.values[quantity] for target, _ in held]),
        covered=Proportion(successes=sum(inside), trials=len(inside)) if inside else None,
        not_identified=sum(f"{quantity}_not_identified" in reading.flags for _, reading in held),
    )


__all__ = ["FoundErrors", "found_errors"]
