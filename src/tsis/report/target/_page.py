"""Report of a target: everything that a store holds of it, on one page."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.report._hardness import estimate_cards
from tsis.report._page import Card, Page
from tsis.report.target._pictures import target_gallery
from tsis.report.target._tables import target_tables
from tsis.report.target._text import count_of, heading, newest_first, roles, target_notes, time_text, without_identity

if TYPE_CHECKING:
    from tsis.records import StoredEstimate, StoredPress, TargetRecord


def target_page(dossier: TargetRecord) -> Page:
    """The page of a target, for `tsis.report.html` and `tsis.report.paper.pdf`.

    Parameters
    ----------
    dossier
        All that the store holds of it; with no estimate, scale, force or calibration the page says so.

    Returns
    -------
    Page
        The estimates in force, the newest first, pictures of the strongest press, every press with its flags,
        calibrations, all estimates and where each number came from. That of a subject shows the pseudonym and no
        other name.
    """
    dossier = without_identity(dossier)
    target, gallery = dossier.target, target_gallery(dossier)
    name = f": {target.name}" if target.name else ""
    return Page(
        title=f"{'Subject, target' if target.kind == 'subject' else 'Target'} {target.number}{name}",
        subtitle=_subtitle(dossier),
        cards=target_cards(dossier),
        notes=(*target_notes(dossier), *gallery.notes),
        pictures=gallery.pictures,
        tables=target_tables(dossier),
        provenance=_provenance(dossier),
    )


def _subtitle(dossier: TargetRecord) -> str:
    presses = dossier.presses
    if not presses:
        return f"{dossier.target.kind}, entered {time_text(dossier.target.made)} UTC, nothing recorded"
    first, last = min(press.taken for press in presses), max(press.taken for press in presses)
    taken = time_text(first) if first == last else f"{time_text(first)} to {time_text(last)}"
    probes = ", ".join(sorted({press.probe for press in presses if press.probe})) or "not named"
    return f"{dossier.target.kind}, probe {probes}, recorded {taken} UTC"


def target_cards(dossier: TargetRecord) -> tuple[Card, ...]:
    """The numbers of the estimates in force, the newest first; what there is to estimate from where there is none."""
    found = newest_first(dossier)
    if not found:
        return (
            Card(title="Estimate", value="none yet", detail="the frames are kept and can be estimated", doubtful=True),
            Card(title="Recorded", value=count_of(len(dossier.presses), "press"), detail=roles(dossier.presses)),
        )
    cards = []
    for stored in found:
        own = estimate_cards(stored, dossier.target.truth)
        cards += [replace(card, title=heading(dossier, stored, card.title)) for card in own]
    return tuple(cards)


def _provenance(dossier: TargetRecord) -> dict[str, Any]:
    """Where every number came from, with whole hashes and identities."""
    target = dossier.target
    found = {heading(dossier, each, "estimate in force"): _estimate(each) for each in newest_first(dossier)}
    stored = {} if len(found) > 1 else next(iter(found.values()), {})
    return {
        "target": {"id": target.id, "version": target.version, "entered": time_text(target.made) + " UTC"},
        "report": f"tsis {__version__}",
        **(stored or found),
        **{f"press {number}": _press(press) for number, press in enumerate(dossier.presses, 1)},
        "calibrations": [
            {"name": known.name, "sha256": identity} for identity, known in sorted(dossier.calibrations.items())
        ],
    }


def _estimate(stored: StoredEstimate) -> dict[str, Any]:
    return {
        "estimate in force": {
            "id": stored.id,
            "kind": stored.kind,
            "probe": stored.probe,
            "calibration": stored.calibration,
            "supersedes": stored.supersedes or "nothing",
            "presses": list(stored.presses),
        },
        "options": dict(stored.options),
        "environment": dict(stored.environment),
        "computed from": dict(stored.estimate.provenance),
    }


def _press(press: StoredPress) -> str:
    """One line a press: there may be hundreds."""
    said = [
        f"frame {press.frame}",
        f"id {press.id}, version {press.version}",
        f"{press.columns} × {press.rows} pixels, full scale {press.full_scale:g}",
        "axis at ({:g}, {:g}) px".format(*press.axis_px),
        f"probe {press.probe or 'not named'}",
        f"calibration {press.calibration or 'none'}",
        *(f"{name} {value}" for name, value in press.settings.items()),
    ]
    return "; ".join(said)
