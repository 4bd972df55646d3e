"""Unblinding and verification of a study, and its results with the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import (
    cards,
    dialog_buttons,
    figure,
    list_message,
    loading,
    message_list,
    open_dialog,
    panel_title,
    unit_field,
)
from tsis.console.pages.study._context import name_in, study_result, who_field
from tsis.console.studies import begin_publishing, unread
from tsis.report.target import count_of
from tsis.study import verify_study

if TYPE_CHECKING:
    from tsis.console.pages.study._context import StudyContext, StudyResult, StudyView
    from tsis.study import Study, StudyVerification


class Outcome:
    """A panel that is there once the study is unblinded."""

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        self._panel = ui.element("section").classes("panel stack").props('aria-label="Results of the study"')
        self._panel.set_visibility(False)

    async def show(self, view: StudyView) -> StudyResult | None:
        """Show and return the numbers; None while the study is blind, or without numbers."""
        if view.study.unblinded is None:
            return None
        self._panel.set_visibility(True)
        self._panel.clear()
        with self._panel:
            ui.label("Setting the readings beside the truth ...").classes("muted").props('role="status"')
        result = await self._page.viewer.attempt(study_result, view.study)
        self._panel.clear()
        with self._panel:
            self._head(view)
            if result is None:
                ui.label("The numbers are not available; Verify shows what is wrong.").classes("flag")
            else:
                self._body(result)
        return result

    def _head(self, view: StudyView) -> None:
        with ui.element("div").classes("row"):
            panel_title("Results of the study")
            ui.element("div").classes("spring")
            if view.reported:
                position = f"/files/study/{self._page.name}/report"
                ui.link("Report", f"{position}.html", new_tab=True).classes("link button")
                ui.link("PDF", f"{position}.pdf").classes("link button").props("download")
            else:
                ui.label("No report was written yet: Analyse again writes it.").classes("muted")

    def _body(self, result: StudyResult) -> None:
        cards(result.page.cards)
        with ui.element("div").classes("study-outcome"):
            if result.curves:
                figure(result.page.pictures[0], result.curves)
            with ui.element("div"):
                panel_title("To know", level=3)
                with ui.element("div").classes("wordy"):
                    message_list(result.page.notes)


MOST_SHOWN = 5  # faults
MEANT = (
    "The seal is opened: from then on the codes stand beside what they are, and no reading is taken any more. Who "
    "did it and when is entered in the log of the study, once, and cannot be taken back. Then the readings are "
    "analysed and the report is written."
)
FAULTY = "The study is not as it was written; that is entered too:"


class Unblinding:
    """The button, and its dialog."""

    def __init__(self, page: StudyContext) -> None:
        self._page, self._blind = page, True
        self._dialog: ui.dialog | None = None
        self._who: ui.input | None = None
        self._container = ui.element("div")
        self._button = ui.button("Unblind and analyse", icon="visibility", on_click=self._clicked)
        self._button.props("dense no-caps outline")

    async def show(self, view: StudyView) -> None:
        """Say what a click would do; an open dialog is asked anew, since it told of the study before."""
        self._blind = view.study.unblinded is None
        self._button.text = "Unblind and analyse" if self._blind else "Analyse again"
        if self._dialog is not None and not self._dialog.is_deleted and self._dialog.value:
            who = "" if self._who is None else self._who.value or ""
            self._dialog.delete()
            await self._clicked()
            if self._who is not None and who:
                self._who.set_value(who)

    async def _clicked(self) -> None:
        page = self._page
        with loading(self._button):
            result = await page.viewer.attempt(
                lambda: (page.repository.study(page.name), verify_study(page.repository.path(page.name)))
            )
        if result is not None:
            self._confirm(*result)

    def _confirm(self, study: Study, verification: StudyVerification) -> None:
        page, left = self._page, unread(study)
        blind = study.unblinded is None
        title = f"{'Unblind' if blind else 'Analyse'} study {study.plan.name}"
        with open_dialog(self._container, title, style="dialog-card study-dialog") as dialog:
            self._dialog = dialog
            if blind:
                ui.label(f"{MEANT} The study has {count_of(len(study.readings), 'reading')}.")
            if verification.faults:
                ui.label(FAULTY).classes("flag")
                message_list(str(fault) for fault in verification.faults[:MOST_SHOWN])
            although = ui.checkbox("although incomplete").props("dense")
            although.set_visibility(blind and bool(left))
            if blind:
                for device, lacking in left:
                    ui.label(f"{device} lacks {lacking} of {count_of(len(study.plan.codes), 'target')}.").classes(
                        "flag"
                    )
            self._who = who = who_field(page.viewer, "Done by")

            async def begin() -> None:
                with loading(button):
                    job = await page.viewer.attempt(
                        begin_publishing,
                        page.jobs,
                        page.repository,
                        page.name,
                        by=name_in(page.viewer, who),
                        although_incomplete=bool(although.value),
                    )
                if job is not None:
                    dialog.close()

            button = dialog_buttons(dialog, "Unblind and analyse" if blind else "Analyse", begin)


MOST_FAULTS_SHOWN = 100  # faults; a study that has more has one cause
VERIFICATION_MEANING = (
    "Lines that were cut off the end of the log, and a log that was written anew, show only beside a head that was "
    "kept elsewhere."
)


def verify_button(page: StudyContext, place: ui.element) -> None:
    """A button that verifies plan, seal, reports and log, and shows the result in ``place``."""

    async def begin(head: str = "") -> None:
        with loading(button):
            result = await page.viewer.attempt(
                lambda: verify_study(page.repository.path(page.name), head=head.strip() or None)
            )
        if result is not None:
            place.clear()
            with place:
                show(result, head)

    def show(verification: StudyVerification, head: str) -> None:
        with ui.element("section").classes("outcome").props('role="status"'):
            panel_title("Verification", level=3)
            ui.label(verdict(verification)).classes("good" if verification.sound else "flag")
            with message_list():
                for fault in verification.faults[:MOST_FAULTS_SHOWN]:
                    list_message(str(fault), "doubtful")
            if len(verification.faults) > MOST_FAULTS_SHOWN:
                ui.label(f"and {len(verification.faults) - MOST_FAULTS_SHOWN} more (tsis study verify shows all)")
            ui.label(f"Head of the log: {verification.head}").classes("muted identity")
            with ui.element("div").classes("row"):
                saved = unit_field("Head that was saved elsewhere", head, keys="text").classes("study-head")
                ui.button("Compare", on_click=lambda: begin(saved.value or "")).props("dense no-caps outline")
                ui.button("Close", on_click=place.clear).props("dense no-caps flat")
            ui.label(VERIFICATION_MEANING).classes("muted")

    button = ui.button("Verify", icon="verified_user", on_click=lambda: begin()).props("dense no-caps outline")


def verdict(verification: StudyVerification) -> str:
    """Whether the study is unchanged."""
    if verification.sound:
        return f"The study is as it was written, all {count_of(verification.lines, 'line')} of its log."
    return f"The study is NOT as it was written: it differs in {count_of(len(verification.faults), 'place')}."
