"""Observations: one a press with a measured force, and one a parameter of each estimate in force."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY
from tsis.model.estimate import INTERVAL_LEVEL
from tsis.records.canonical import SHA256
from tsis.records.export.fhir.terms import (
    ABSENT_EXTENSION,
    Resource,
    absent,
    component,
    concept,
    hashed,
    quantity,
    words,
)

if TYPE_CHECKING:
    from datetime import datetime

    from tsis.records.dossier import TargetRecord
    from tsis.records.values import StoredEstimate, StoredPress

METHODS = {
    "inclusion": "Optical tactile imaging: posterior of a press model, given frames of the probe pressed on tissue",
    "hardness": "Optical tactile imaging: posterior of a contact model, given frames of the probe on the object itself",
}
FORCE_METHOD = "Force of the press on the probe"
UNTRUSTED = "not trusted: the model does not hold for these frames"
UNIDENTIFIED = "not identified: the data tell hardly more than was believed before; see the interval"


def force_observation(press: StoredPress, subject: Resource, device: Resource, *, identified: bool) -> Resource:
    """The force of one press."""
    assert press.force_n is not None
    seen = {"derivedFrom": [hashed(press.frame, "Frame")]} if SHA256.fullmatch(press.frame) else {}
    return {
        **_frame_of("force_n", "Force of a press", subject, device, press.taken, identified=identified),
        "method": {"text": FORCE_METHOD},
        "valueQuantity": quantity("force_n", press.force_n),
        **seen,
    }


def estimate_observations(
    dossier: TargetRecord, stored: StoredEstimate, subject: Resource, device: Resource, *, identified: bool
) -> list[Resource]:
    """One observation a parameter, and one of the probability that there is anything at all."""
    presses = [each for each in dossier.presses if each.id in set(stored.presses)]
    when = max((press.taken for press in presses), default=stored.made)
    sources = [hashed(press.frame, "Frame") for press in presses if SHA256.fullmatch(press.frame)]
    if SHA256.fullmatch(stored.calibration):
        sources.append(hashed(stored.calibration, "Calibration"))
    common: Resource = {"method": {"text": METHODS[stored.kind]}}
    if sources:
        common["derivedFrom"] = sources
    if identified:
        common["issued"] = stored.made.isoformat(timespec="seconds")
    found = []
    for name in stored.estimate.samples:
        frame = _frame_of(name, words(name), subject, device, when, identified=identified)
        found.append(frame | common | _value(stored, name))
    if stored.estimate.presence is not None:
        frame = _frame_of("presence", "Probability of presence", subject, device, when, identified=identified)
        found.append(frame | common | _presence(stored, stored.estimate.presence))
    return found


def _frame_of(
    code: str, text: str, subject: Resource, device: Resource, when: datetime, *, identified: bool
) -> Resource:
    """What every observation has."""
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
    """The mean with its interval; what may not be used is not there."""
    found = stored.estimate
    if not found.trusted:
        return {"dataAbsentReason": absent("error", UNTRUSTED)}
    low, high = found.interval(INTERVAL_LEVEL)[name]
    tail = (1 - INTERVAL_LEVEL) / 2
    parts = [
        component(
            "interval-low", f"{INTERVAL_LEVEL:.0%} credible interval, lower end ({tail:.0%} quantile)", name, low
        ),
        component(
            "interval-high", f"{INTERVAL_LEVEL:.0%} credible interval, upper end ({1 - tail:.0%} quantile)", name, high
        ),
        component("sd", "Standard deviation of the posterior", name, found.sd[name]),
        component("prior-sd", "Standard deviation of the prior", name, found.prior_sd[name]),
    ]
    if name in found.cramer_rao_sd:
        bound = found.cramer_rao_sd[name]
        parts.append(component("cramer-rao-sd", "Least standard deviation of any unbiased estimate", name, bound))
    if not found.identified(name):
        return {"dataAbsentReason": absent("unknown", UNIDENTIFIED), "component": parts}
    return {"valueQuantity": quantity(name, found.mean[name]), "component": parts}


def _presence(stored: StoredEstimate, presence: float) -> Resource:
    if not stored.estimate.trusted:
        return {"dataAbsentReason": absent("error", UNTRUSTED)}
    return {"valueQuantity": quantity("presence", presence)}
