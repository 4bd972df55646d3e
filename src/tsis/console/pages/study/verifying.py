"""Is the study as it was written? Asked from its page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.number_field import unit_field
from tsis.console.pages.sentence_list import listed, sentence_list
from tsis.report.target_words import count_of
from tsis.study import verify_study

if TYPE_CHECKING:
    from tsis.console.pages.study.context import StudyContext
    from tsis.study import StudyVerification

MOST_FAULTS_SHOWN = 100  # faults; a study that has more has one cause
VERIFICATION_MEANING = (
    "Lines that were cut off the end of the log, and a log that was written anew, show only beside a head that was "
    "kept elsewhere."
)


def verify_button(page: StudyContext, place: ui.element) -> None:
    """A button that compares plan, seal, reports and log, and shows in ``place`` what was found."""

    async def begin(head: str = "") -> None:
        with loading(button):
            found = await page.viewer.attempt(
                lambda: verify_study(page.shelf.place(page.name), head=head.strip() or None)
            )
        if found is not None:
            place.clear()
            with place:
                show(found, head)

    def show(found: StudyVerification, head: str) -> None:
        with ui.element("section").classes("told").props('role="status"'):
            panel_title("Verification", level=3)
            ui.label(verdict(found)).classes("good" if found.sound else "flag")
            with sentence_list():
                for fault in found.faults[:MOST_FAULTS_SHOWN]:
                    listed(str(fault), "doubtful")
            if len(found.faults) > MOST_FAULTS_SHOWN:
                ui.label(f"and {len(found.faults) - MOST_FAULTS_SHOWN} more (tsis study verify shows all)")
            ui.label(f"Head of the log: {found.head}").classes("muted identity")
            with ui.element("div").classes("row"):
                kept = unit_field("Head that was kept elsewhere", head, keys="text").classes("study-head")
                ui.button("Compare", on_click=lambda: begin(kept.value or "")).props("dense no-caps outline")
                ui.button("Close", on_click=place.clear).props("dense no-caps flat")
            ui.label(VERIFICATION_MEANING).classes("muted")

    button = ui.button("Verify", icon="verified_user", on_click=lambda: begin()).props("dense no-caps outline")


def verdict(found: StudyVerification) -> str:
    """Whether the study can be believed."""
    if found.sound:
        return f"The study is as it was written, all {count_of(found.lines, 'line')} of its log."
    return f"The study is NOT as it was written: it differs in {count_of(len(found.faults), 'place')}."


__all__ = ["verdict", "verify_button"]
