"""The report of a blinded study."""

from tsis.report.study._card import card_document, card_page
from tsis.report.study._document import (
    ends,
    few_notes,
    fraction_text,
    interval_text,
    method_of,
    record_notes,
    study_document,
    study_verification_document,
    undecided_notes,
)
from tsis.report.study._drift import drift_document, drift_notes, drift_page, drift_tables
from tsis.report.study._kit import kit_document, kit_page, score_document, score_page
from tsis.report.study._page import PAGE, PAPER, publish_study, study_page
from tsis.report.study._precision import precision_document, precision_notes, precision_page, precision_tables
from tsis.report.study._tables import targets_table

__all__ = [
    "PAGE",
    "PAPER",
    "card_document",
    "card_page",
    "drift_document",
    "drift_notes",
    "drift_page",
    "drift_tables",
    "ends",
    "few_notes",
    "fraction_text",
    "interval_text",
    "kit_document",
    "kit_page",
    "method_of",
    "precision_document",
    "precision_notes",
    "precision_page",
    "precision_tables",
    "publish_study",
    "record_notes",
    "score_document",
    "score_page",
    "study_document",
    "study_page",
    "study_verification_document",
    "targets_table",
    "undecided_notes",
]
