"""Targets without what could identify a person: pseudonyms, dates, notes, provenance."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

from tsis.calibration.guard.limits import GUARD_FLAGS as PRESS_FLAGS
from tsis.catalog.probes import list_probes
from tsis.files.canonical_json import SHA256
from tsis.hardness.flags import HARDNESS_FLAGS
from tsis.inclusion.flags import INCLUSION_FLAGS
from tsis.mapping.flags import MAP_FLAGS
from tsis.model.estimate import INTERVAL_LEVEL, NOT_TRUSTED, UNITS, PosteriorSamples
from tsis.records.database import derived
from tsis.records.provenance import LIBRARIES
from tsis.records.recomputation import OPTIONS, PRIORS
from tsis.records.values import MAP

if TYPE_CHECKING:
    from tsis.calibration.file import ProbeCalibration
    from tsis.model.estimate import Estimate
    from tsis.model.flag import Flag
    from tsis.records.values import StoredEstimate, StoredMap, StoredPress, Target, TargetRecord


OTHER_FLAG = "other flag"
CALIBRATION = "calibration"
VERSION = re.compile(r"\d{1,4}(\.\d{1,6}){0,3}((a|b|rc|\.dev|\.post)\d{1,6})?")
FLAGS: Mapping[str, Mapping[str, Flag]] = {"inclusion": INCLUSION_FLAGS, "hardness": HARDNESS_FLAGS, MAP: MAP_FLAGS}
PARAMETERS = {
    "diameter_mm": ("diameter", "mm"),
    "depth_mm": ("depth", "mm"),
    "young_kpa": ("modulus", "kPa"),
    "x_mm": ("place along x", "mm"),
    "y_mm": ("place along y", "mm"),
    "centre_depth_mm": ("depth of the centre", "mm"),
    "contrast": ("contrast", ""),
    "sd": ("unevenness", ""),
    "length_mm": ("length of the unevenness", "mm"),
}
LISTS = ("images", "reference", "presses")  # of frames, in a provenance
CONTACT_KEYS = ("radius_mm", "radius_sd", "light_force_n")  # of a contact


def deidentified_estimate(stored: StoredEstimate, frames: Mapping[str, str]) -> StoredEstimate:
    """The estimate without free text; ``frames`` gives the new name of each frame."""
    estimate = _neutral(stored.estimate, stored.kind)
    return replace(
        stored,
        estimate=replace(estimate, provenance=_provenance(stored.estimate.provenance, stored.kind, frames)),
        options=_options(stored.options, stored.kind),
        environment=_environment(stored.environment),
    )


def deidentified_map(stored: StoredMap, frames: Mapping[str, str]) -> StoredMap:
    """The map without free text; ``frames`` gives the new name of each frame."""
    found, flags = stored.estimate, distinct(stored.estimate.flags, MAP_FLAGS)
    lumps = tuple(
        replace(lump, name=f"lump {number}", estimate=_neutral(lump.estimate, MAP))
        for number, lump in enumerate(found.untrusted.lumps, 1)
    )
    numbers = replace(found.untrusted, lumps=lumps, unevenness=_neutral(found.untrusted.unevenness, MAP))
    return replace(
        stored,
        estimate=replace(
            found,
            untrusted=numbers,
            flags=flags,
            notes=_meanings(flags, MAP),
            left_out=(),
            provenance=_provenance(found.provenance, MAP, frames),
        ),
        options=_options(stored.options, MAP),
        environment=_environment(stored.environment),
    )


def _meanings(flags: Iterable[str], kind: str) -> tuple[str, ...]:
    return tuple(f"{flag}: {FLAGS[kind][flag].means}." for flag in flags if flag in FLAGS[kind])


def _neutral(original: Estimate, kind: str) -> Estimate:
    """The numbers of an estimate, with texts that are made anew from them."""
    names = {
        name: name if name in PARAMETERS else _other(number, name) for number, name in enumerate(original.names, 1)
    }
    renamed = {f"{old}_not_identified": f"{new}_not_identified" for old, new in names.items()}
    flags = distinct((renamed.get(flag, flag) for flag in original.flags), {*FLAGS[kind], *renamed.values()})
    estimate = replace(
        original,
        untrusted=PosteriorSamples(
            samples={new: original.untrusted.samples[old] for old, new in names.items()},
            prior_sd={new: original.prior_sd[old] for old, new in names.items()},
        ),
        cramer_rao_sd={names[old]: sd for old, sd in original.cramer_rao_sd.items()},
        flags=flags,
        notes=_meanings(flags, kind),
        provenance={},
        identifiability="",
        prior="",
    )
    return replace(estimate, identifiability=_identifiability(estimate), prior=_spreads(estimate))


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
        document["libraries"] = {name: libraries[name] for name in LIBRARIES if _is_version(libraries.get(name))}
    return document


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _is_numbers(value: Any) -> bool:
    return _is_number(value) or (isinstance(value, (list, tuple)) and all(_is_number(item) for item in value))


def _is_version(value: Any) -> bool:
    return isinstance(value, str) and VERSION.fullmatch(value) is not None


DIGITS = 12


def pseudonym(record: TargetRecord) -> str:
    """The permanent pseudonym of a target; without the secret of the store it cannot be resolved.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> from tsis.records.values import Target, TargetRecord
    >>> target = Target(number=3, kind="subject", made=datetime(2026, 11, 22, tzinfo=UTC), id="a")
    >>> pseudonym(TargetRecord(target=target, presses=(), read={}.__getitem__, secret="5a" * 32))
    'TSIS-077785083242'
    """
    return "TSIS-" + hidden_identity(record, "pseudonym", record.target.id)[:DIGITS].upper()


def hidden_identity(record: TargetRecord, what: str, identity: str) -> str:
    """The substitute of an identity in a de-identified export: as permanent and secret as the pseudonym."""
    return derived(record.secret, what, identity)[:32]


def public_identity(target: Target) -> str:
    """Kind and number of a target, and a hash that distinguishes it from a target of another store."""
    difference = hashlib.sha256(f"tsis target {target.id}".encode()).hexdigest()[:8]
    return f"{target.kind}-{target.number:05d}-{difference}"


CAMERA = "a camera"
DAMAGED = "a stored file is not as it was stored (tsis records verify says which)"  # its path may contain a name
CAMERA_SOURCES = ("virtual", "virtual loading machine")  # of frames that this program simulated


def deidentified(record: TargetRecord) -> TargetRecord:
    """The record without identifying content.

    Target, presses and estimates get other identities, derived from the secret of the store; the target gets its
    pseudonym. Labels, frame names, notes, settings and true values are removed. Only probes of the catalog and flags of
    this program remain by name. Texts are composed anew from the numbers.
    """
    probes = _neutral_probes(_probes_named(record))
    frames = {press.name: f"press {number}" for number, press in enumerate(record.presses, 1) if press.name}
    target = pseudonym(record)
    calibrations = {
        cited: _calibration(calibration, f"{CALIBRATION} {number}", probes)
        for number, (cited, calibration) in enumerate(sorted(record.calibrations.items()), 1)
    }
    return replace(
        record,
        target=replace(record.target, id=target, name="", note="", truth={}),
        damaged=(DAMAGED,) if record.damaged else (),
        presses=tuple(_press(record, press, probes, target) for press in record.presses),
        estimates=tuple(
            replace(deidentified_estimate(stored, frames), **_identities(record, stored, "estimate", probes, target))
            for stored in record.estimates
        ),
        maps=tuple(
            replace(deidentified_map(stored, frames), **_identities(record, stored, "map", probes, target))
            for stored in record.maps
        ),
        calibrations=calibrations,
    )


def from_camera(press: StoredPress) -> bool:
    """Whether a frame came from a camera, which writes no text into its pixels, and not from an image file.

    The settings of an image file contain its format; those of a camera frame name the camera or the simulation.
    """
    settings = press.settings
    return (bool(settings.get("camera")) and "format" not in settings) or settings.get("source") in CAMERA_SOURCES


def _probes_named(record: TargetRecord) -> Iterable[str]:
    yield from (press.probe for press in record.presses)
    yield from (stored.probe for stored in record.results)
    for _, calibration in sorted(record.calibrations.items()):
        yield calibration.probe
        if calibration.response is not None:
            yield calibration.response.probe


def _neutral_probes(names: Iterable[str]) -> dict[str, str]:
    """New name by probe: the name in the catalog, or a number in the order of occurrence."""
    cataloged = {"", *list_probes()}
    others = [name for name in dict.fromkeys(names) if name not in cataloged]
    numbered = {name: f"other probe {number}" for number, name in enumerate(others, 1)}
    return {name: name for name in cataloged} | (numbered if len(others) > 1 else dict.fromkeys(others, "other probe"))


def _press(record: TargetRecord, press: StoredPress, probes: Mapping[str, str], target: str) -> StoredPress:
    return replace(
        press,
        probe=probes[press.probe],
        flags=distinct(press.flags, PRESS_FLAGS),
        settings={"camera": CAMERA} if from_camera(press) else {},
        name="",
        note="",
        id=_optional_identity(record, "press", press.id),
        target=target,
    )


def _identities(
    record: TargetRecord, stored: StoredEstimate | StoredMap, what: str, probes: Mapping[str, str], target: str
) -> dict[str, Any]:
    """The new identities of a result, and of what it cites."""
    supersedes = stored.supersedes
    return {
        "probe": probes[stored.probe],
        "presses": tuple(_optional_identity(record, "press", press) for press in stored.presses),
        "calibration": stored.calibration if SHA256.fullmatch(stored.calibration) else "",
        "supersedes": None if supersedes is None else _optional_identity(record, what, supersedes),
        "id": _optional_identity(record, what, stored.id),
        "target": target,
    }


def _calibration(calibration: ProbeCalibration, name: str, probes: Mapping[str, str]) -> ProbeCalibration:
    """The numbers of a calibration, without its specification sheet."""
    response = calibration.response
    return replace(
        calibration,
        name=name,
        probe=probes[calibration.probe],
        camera="",
        settings={},
        response=None if response is None else replace(response, name=name, probe=probes[response.probe]),
        specification=None,
    )


def _optional_identity(record: TargetRecord, what: str, identity: str) -> str:
    """The hidden identity; empty for a value outside a store."""
    return hidden_identity(record, what, identity) if identity else ""
