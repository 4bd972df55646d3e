"""What the report speaks of, in codes: those of SNOMED CT, DICOM and UCUM where they exist, else of our own scheme."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

from tsis.records.dicom.libraries import highdicom

SCHEME = "99TSIS"
SCHEME_NAME = "Codes of tsis, open software for optical tactile imaging"

# Ours: value -> meaning.
OWN = MappingProxyType(
    {
        "imaging": "Optical tactile imaging",
        "young": "Young's modulus",
        "presence": "Presence of an inclusion",
        "trusted": "Model holds, numbers may be used",
        "flag": "Quality flag",
        "identifiability": "What the data tell and what not",
        "prior": "Belief before the data",
        "role": "Role of the press",
        "notice": "Notice",
        "no-number": "Parameter without a number",
    }
)
MILLIMETRE, KILOPASCAL, NEWTON, ONE = (
    ("mm", "UCUM", "millimeter"),
    ("kPa", "UCUM", "kilopascal"),
    ("N", "UCUM", "newton"),
    ("1", "UCUM", "no units"),
)
DIAMETER = ("81827009", "SCT", "Diameter")
DEPTH = ("131197000", "SCT", "Depth")
ELASTICITY = ("110830", "DCM", "Elasticity")
FORCE = ("111647", "DCM", "Compression Force")
PROBABILITY = ("122157", "DCM", "Probability")
MEAN = ("373098007", "SCT", "Mean")
STANDARD_DEVIATION = ("386136009", "SCT", "Standard Deviation")
FIFTH_PERCENTILE = ("371888009", "SCT", "Fifth percentile")
NINETY_FIFTH_PERCENTILE = ("371889001", "SCT", "Ninety-fifth percentile")
DEVICE = ("121007", "DCM", "Device")
YES, NO = ("373066001", "SCT", "Yes"), ("373067005", "SCT", "No")

# Parameter of an estimate -> concept, unit, and the way of measuring where the concept alone is not precise.
PARAMETERS = MappingProxyType(
    {
        "diameter_mm": (DIAMETER, MILLIMETRE, None),
        "depth_mm": (DEPTH, MILLIMETRE, None),
        "young_kpa": (ELASTICITY, KILOPASCAL, "young"),
    }
)


def concept(triple: tuple[str, str, str]) -> Any:
    """A code of value, scheme and meaning as highdicom takes it."""
    value, scheme, meaning = triple
    return highdicom("sr").CodedConcept(value=value, scheme_designator=scheme, meaning=meaning)


def own(value: str) -> Any:
    """One of our own codes."""
    return concept((value, SCHEME, OWN[value]))
