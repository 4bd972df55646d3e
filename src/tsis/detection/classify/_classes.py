"""Three classes of targets: none, and two kinds of inclusions separated by limits of their properties."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from tsis.errors import InputError
from tsis.model import INCLUSION_RANGES, Inclusion, require_number, require_type

if TYPE_CHECKING:
    from collections.abc import Sequence


NONE, OTHER, TARGET = 0, 1, 2
CLASSES = 3
SIDES = {  # unit, name of the requested side, and of the other
    "young_kpa": ("kPa", "stiffer than", "softer than"),
    "diameter_mm": ("mm", "larger than", "smaller than"),
    "depth_mm": ("mm", "shallower than", "deeper than"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassSplit:
    """Limits that separate two kinds of inclusions.

    The third class is stiffer than ``young_kpa``, larger than ``diameter_mm`` and shallower than ``depth_mm``, as far
    as these are given; the second is any other inclusion, and the first is none. Raises `InputError` when no limit is
    given, or one lies outside its range.

    Parameters
    ----------
    young_kpa, diameter_mm, depth_mm
        Limits, within what an `tsis.Inclusion` may have; None where a property does not matter.

    Examples
    --------
    >>> ClassSplit(young_kpa=60).names
    ('none', 'softer than 60 kPa', 'stiffer than 60 kPa')
    >>> ClassSplit(young_kpa=60, diameter_mm=5).names[1:]
    ('not stiffer than 60 kPa and larger than 5 mm', 'stiffer than 60 kPa and larger than 5 mm')
    >>> ClassSplit(young_kpa=60).label(Inclusion(diameter_mm=5, depth_mm=5, young_kpa=100))
    2
    >>> ClassSplit(young_kpa=60).label(None)
    0
    """

    young_kpa: float | None = None
    diameter_mm: float | None = None
    depth_mm: float | None = None

    def __post_init__(self) -> None:
        for name, limit in self.limits.items():
            object.__setattr__(self, name, require_number(name, limit, *INCLUSION_RANGES[name]))
        if not self.limits:
            raise InputError(f"a split needs at least one of {', '.join(SIDES)}; got none")

    @property
    def limits(self) -> dict[str, float]:
        """The limits that are given, by name."""
        every = {name: getattr(self, name) for name in SIDES}
        return {name: limit for name, limit in every.items() if limit is not None}

    @property
    def names(self) -> tuple[str, str, str]:
        """Of the three classes, in the order of their labels 0, 1 and 2."""
        requested = " and ".join(f"{SIDES[name][1]} {limit:g} {SIDES[name][0]}" for name, limit in self.limits.items())
        if len(self.limits) > 1:
            return "none", f"not {requested}", requested
        (name, limit), *_ = self.limits.items()
        return "none", f"{SIDES[name][2]} {limit:g} {SIDES[name][0]}", requested

    def label(self, inclusion: Inclusion | None) -> int:
        """The true class of a target: 0, 1 or 2; an inclusion on a limit is of class 1."""
        if inclusion is None:
            return NONE
        require_type("inclusion", inclusion, Inclusion)
        above = (
            (limit - value if name == "depth_mm" else value - limit) > 0
            for name, limit in self.limits.items()
            for value in (getattr(inclusion, name),)
        )
        return TARGET if all(above) else OTHER

    def labels(self, truth: Sequence[Inclusion | None]) -> list[int]:
        """The class of each target."""
        return [self.label(item) for item in truth]
