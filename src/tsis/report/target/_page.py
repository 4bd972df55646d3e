"""The page of a target with all its stored data."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from tsis.__about__ import __version__
from tsis.report._hardness import estimate_cards
from tsis.report._page import Card, Page
from tsis.report.target._tables import target_tables
from tsis.report.target._text import (
    count_of,
    heading,
    newest_first,
    roles,
    target_gallery,
    target_notes,
    time_text,
    without_identity,
)

if TYPE_CHECKING:
    from tsis.records import StoredEstimate, StoredPress, TargetRecord


def target_page(record: TargetRecord) -> Page:
    """The page of a target, for `tsis.report.html` and `tsis.report.paper.pdf`.

    Parameters
    ----------
    record
        All that the store holds of it; with no estimate, scale, force or calibration the page says so.

    Returns
    -------
    Page
        The estimates in force, the newest first, pictures of the strongest press, every press with its flags,
        calibrations, all estimates and where each number came from. That of a subject shows the pseudonym and no
        other name.
    """
    record = without_identity(record)
    target, gallery = record.target, target_gallery(record)
    name = f": {target.name}" if target.name else ""
    return Page(
        title=f"{'Subject, target' if target.kind == 'subject' else 'Target'} {target.number}{name}",
        subtitle=_subtitle(record),
        cards=target_cards(record),
        notes=(*target_notes(record), *gallery.notes),
        pictures=gallery.pictures,
        tables=target_tables(record),
        provenance=_provenance(record),
    )


def _subtitle(record: TargetRecord) -> str:
    presses = record.presses
    if not presses:
        return f"{record.target.kind}, entered {time_text(record.target.made)} UTC, nothing recorded"
    first, last = min(press.taken for press in presses), max(press.taken for press in presses)
    taken = time_text(first) if first == last else f"{time_text(first)} to {time_text(last)}"
    probes = ", ".join(sorted({press.probe for press in presses if press.probe})) or "not named"
    return f"{record.target.kind}, probe {probes}, recorded {taken} UTC"


def target_cards(record: TargetRecord) -> tuple[Card, ...]:
    """The numbers of the active estimates, the newest first; without an estimate the available presses."""
    result = newest_first(record)
    if not result:
        return (
            Card(title="Estimate", value="none yet", detail="the frames are kept and can be estimated", doubtful=True),
            Card(title="Recorded", value=count_of(len(record.presses), "press"), detail=roles(record.presses)),
        )
    cards = []
    for stored in result:
        own = estimate_cards(stored, record.target.truth)
        cards += [replace(card, title=heading(record, stored, card.title)) for card in own]
    return tuple(cards)


def _provenance(record: TargetRecord) -> dict[str, Any]:
    """Provenance with whole hashes and identities."""
    target = record.target
    results = {heading(record, item, "estimate in force"): _estimate(item) for item in newest_first(record)}
    stored = {} if len(results) > 1 else next(iter(results.values()), {})
    return {
        "target": {"id": target.id, "version": target.version, "entered": time_text(target.made) + " UTC"},
        "report": f"tsis {__version__}",
        **(stored or results),
        **{f"press {number}": _press(press) for number, press in enumerate(record.presses, 1)},
        "calibrations": [
            {"name": calibration.name, "sha256": identity}
            for identity, calibration in sorted(record.calibrations.items())
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
    """A line for each press: there may be hundreds."""
    messages = [
        f"frame {press.frame}",
        f"id {press.id}, version {press.version}",
        f"{press.columns} × {press.rows} pixels, full scale {press.full_scale:g}",
        "axis at ({:g}, {:g}) px".format(*press.axis_px),
        f"probe {press.probe or 'not named'}",
        f"calibration {press.calibration or 'none'}",
        *(f"{name} {value}" for name, value in press.settings.items()),
    ]
    return "; ".join(messages)
