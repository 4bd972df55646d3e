"""Several presses of one target, read alike: mean and standard deviation, and ratios between targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tsis.inclusion.relative_reading import RelativeReading
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """Readings of the same quantity from repeated presses of one target.

    Parameters
    ----------
    label
        What the target is called.
    readings
        At least one, all of one quantity against one kind of reference.

    Raises
    ------
    InputError
        When there is no reading, or readings of different kinds are mixed.

    Examples
    --------
    >>> readings = [RelativeReading(quantity="relative size", value=value, unit="mm", against="plain tissue",
    ...                             assumptions=()) for value in (6.0, 7.0, 8.0)]
    >>> repeats = Repeats(label="8 mm", readings=readings)
    >>> repeats.mean, repeats.sd, repeats.seen
    (7.0, 1.0, 3)
    """

    label: str
    readings: tuple[RelativeReading, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "readings", tuple(self.readings))
        if not self.readings:
            raise InputError(f"readings of {self.label!r} must hold at least one RelativeReading; got none")
        for reading in self.readings:
            if not isinstance(reading, RelativeReading):
                raise InputError(f"readings of {self.label!r} must be RelativeReading values; got {reading!r:.80}")
            if _kind(reading) != _kind(self.readings[0]):
                raise InputError(
                    f"readings of {self.label!r} must all be of {_named(self.readings[0])}; "
                    f"got {_named(reading)} among them"
                )

    @property
    def values(self) -> NDArray[np.float64]:
        """The values that were read, shape (readings with a value,)."""
        return np.array([reading.value for reading in self.readings if reading.value is not None])

    @property
    def seen(self) -> int:
        """Number of presses that showed anything."""
        return sum("no_contact" not in reading.flags for reading in self.readings)

    @property
    def mean(self) -> float:
        """Mean value; NaN when no press could be read."""
        return float(self.values.mean()) if self.values.size else float("nan")

    @property
    def sd(self) -> float:
        """Standard deviation from press to press; NaN below two values."""
        return float(self.values.std(ddof=1)) if self.values.size > 1 else float("nan")


def ratios(targets: Sequence[Repeats]) -> tuple[float, ...]:
    """Mean of each target over that of the first; NaN where there is none, or the first is zero.

    Raises
    ------
    InputError
        When the targets' readings are not of one kind.

    Examples
    --------
    >>> def repeats(value):
    ...     return Repeats(label="", readings=[RelativeReading(quantity="relative size", value=value, unit="mm",
    ...                                                        against="plain tissue", assumptions=())])
    >>> ratios([repeats(2.0), repeats(8.0)])
    (1.0, 4.0)
    """
    kinds = {_named(target.readings[0]) for target in targets}
    if len(kinds) != 1:
        raise InputError(f"targets must hold readings of one kind; got {' and '.join(sorted(kinds)) or 'none'}")
    first = targets[0].mean
    return tuple(target.mean / first if first else float("nan") for target in targets)


def _kind(reading: RelativeReading) -> tuple[str, str, str]:
    return reading.quantity, reading.unit, reading.against


def _named(reading: RelativeReading) -> str:
    return f"{reading.quantity} against {reading.against}"
