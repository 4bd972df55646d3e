"""The end of blindness, asked once more before it is entered; and analyses after it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.sentence_list import sentence_list
from tsis.console.pages.study.who import name_in, who_field
from tsis.console.studies import begin_publishing, unread
from tsis.report.target_words import count_of
from tsis.study import verify_study

if TYPE_CHECKING:
    from tsis.console.pages.study.context import StudyContext
    from tsis.console.pages.study.seen import StudySeen
    from tsis.study import Study, StudyVerification

MOST_SHOWN = 5  # faults
MEANT = (
    "The seal is opened: from then on the codes stand beside what they are, and no reading is taken any more. Who "
    "did it and when is entered in the log of the study, once, and cannot be taken back. Then the readings are "
    "analysed and the report is written."
)
FAULTY = "The study is not as it was written; that is entered too:"


class Unblinding:
    """The button, and its dialog.

    Parameters
    ----------
    page
        Of the study.
    """

    def __init__(self, page: StudyContext) -> None:
        self._page, self._blind = page, True
        self._place = ui.element("div")
        self._button = ui.button("Unblind and analyse", icon="visibility", on_click=self._clicked)
        self._button.props("dense no-caps outline")

    def show(self, found: StudySeen) -> None:
        """Say what a click would do."""
        self._blind = found.study.unblinded is None
        self._button.text = "Unblind and analyse" if self._blind else "Analyse again"

    async def _clicked(self) -> None:
        page = self._page
        with loading(self._button):
            found = await page.viewer.attempt(
                lambda: (page.shelf.study(page.name), verify_study(page.shelf.place(page.name)))
            )
        if found is not None:
            self._ask(*found)

    def _ask(self, study: Study, found: StudyVerification) -> None:
        page, left = self._page, unread(study)
        blind = study.unblinded is None
        with self._place, ui.dialog(value=True) as dialog, ui.card().classes("asked study-asked"):
            panel_title(f"{'Unblind' if blind else 'Analyse'} study {study.plan.name}")
            if blind:
                ui.label(f"{MEANT} The study has {count_of(len(study.readings), 'reading')}.")
            if found.faults:
                ui.label(FAULTY).classes("flag")
                sentence_list(str(fault) for fault in found.faults[:MOST_SHOWN])
            although = ui.checkbox("although incomplete").props("dense")
            although.set_visibility(blind and bool(left))
            if blind:
                for device, lacking in left:
                    ui.label(f"{device} lacks {lacking} of {count_of(len(study.plan.codes), 'target')}.").classes(
                        "flag"
                    )
            who = who_field(page.viewer, "Done by")

            async def begin() -> None:
                with loading(act):
                    job = await page.viewer.attempt(
                        begin_publishing,
                        page.jobs,
                        page.shelf,
                        page.name,
                        by=name_in(page.viewer, who),
                        although_incomplete=bool(although.value),
                    )
                if job is not None:
                    dialog.close()

            with ui.element("div").classes("row"):
                act = ui.button("Unblind and analyse" if blind else "Analyse", on_click=begin)
                act.props("no-caps dense unelevated")
                ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")
        dialog.on("hide", dialog.delete)


__all__ = ["Unblinding"]
