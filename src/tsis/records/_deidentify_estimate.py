"""An estimate as its numbers alone: every sentence is made anew from them, every other word is one of this program."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from tsis.files import SHA256
from tsis.hardness import HARDNESS_FLAGS as HARDNESS_FLAGS
from tsis.inclusion import INCLUSION_FLAGS as INCLUSION_FLAGS
from tsis.model import INTERVAL_LEVEL, UNITS
from tsis.records._estimation import OPTIONS, PRIORS
from tsis.records._provenance import LIBRARIES

if TYPE_CHECKING:
    from tsis.model import Estimate
    from tsis.records._values import StoredEstimate


OTHER_FLAG = "other flag"
CALIBRATION = "calibration"
VERSION = re.compile(r"\d{1,4}(\.\d{1,6}){0,3}((a|b|rc|\.dev|\.post)\d{1,6})?")
FLAGS = {"inclusion": INCLUSION_FLAGS, "hardness": HARDNESS_FLAGS}
PARAMETERS = {"diameter_mm": ("diameter", "mm"), "depth_mm": ("depth", "mm"), "young_kpa": ("modulus", "kPa")}
LISTS = ("images", "reference", "presses")  # of frames, in a provenance
CONTACT_KEYS = ("radius_mm", "radius_sd", "light_force_n")  # of a contact


def deidentified_estimate(stored: StoredEstimate, frames: Mapping[str, str]) -> StoredEstimate:
    """The same without words of others; ``frames`` says what the frame of a name is called."""
    reported = stored.estimate
    names = {
        name: name if name in PARAMETERS else _other(number, name) for number, name in enumerate(reported.samples, 1)
    }
    given = FLAGS[stored.kind]
    renamed = {f"{old}_not_identified": f"{new}_not_identified" for old, new in names.items()}
    flags = distinct((renamed.get(flag, flag) for flag in reported.flags), {*given, *renamed.values()})
    estimate = replace(
        reported,
        samples={new: reported.samples[old] for old, new in names.items()},
        prior_sd={new: reported.prior_sd[old] for old, new in names.items()},
        cramer_rao_sd={names[old]: sd for old, sd in reported.cramer_rao_sd.items()},
        flags=flags,
        notes=tuple(f"{flag}: {given[flag]}." for flag in flags if flag in given),
        provenance={},
        identifiability="",
        prior="",
    )
    estimate = replace(
        estimate,
        identifiability=_identifiability(estimate),
        prior=_spreads(estimate),
        provenance=_provenance(reported.provenance, stored.kind, frames),
    )
    return replace(
        stored,
        estimate=estimate,
        options=_options(stored.options, stored.kind),
        environment=_environment(stored.environment),
    )


def distinct(flags: Iterable[str], given: Iterable[str]) -> tuple[str, ...]:
    """Each flag once, those that are not known as one that says no more than that there is another."""
    listed = set(given)
    return tuple(dict.fromkeys(flag if flag in listed else OTHER_FLAG for flag in flags))


def _other(number: int, name: str) -> str:
    """What a parameter that this program does not know is called: a number, and the ending that tells the unit."""
    return f"other_{number}" + next((ending for ending in UNITS if name.endswith(ending)), "")


def _identifiability(estimate: Estimate) -> str:
    """What the numbers tell of each parameter."""
    messages = []
    for name, (low, high) in estimate.interval(INTERVAL_LEVEL).items():
        text, unit = PARAMETERS.get(name, (name.replace("_", " "), ""))
        stored = f"between {low:.3g} and {high:.3g} {unit}".rstrip() + f" with a probability of {INTERVAL_LEVEL:.0%}"
        messages.append(f"the {text} lies {stored}" if estimate.identified(name) else f"the {text} is not identified")
    message = "; ".join(messages) + "."
    return message[:1].upper() + message[1:]


def _spreads(estimate: Estimate) -> str:
    """How wide the belief before the data was."""
    messages = []
    for name, sd in estimate.prior_sd.items():
        text, unit = PARAMETERS.get(name, (name.replace("_", " "), ""))
        messages.append(f"{text} {sd:.3g} {unit}".rstrip())
    return f"standard deviation before the data: {', '.join(messages)}"


def _provenance(given: Mapping[str, Any], kind: str, frames: Mapping[str, str]) -> dict[str, Any]:
    document: dict[str, Any] = {}
    if _is_version(given.get("tsis")):
        document["tsis"] = given["tsis"]
    prior = _prior(given.get("prior"), kind)
    if prior:
        document["prior"] = prior
    for name in LISTS:
        listed = given.get(name)
        if isinstance(listed, (list, tuple)):
            document[name] = [_frame(item, frames) for item in listed if isinstance(item, Mapping)]
    if "presses" in document and not all("seen" in item for item in document["presses"]):
        del document["presses"]
    return document


def _frame(given: Mapping[str, Any], frames: Mapping[str, str]) -> dict[str, Any]:
    """A frame by the number of its press and its hash, and what was measured in it."""
    document: dict[str, Any] = {"name": frames.get(str(given.get("name")), "a press")}
    sha256, observed = given.get("sha256"), given.get("seen")
    if isinstance(sha256, str) and SHA256.fullmatch(sha256):
        document["sha256"] = sha256
    if isinstance(observed, Mapping):
        by_name = {name: observed[name] for name in CONTACT_KEYS if _is_number(observed.get(name))}
        if len(by_name) == len(CONTACT_KEYS):
            document["seen"] = by_name
    return document


def _options(given: Mapping[str, Any], kind: str) -> dict[str, Any]:
    results = {name: given[name] for name in OPTIONS[kind] if _is_number(given.get(name))}
    prior = _prior(given.get("prior"), kind)
    return results | ({"prior": prior} if prior else {})


def _prior(given: Any, kind: str) -> dict[str, Any]:
    """Numbers of the fields that a prior of this program has."""
    if not isinstance(given, Mapping):
        return {}
    names = {field.name for field in fields(PRIORS[kind])}
    return {name: value for name, value in given.items() if name in names and _is_numbers(value)}


def _environment(given: Mapping[str, Any]) -> dict[str, Any]:
    results = {name: given[name] for name in ("tsis", "python") if _is_version(given.get(name))}
    if isinstance(code := given.get("code_sha256"), str) and SHA256.fullmatch(code):
        results["code_sha256"] = code
    if isinstance(libraries := given.get("libraries"), Mapping):
        results["libraries"] = {name: libraries[name] for name in LIBRARIES if _is_version(libraries.get(name))}
    return results


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _is_numbers(value: Any) -> bool:
    return _is_number(value) or (isinstance(value, (list, tuple)) and all(_is_number(item) for item in value))


def _is_version(value: Any) -> bool:
    return isinstance(value, str) and VERSION.fullmatch(value) is not None
