"""A relative estimate: its value, assumptions and flags."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.errors import InputError
from tsis.inclusion.relative._light import REFERENCE_TISSUE, UNTOUCHED
from tsis.model.content import ContentValue

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from tsis.inclusion._prior import Floats
    from tsis.model.calibration import Calibration


NOTES = {
    "no_contact": "No pixel exceeds the threshold: there is nothing to measure.",
    "cropped": "The lit part touches the border of the picture: it may continue outside and be measured incompletely.",
    "saturated": "The camera clipped inside the lit part: grey levels there are too low.",
    "noisy": "Noise alone exceeds the threshold somewhere: single lit pixels mean nothing.",
    "no_growth": "The lit part does not grow from the first press to the second: there is no strain to divide by.",
    "corners_lit": "The picture's corners are lit: the initial threshold assumes that they are background.",
    "repeated_frames": "A frame equals the frame before it, as from a frozen camera: it adds no movement.",
    "contact_lost": "Some frames have no contact: steps to and from them are missing, and the path is too short.",
    "no_movement": "The positions differ by no more than noise: no movement was measured.",
}
COMPARED_WITH = {
    UNTOUCHED: "Tissue without inclusion stays below the threshold; in full contact the face itself is measured.",
    REFERENCE_TISSUE: "The reference press had the same force, on tissue of the same stiffness and thickness.",
}
SPHERE_ASSUMPTION = "There is one inclusion, and it is a sphere."
EVEN_LIGHT = "The light is uniform over the face, and the compared presses had equal light and force."
LIGHT_ASSUMPTION = "The light is that of the calibration, and the compared presses had equal force."


def comparison_assumptions(against: str, calibration: Calibration | None, *others: str) -> tuple[str, ...]:
    """Assumptions of a comparison of presses on spheres."""
    return (SPHERE_ASSUMPTION, COMPARED_WITH[against], equal_light_assumption(calibration), *others)


def equal_light_assumption(calibration: Calibration | None) -> str:
    """Assumption on the light."""
    return EVEN_LIGHT if calibration is None or calibration.light is None else LIGHT_ASSUMPTION


def notes_of(flags: tuple[str, ...]) -> tuple[str, ...]:
    """The sentence of each flag."""
    return tuple(NOTES[flag] for flag in flags)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeReading(ContentValue):
    """A number that is valid only for comparing presses; ``print`` shows it with its assumptions and flags.

    Attributes
    ----------
    quantity
        Name of the quantity, e.g. ``"relative size"``.
    value
        The number; None without contact.
    unit
        Its unit.
    against
        Content of the reference: ``"untouched probe"`` or ``"plain tissue"``.
    assumptions
        Assumptions of a comparison of two such numbers, a message each.
    parts
        Intermediate results, by name with unit.
    flags
        Short names of the defects of this press.

    Examples
    --------
    >>> print(RelativeReading(quantity="relative size", value=6.25, unit="mm", against="plain tissue",
    ...                       assumptions=("There is one inclusion.",), flags=("cropped",)))
    relative size: 6.25 mm (against plain tissue)
      assumed: There is one inclusion.
      cropped: The lit part touches the border of the picture: it may continue outside and be measured incompletely.
    Research use only. Not reviewed or approved by any regulator. Not for patient care.
    """

    quantity: str
    value: float | None
    unit: str
    against: str
    assumptions: tuple[str, ...]
    parts: Mapping[str, float] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", MappingProxyType(dict(self.parts)))

    @property
    def notes(self) -> tuple[str, ...]:
        """The sentence of each flag."""
        return notes_of(self.flags)

    def __str__(self) -> str:
        value = "no value" if self.value is None else f"{self.value:.4g} {self.unit}"
        lines = [f"{self.quantity}: {value} (against {self.against})"]
        lines += [f"  assumed: {assumption}" for assumption in self.assumptions]
        lines += [f"  {flag}: {note}" for flag, note in zip(self.flags, self.notes, strict=True)]
        return "\n".join([*lines, RESEARCH_USE_ONLY])


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """Readings of the same quantity from repeated presses of one target.

    Parameters
    ----------
    label
        Name of the target.
    readings
        At least one, all of one quantity against one kind of reference.

    Raises
    ------
    InputError
        When there is no reading, or readings are of different kinds.

    Examples
    --------
    >>> readings = [RelativeReading(quantity="relative size", value=value, unit="mm", against="plain tissue",
    ...                             assumptions=()) for value in (6.0, 7.0, 8.0)]
    >>> repeats = Repeats(label="8 mm", readings=readings)
    >>> repeats.mean, repeats.sd, repeats.observed
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
    def values(self) -> Floats:
        """The values, shape (readings with a value,)."""
        return np.array([reading.value for reading in self.readings if reading.value is not None])

    @property
    def observed(self) -> int:
        """Number of readings with a value."""
        return sum("no_contact" not in reading.flags for reading in self.readings)

    @property
    def mean(self) -> float:
        """Mean value; NaN without values."""
        return float(self.values.mean()) if self.values.size else float("nan")

    @property
    def sd(self) -> float:
        """Standard deviation from press to press; NaN below two values."""
        return float(self.values.std(ddof=1)) if self.values.size > 1 else float("nan")


def ratios(targets: Sequence[Repeats]) -> tuple[float, ...]:
    """Mean of each target over that of the first; NaN without values, or where the first is zero.

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
