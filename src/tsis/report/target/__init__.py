"""The report of a target with all its stored data."""

from tsis.report.target._page import target_cards, target_page
from tsis.report.target._tables import history_tables, measure, parameter_label
from tsis.report.target._text import IDENTITY_NOTE, SHORT, count_of, newest_first, origin, time_text, without_identity

__all__ = [
    "IDENTITY_NOTE",
    "SHORT",
    "count_of",
    "history_tables",
    "measure",
    "newest_first",
    "origin",
    "parameter_label",
    "target_cards",
    "target_page",
    "time_text",
    "without_identity",
]
