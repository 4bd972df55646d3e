"""Codes, quantities and references as FHIR writes them, of elements that R4 and R5 have in common."""

from __future__ import annotations

import base64
import math
from uuid import UUID, uuid5

from tsis.model.quantities import NO_UNIT, label_of, unit_of

Resource = dict[str, object]

ROOT = UUID("6f4c1a52-3b0e-5d0e-9a57-2f6f2f3a1d11")  # of every name below; never to be changed
CODES = f"urn:uuid:{uuid5(ROOT, 'quantities')}"
TARGETS = f"urn:uuid:{uuid5(ROOT, 'targets')}"
PROBES = f"urn:uuid:{uuid5(ROOT, 'probes')}"
UCUM = "http://unitsofmeasure.org"
ABSENT = "http://terminology.hl7.org/CodeSystem/data-absent-reason"
ABSENT_EXTENSION = "http://hl7.org/fhir/StructureDefinition/data-absent-reason"
DIGITS = 6  # significant ones of a number: more than any press can tell


def urn(kind: str, identity: str) -> str:
    """A name for a resource that is the same in every export of the same thing."""
    return f"urn:uuid:{uuid5(ROOT, f'{kind}/{identity}')}"


def concept(code: str, words: str) -> Resource:
    """A concept of this program's own."""
    return {"coding": [{"system": CODES, "code": code, "display": words}], "text": words}


def quantity(name: str, value: float) -> Resource:
    """A number with the unit that the quantity's name ends in."""
    unit = unit_of(name)
    rounded = float(f"{value:.{DIGITS}g}")
    shown = {} if unit == NO_UNIT else {"unit": unit}  # FHIR has no empty text
    return {"value": rounded, **shown, "system": UCUM, "code": unit}


def absent(code: str, why: str) -> Resource:
    """Why there is no value."""
    return {"coding": [{"system": ABSENT, "code": code}], "text": why}


def component(code: str, words: str, name: str, value: float) -> Resource:
    """A part of an observation: a number in the unit of ``name``, or the reason why there is none."""
    coded: Resource = {"code": concept(code, words)}
    if not math.isfinite(value):
        return coded | {"dataAbsentReason": absent("positive-infinity", "infinite: the data tell nothing of it")}
    return coded | {"valueQuantity": quantity(name, value)}


def hashed(sha256: str, what: str) -> Resource:
    """A reference to content by its SHA-256, as RFC 6920 names it."""
    digest = base64.urlsafe_b64encode(bytes.fromhex(sha256)).rstrip(b"=").decode()
    name = {"system": "urn:ietf:rfc:3986", "value": f"ni:///sha-256;{digest}"}
    return {"type": "DocumentReference", "identifier": name, "display": f"{what}, SHA-256 {sha256}"}


def words(name: str) -> str:
    """What people read of a quantity."""
    return label_of(name).capitalize()
