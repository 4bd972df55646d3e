"""What was estimated of a target: the numbers in force, and all that came before them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.report_parts import cards, table
from tsis.console.pages.sentence_list import listed, sentence_list
from tsis.report.stored import estimate_sentences
from tsis.report.subject import SAID
from tsis.report.target import target_cards
from tsis.report.target_tables import history_tables
from tsis.report.target_words import newest_first, origin

if TYPE_CHECKING:
    from tsis.console.pages.records.reading import TargetSeen

NONE_YET = "Nothing was estimated yet. Estimate needs presses that were taken under a calibration."


def estimates(seen: TargetSeen) -> None:
    """Show the estimates in force, and what of the target is damaged."""
    panel_title("Estimates in force", level=3)
    found = newest_first(seen.dossier)
    if found:
        cards(target_cards(seen.dossier))
    else:
        ui.label(NONE_YET).classes("muted")
    with sentence_list():
        for stored in found:
            for sentence in (*estimate_sentences(stored), origin(stored)):
                listed(f"Of the {stored.kind}: {sentence}" if len(found) > 1 else sentence)
            if stored.estimate.flags:
                listed(f"Flags: {', '.join(stored.estimate.flags)}", "doubtful")
        for sentence in seen.dossier.damaged:
            listed(f"Left out: {sentence}", "flag")
    if seen.private:
        ui.label(SAID).classes("muted")


def history(seen: TargetSeen) -> None:
    """Show every estimate that was ever made."""
    found = history_tables(seen.dossier)
    for each in found:
        table(each)
    if not found:
        panel_title("History", level=3)
        ui.label("No estimate was made yet.").classes("muted")
