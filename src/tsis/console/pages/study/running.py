"""The virtual probe reads: begun, and gone on with, by anybody who has the page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.study.who import name_in, who_field
from tsis.console.studies import begin_reading

if TYPE_CHECKING:
    from tsis.console.pages.study.context import StudyContext
    from tsis.console.pages.study.seen import StudySeen

MEANT = (
    "The virtual probe of this study presses what is left, under the codes. It needs no camera. End it at any time: "
    "what was read is kept, and the next run goes on there. Another operator reads every target anew."
)


class Running:
    """Operator and button.

    Parameters
    ----------
    page
        Of the study.
    """

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        self._named = False
        panel_title("Virtual probe")
        ui.label(MEANT).classes("muted")
        with ui.element("div").classes("row"):
            self._who = who_field(page.viewer, "Operator")
            self._begin = ui.button("Run on the virtual probe", icon="play_arrow", on_click=self._run).props("no-caps")

    def show(self, found: StudySeen) -> None:
        """Go on for who read before, unless somebody has typed already."""
        before = [each for each in found.devices if each.device == found.study.plan.device and each.read < each.wanted]
        if before and not self._named and not self._page.viewer.logged_in:
            self._who.set_value(max(before, key=lambda each: each.read).operator)
        self._named = True

    def allow(self, wanted: bool) -> None:
        """Let it be begun, or not while something is under way."""
        self._begin.set_enabled(wanted)

    async def _run(self) -> None:
        page = self._page
        with loading(self._begin):
            await page.viewer.attempt(
                begin_reading, page.jobs, page.shelf, page.name, operator=name_in(page.viewer, self._who)
            )


__all__ = ["Running"]
