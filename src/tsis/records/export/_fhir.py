"""Export of forces and estimates as FHIR observations, with the common elements of R4 and R5."""

from __future__ import annotations

import base64
import math
from datetime import UTC
from typing import TYPE_CHECKING
from uuid import UUID, uuid5

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.files import SHA256, json_bytes
from tsis.model import INTERVAL_LEVEL, NO_UNIT, label_of, unit_of
from tsis.records._deidentify import deidentified, public_identity

if TYPE_CHECKING:
    from datetime import datetime

    from tsis.records._target_record import TargetRecord
    from tsis.records._values import StoredEstimate, StoredPress


Resource = dict[str, object]

ROOT = UUID("6f4c1a52-3b0e-5d0e-9a57-2f6f2f3a1d11")  # of every name below; must never change
CODES = f"urn:uuid:{uuid5(ROOT, 'quantities')}"
TARGETS = f"urn:uuid:{uuid5(ROOT, 'targets')}"
PROBES = f"urn:uuid:{uuid5(ROOT, 'probes')}"
UCUM = "http://unitsofmeasure.org"
ABSENT = "http://terminology.hl7.org/CodeSystem/data-absent-reason"
ABSENT_EXTENSION = "http://hl7.org/fhir/StructureDefinition/data-absent-reason"
DIGITS = 6  # significant digits, more than any measurement has


def urn(kind: str, identity: str) -> str:
    """A name of a resource that is the same in every export."""
    return f"urn:uuid:{uuid5(ROOT, f'{kind}/{identity}')}"


def concept(code: str, text: str) -> Resource:
    """A concept of this program."""
    return {"coding": [{"system": CODES, "code": code, "display": text}], "text": text}


def quantity(name: str, value: float) -> Resource:
    """A number with the unit at the end of the quantity's name."""
    unit = unit_of(name)
    rounded = float(f"{value:.{DIGITS}g}")
    shown = {} if unit == NO_UNIT else {"unit": unit}  # FHIR has no empty text
    return {"value": rounded, **shown, "system": UCUM, "code": unit}


def absent(code: str, why: str) -> Resource:
    """The reason for a missing value."""
    return {"coding": [{"system": ABSENT, "code": code}], "text": why}


def component(code: str, text: str, name: str, value: float) -> Resource:
    """A component of an observation: a number in the unit of ``name``, or the reason why it is missing."""
    coded: Resource = {"code": concept(code, text)}
    if not math.isfinite(value):
        return coded | {"dataAbsentReason": absent("positive-infinity", "infinite: the data tell nothing of it")}
    return coded | {"valueQuantity": quantity(name, value)}


def hashed(sha256: str, what: str) -> Resource:
    """A reference to content by its SHA-256, in the form of RFC 6920."""
    digest = base64.urlsafe_b64encode(bytes.fromhex(sha256)).rstrip(b"=").decode()
    name = {"system": "urn:ietf:rfc:3986", "value": f"ni:///sha-256;{digest}"}
    return {"type": "DocumentReference", "identifier": name, "display": f"{what}, SHA-256 {sha256}"}


def unit_text(name: str) -> str:
    """The name of a quantity for people."""
    return label_of(name).capitalize()


METHODS = {
    "inclusion": "Optical tactile imaging: posterior of a press model, given frames of the probe pressed on tissue",
    "hardness": "Optical tactile imaging: posterior of a contact model, given frames of the probe on the object itself",
}
FORCE_METHOD = "Force of the press on the probe"
UNTRUSTED = "not trusted: the model does not hold for these frames"
UNIDENTIFIED = "not identified: the data tell hardly more than was believed before; see the interval"


def force_observation(press: StoredPress, subject: Resource, device: Resource, *, identified: bool) -> Resource:
    assert press.force_n is not None
    sources = {"derivedFrom": [hashed(press.frame, "Frame")]} if SHA256.fullmatch(press.frame) else {}
    return {
        **_frame_of("force_n", "Force of a press", subject, device, press.taken, identified=identified),
        "method": {"text": FORCE_METHOD},
        "valueQuantity": quantity("force_n", press.force_n),
        **sources,
    }


def estimate_observations(
    record: TargetRecord, stored: StoredEstimate, subject: Resource, device: Resource, *, identified: bool
) -> list[Resource]:
    """An observation for each parameter, and one for the probability of presence."""
    presses = [press for press in record.presses if press.id in set(stored.presses)]
    when = max((press.taken for press in presses), default=stored.made)
    sources = [hashed(press.frame, "Frame") for press in presses if SHA256.fullmatch(press.frame)]
    if SHA256.fullmatch(stored.calibration):
        sources.append(hashed(stored.calibration, "Calibration"))
    common: Resource = {"method": {"text": METHODS[stored.kind]}}
    if sources:
        common["derivedFrom"] = sources
    if identified:
        common["issued"] = stored.made.isoformat(timespec="seconds")
    results = []
    for name in stored.estimate.names:
        frame = _frame_of(name, unit_text(name), subject, device, when, identified=identified)
        results.append(frame | common | _value(stored, name))
    if stored.estimate.presence is not None:
        frame = _frame_of("presence", "Probability of presence", subject, device, when, identified=identified)
        results.append(frame | common | _presence(stored, stored.estimate.presence))
    return results


def _frame_of(
    code: str, text: str, subject: Resource, device: Resource, when: datetime, *, identified: bool
) -> Resource:
    """The common elements of an observation."""
    masked = {"extension": [{"url": ABSENT_EXTENSION, "valueCode": "masked"}]}
    time = {"effectiveDateTime": when.isoformat(timespec="seconds")} if identified else {"_effectiveDateTime": masked}
    return {
        "resourceType": "Observation",
        "status": "preliminary",
        "code": concept(code, text),
        "subject": subject,
        "device": device,
        "note": [{"text": RESEARCH_USE_ONLY}],
        **time,
    }


def _value(stored: StoredEstimate, name: str) -> Resource:
    """The mean with its interval, or the reason why it is missing."""
    result = stored.estimate
    if not result.trusted:
        return {"dataAbsentReason": absent("error", UNTRUSTED)}
    low, high = result.interval(INTERVAL_LEVEL)[name]
    tail = (1 - INTERVAL_LEVEL) / 2
    interval = f"{INTERVAL_LEVEL:.0%} credible interval"
    parts = [
        component("interval-low", f"{interval}, lower end ({tail:.0%} quantile)", name, low),
        component("interval-high", f"{interval}, upper end ({1 - tail:.0%} quantile)", name, high),
        component("prior-sd", "Standard deviation of the prior", name, result.prior_sd[name]),
    ]
    if name in result.cramer_rao_sd:
        bound = result.cramer_rao_sd[name]
        parts.append(component("cramer-rao-sd", "Least standard deviation of any unbiased estimate", name, bound))
    if result.identified(name):
        parts.append(component("sd", "Standard deviation of the posterior", name, result.sd[name]))
    else:
        return {"dataAbsentReason": absent("unknown", UNIDENTIFIED), "component": parts}
    return {"valueQuantity": quantity(name, result.mean[name]), "component": parts}


def _presence(stored: StoredEstimate, presence: float) -> Resource:
    if not stored.estimate.presence_trusted:
        return {"dataAbsentReason": absent("error", UNTRUSTED)}
    return {"valueQuantity": quantity("presence", presence)}


def fhir_observations(record: TargetRecord, *, identified: bool = False) -> bytes:
    """A FHIR Bundle of type ``collection`` as JSON, valid as R4B and as R5.

    Parameters
    ----------
    record
        Target, presses and active estimates.
    identified
        Whether to include times, kind, number and label of the target. Otherwise times are masked and the record is
        de-identified (`tsis.records._deidentify`).

    Notes
    -----
    A phantom is a Device, a subject a Patient with a pseudonym alone. Free text is never exported.
    """
    record = record if identified else deidentified(record)
    subject = {"reference": urn("target", record.target.id or str(record.target.number))}
    entries = [(subject["reference"], _subject(record, identified=identified))]
    entries += [(urn("probe", name), _probe(name)) for name in _probes(record)]
    for number, press in enumerate(record.presses):
        if press.force_n is not None:
            name = urn("force", press.id or f"{subject['reference']}/{number}")
            device: Resource = {"reference": urn("probe", press.probe)}
            entries.append((name, force_observation(press, dict(subject), device, identified=identified)))
    for stored in record.active_estimates:
        device = {"reference": urn("probe", stored.probe)}
        created = estimate_observations(record, stored, dict(subject), device, identified=identified)
        name = stored.id or f"{subject['reference']}/{stored.kind}"
        entries += [(urn("estimate", f"{name}/{number}"), item) for number, item in enumerate(created)]
    bundle: Resource = {"resourceType": "Bundle", "type": "collection"}
    times = [press.taken for press in record.presses] + [stored.made for stored in record.estimates]
    if identified and times:
        bundle["timestamp"] = max(times).astimezone(UTC).isoformat(timespec="seconds")
    bundle["entry"] = [{"fullUrl": name, "resource": resource} for name, resource in entries]
    return json_bytes(bundle)


def _probes(record: TargetRecord) -> list[str]:
    names = [press.probe for press in record.presses if press.force_n is not None]
    return sorted({*names, *(stored.probe for stored in record.active_estimates)})


def _subject(record: TargetRecord, *, identified: bool) -> Resource:
    target = record.target
    identifiers = [{"system": TARGETS, "value": public_identity(target) if identified else target.id}]
    if identified and target.name:
        identifiers.append({"system": TARGETS, "value": target.name})
    if target.kind == "subject":
        return {"resourceType": "Patient", "identifier": identifiers}
    return {
        "resourceType": "Device",
        "identifier": identifiers,
        "status": "active",
        "modelNumber": "phantom",
        "note": [{"text": RESEARCH_USE_ONLY}],
    }


def _probe(name: str) -> Resource:
    return {
        "resourceType": "Device",
        "identifier": [{"system": PROBES, "value": name or "unnamed"}],
        "status": "active",
        "modelNumber": name or "unnamed",
        "version": [{"value": f"tsis {__version__}"}],
        "note": [{"text": RESEARCH_USE_ONLY}],
    }
