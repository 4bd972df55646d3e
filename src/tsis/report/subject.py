"""What the page of a subject is made of: the records without what may identify, but for label, number and times."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tsis.records import StoredEstimate, TargetRecord

SAID = (
    "Notes, settings, names of files, and probes and flags that tsis does not know are left out, since this is a "
    "subject: the page shows the pseudonym only."
)


def without_identity(dossier: TargetRecord) -> TargetRecord:
    """A phantom's as it is; a subject's with the label alone, which is a pseudonym, and identities of this page."""
    if dossier.target.kind != "subject":
        return dossier
    from tsis.records.deidentified import deidentified  # loads the libraries of records, as the dossier has

    found = deidentified(dossier)
    presses = {press.id: f"press {number}" for number, press in enumerate(found.presses, 1)}
    estimates = {stored.id: f"estimate {number}" for number, stored in enumerate(found.estimates, 1)}
    return replace(
        found,
        target=replace(found.target, id="not told", name=dossier.target.name),
        presses=tuple(replace(press, id=presses[press.id]) for press in found.presses),
        estimates=tuple(_renamed(stored, presses, estimates) for stored in found.estimates),
    )


def _renamed(stored: StoredEstimate, presses: dict[str, str], estimates: dict[str, str]) -> StoredEstimate:
    return replace(
        stored,
        id=estimates[stored.id],
        supersedes=estimates.get(stored.supersedes, "another") if stored.supersedes else None,
        presses=tuple(presses.get(each, "another press") for each in stored.presses),
    )
