"""Relative estimates of section 6.2: numbers that are valid only for comparing presses."""

from tsis.inclusion.relative._estimates import relative_depth, relative_hardness, relative_size
from tsis.inclusion.relative._light import LightChange, LitPart, change_of_light, lit_part, matching_references
from tsis.inclusion.relative._reading import (
    COMPARED_WITH,
    SPHERE_ASSUMPTION,
    RelativeReading,
    Repeats,
    equal_light_assumption,
    notes_of,
    ratios,
)

__all__ = [
    "COMPARED_WITH",
    "SPHERE_ASSUMPTION",
    "LightChange",
    "LitPart",
    "RelativeReading",
    "Repeats",
    "change_of_light",
    "equal_light_assumption",
    "lit_part",
    "matching_references",
    "notes_of",
    "ratios",
    "relative_depth",
    "relative_hardness",
    "relative_size",
]
