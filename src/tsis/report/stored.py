"""One stored estimate as reports and the console show it: its cards, and what a reader must know of it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tsis.report.document import estimate_messages
from tsis.report.hardness import hardness_card, hardness_notes
from tsis.report.inclusion import inclusion_cards

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.records import StoredEstimate
    from tsis.report.page import Card

HARDNESS = "hardness"


def estimate_cards(stored: StoredEstimate, truth: Mapping[str, float]) -> tuple[Card, ...]:
    """The numbers of an estimate of either kind, with the truth where it is known."""
    if stored.kind == HARDNESS:
        return (hardness_card(stored.estimate, truth.get("young_kpa")),)
    return inclusion_cards(stored.estimate, truth)


def estimate_sentences(stored: StoredEstimate) -> tuple[str, ...]:
    """What a reader must know besides the numbers, the most important first."""
    return hardness_notes(stored.estimate) if stored.kind == HARDNESS else estimate_messages(stored.estimate)
