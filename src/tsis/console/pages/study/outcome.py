"""What an unblinded study says: its numbers with their intervals, its curves, and the way to the report."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.report_parts import cards, figure
from tsis.console.pages.sentence_list import sentence_list
from tsis.console.pages.study.seen import told

if TYPE_CHECKING:
    from tsis.console.pages.study.context import StudyContext
    from tsis.console.pages.study.seen import StudySeen, Told


class Outcome:
    """A panel that is there once the study is unblinded.

    Parameters
    ----------
    page
        Of the study.
    """

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        self._panel = ui.element("section").classes("panel stack").props('aria-label="What the study says"')
        self._panel.set_visibility(False)

    async def show(self, found: StudySeen) -> Told | None:
        """Show the numbers, and give them; None while the study is blind, or when they cannot be told."""
        if found.study.unblinded is None:
            return None
        self._panel.set_visibility(True)
        self._panel.clear()
        with self._panel:
            ui.label("Setting the readings beside the truth ...").classes("muted").props('role="status"')
        said = await self._page.viewer.attempt(told, found.study)
        self._panel.clear()
        with self._panel:
            self._head(found)
            if said is None:
                ui.label("The numbers cannot be told; Verify says what is wrong.").classes("flag")
            else:
                self._body(said)
        return said

    def _head(self, found: StudySeen) -> None:
        with ui.element("div").classes("row"):
            panel_title("What the study says")
            ui.element("div").classes("spring")
            if found.reported:
                place = f"/files/study/{self._page.name}/report"
                ui.link("Report", f"{place}.html", new_tab=True).classes("link button")
                ui.link("PDF", f"{place}.pdf").classes("link button").props("download")
            else:
                ui.label("No report was written yet: Analyse again writes it.").classes("muted")

    def _body(self, said: Told) -> None:
        cards(said.page.cards)
        with ui.element("div").classes("study-outcome"):
            if said.curves:
                figure(said.page.pictures[0], said.curves)
            with ui.element("div"):
                panel_title("To know", level=3)
                with ui.element("div").classes("wordy"):
                    sentence_list(said.page.notes)


__all__ = ["Outcome"]
