"""De-identified estimates: numbers, and texts that this program composes from them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from tsis.files import SHA256
from tsis.hardness import HARDNESS_FLAGS as HARDNESS_FLAGS
from tsis.inclusion import INCLUSION_FLAGS as INCLUSION_FLAGS
from tsis.model import INTERVAL_LEVEL, NOT_TRUSTED, UNITS, PosteriorSamples
from tsis.records._estimation import OPTIONS, PRIORS
from tsis.records._provenance import EARLIER_LIBRARY, LIBRARIES

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
    """The estimate without free text; ``frames`` gives the new name of each frame."""
    original = stored.estimate
    names = {
        name: name if name in PARAMETERS else _other(number, name) for number, name in enumerate(original.names, 1)
    }
    known_flags = FLAGS[stored.kind]
    renamed = {f"{old}_not_identified": f"{new}_not_identified" for old, new in names.items()}
    flags = distinct((renamed.get(flag, flag) for flag in original.flags), {*known_flags, *renamed.values()})
    estimate = replace(
        original,
        untrusted=PosteriorSamples(
            samples={new: original.untrusted.samples[old] for old, new in names.items()},
            prior_sd={new: original.prior_sd[old] for old, new in names.items()},
        ),
        cramer_rao_sd={names[old]: sd for old, sd in original.cramer_rao_sd.items()},
        flags=flags,
        notes=tuple(f"{flag}: {known_flags[flag]}." for flag in flags if flag in known_flags),
        provenance={},
        identifiability="",
        prior="",
    )
    estimate = replace(
        estimate,
        identifiability=_identifiability(estimate),
        prior=_spreads(estimate),
        provenance=_provenance(original.provenance, stored.kind, frames),
    )
    return replace(
        stored,
        estimate=estimate,
        options=_options(stored.options, stored.kind),
        environment=_environment(stored.environment),
    )


def distinct(flags: Iterable[str], known: Iterable[str]) -> tuple[str, ...]:
    """Each flag once; `OTHER_FLAG` replaces unknown flags."""
    listed = set(known)
    return tuple(dict.fromkeys(flag if flag in listed else OTHER_FLAG for flag in flags))


def _other(number: int, name: str) -> str:
    """New name of an unknown parameter: a number and the ending with the unit."""
    return f"other_{number}" + next((ending for ending in UNITS if name.endswith(ending)), "")


def _identifiability(estimate: Estimate) -> str:
    if not estimate.trusted:
        return NOT_TRUSTED
    parts = []
    for name, (low, high) in estimate.interval(INTERVAL_LEVEL).items():
        text, unit = PARAMETERS.get(name, (name.replace("_", " "), ""))
        span = f"between {low:.3g} and {high:.3g} {unit}".rstrip() + f" with a probability of {INTERVAL_LEVEL:.0%}"
        parts.append(f"the {text} lies {span}" if estimate.identified(name) else f"the {text} is not identified")
    message = "; ".join(parts) + "."
    return message[:1].upper() + message[1:]


def _spreads(estimate: Estimate) -> str:
    parts = []
    for name, sd in estimate.prior_sd.items():
        text, unit = PARAMETERS.get(name, (name.replace("_", " "), ""))
        parts.append(f"{text} {sd:.3g} {unit}".rstrip())
    return f"standard deviation before the data: {', '.join(parts)}"


def _provenance(original: Mapping[str, Any], kind: str, frames: Mapping[str, str]) -> dict[str, Any]:
    document: dict[str, Any] = {}
    if _is_version(original.get("tsis")):
        document["tsis"] = original["tsis"]
    prior = _prior(original.get("prior"), kind)
    if prior:
        document["prior"] = prior
    for name in LISTS:
        listed = original.get(name)
        if isinstance(listed, (list, tuple)):
            document[name] = [_frame(item, frames) for item in listed if isinstance(item, Mapping)]
    if "presses" in document and not all("seen" in item for item in document["presses"]):
        del document["presses"]
    return document


def _frame(frame: Mapping[str, Any], frames: Mapping[str, str]) -> dict[str, Any]:
    """A frame by the number of its press and its hash, and the contact measured in it."""
    document: dict[str, Any] = {"name": frames.get(str(frame.get("name")), "a press")}
    sha256, contact = frame.get("sha256"), frame.get("seen")
    if isinstance(sha256, str) and SHA256.fullmatch(sha256):
        document["sha256"] = sha256
    if isinstance(contact, Mapping):
        numbers = {name: contact[name] for name in CONTACT_KEYS if _is_number(contact.get(name))}
        if len(numbers) == len(CONTACT_KEYS):
            document["seen"] = numbers
    return document


def _options(options: Mapping[str, Any], kind: str) -> dict[str, Any]:
    numbers = {name: options[name] for name in OPTIONS[kind] if _is_number(options.get(name))}
    prior = _prior(options.get("prior"), kind)
    if "strain" in OPTIONS[kind] and options.get("strain") in ("finite", "small"):
        numbers["strain"] = options["strain"]
    return numbers | ({"prior": prior} if prior else {})


def _prior(prior: Any, kind: str) -> dict[str, Any]:
    """The numeric fields of a prior."""
    if not isinstance(prior, Mapping):
        return {}
    names = {field.name for field in fields(PRIORS[kind])}
    return {name: value for name, value in prior.items() if name in names and _is_numbers(value)}


def _environment(environment: Mapping[str, Any]) -> dict[str, Any]:
    document = {name: environment[name] for name in ("tsis", "python") if _is_version(environment.get(name))}
    if isinstance(code := environment.get("code_sha256"), str) and SHA256.fullmatch(code):
        document["code_sha256"] = code
    if isinstance(libraries := environment.get("libraries"), Mapping):
        document["libraries"] = {
            name: libraries[name] for name in (*LIBRARIES, EARLIER_LIBRARY) if _is_version(libraries.get(name))
        }
    return document


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _is_numbers(value: Any) -> bool:
    return _is_number(value) or (isinstance(value, (list, tuple)) and all(_is_number(item) for item in value))


def _is_version(value: Any) -> bool:
    return isinstance(value, str) and VERSION.fullmatch(value) is not None
