"""Units and words of what was measured, by the ending of its name."""

from __future__ import annotations

UNITS = {"_mm": "mm", "_kpa": "kPa", "_n": "N", "_deg": "deg"}  # as UCUM writes them
NO_UNIT = "1"


def unit_of(name: str) -> str:
    """The unit of a quantity in UCUM; ``"1"`` for a pure number.

    Examples
    --------
    >>> unit_of("young_kpa"), unit_of("presence")
    ('kPa', '1')
    """
    return next((unit for ending, unit in UNITS.items() if name.endswith(ending)), NO_UNIT)


def label_of(name: str) -> str:
    """A quantity's name in words, without its unit.

    Examples
    --------
    >>> label_of("young_kpa"), label_of("depth_mm")
    ("Young's modulus", 'depth')
    """
    ending = next((ending for ending in UNITS if name.endswith(ending)), "")
    bare = name.removesuffix(ending).replace("_", " ")
    return "Young's modulus" if bare == "young" else bare
