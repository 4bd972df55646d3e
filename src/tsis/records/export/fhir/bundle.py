"""The Bundle: the target, the probes, and what was measured."""

from __future__ import annotations

import json
from datetime import UTC
from typing import TYPE_CHECKING

from tsis.__about__ import RESEARCH_USE_ONLY, __version__
from tsis.records.deidentified import deidentified
from tsis.records.export.fhir.observations import estimate_observations, force_observation
from tsis.records.export.fhir.terms import PROBES, TARGETS, Resource, urn
from tsis.records.pseudonym import shown_identity

if TYPE_CHECKING:
    from tsis.records.dossier import TargetRecord


def fhir_observations(dossier: TargetRecord, *, identified: bool = False) -> bytes:
    """A FHIR Bundle of type ``collection`` as JSON, valid as R4B and as R5.

    Parameters
    ----------
    dossier
        Target, presses and estimates; of each kind of estimate the last is told.
    identified
        Whether times, kind, number and label of the target are told. Otherwise times are masked, a pseudonym stands
        for the target, and `tsis.records.deidentified` says what else is left out.

    Notes
    -----
    A phantom is a Device, a subject a Patient of whom nothing but a pseudonym is known. Free text never leaves.
    """
    dossier = dossier if identified else deidentified(dossier)
    subject = {"reference": urn("target", dossier.target.id or str(dossier.target.number))}
    entries = [(subject["reference"], _subject(dossier, identified=identified))]
    entries += [(urn("probe", name), _probe(name)) for name in _probes(dossier)]
    for number, press in enumerate(dossier.presses):
        if press.force_n is not None:
            name = urn("force", press.id or f"{subject['reference']}/{number}")
            device: Resource = {"reference": urn("probe", press.probe)}
            entries.append((name, force_observation(press, dict(subject), device, identified=identified)))
    for stored in dossier.in_force:
        device = {"reference": urn("probe", stored.probe)}
        made = estimate_observations(dossier, stored, dict(subject), device, identified=identified)
        name = stored.id or f"{subject['reference']}/{stored.kind}"
        entries += [(urn("estimate", f"{name}/{number}"), each) for number, each in enumerate(made)]
    bundle: Resource = {"resourceType": "Bundle", "type": "collection"}
    times = [press.taken for press in dossier.presses] + [stored.made for stored in dossier.estimates]
    if identified and times:
        bundle["timestamp"] = max(times).astimezone(UTC).isoformat(timespec="seconds")
    bundle["entry"] = [{"fullUrl": name, "resource": resource} for name, resource in entries]
    return (json.dumps(bundle, indent=2, allow_nan=False) + "\n").encode()


def _probes(dossier: TargetRecord) -> list[str]:
    names = [press.probe for press in dossier.presses if press.force_n is not None]
    return sorted({*names, *(stored.probe for stored in dossier.in_force)})


def _subject(dossier: TargetRecord, *, identified: bool) -> Resource:
    target = dossier.target
    known = [{"system": TARGETS, "value": shown_identity(target) if identified else target.id}]
    if identified and target.name:
        known.append({"system": TARGETS, "value": target.name})
    if target.kind == "subject":
        return {"resourceType": "Patient", "identifier": known}
    return {
        "resourceType": "Device",
        "identifier": known,
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
