"""All studies of the console, and a new one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.loading import loading
from tsis.console.pages.number_field import unit_field
from tsis.console.pages.study.drafted import LIKE, StudyDraft
from tsis.console.pages.study.who import name_in, who_field
from tsis.console.pages.table import cell, rows_under
from tsis.console.studies import StudyShelf
from tsis.model import list_probes

if TYPE_CHECKING:
    from tsis.console.bench import Bench
    from tsis.console.pages.viewer import Viewer
    from tsis.console.studies import StudyGlimpse

EVERY_S = 1.0
HEADINGS = ("Study", "Targets", "Readings", "State")
NONE_YET = (
    "There is no study yet. Make one here: its targets get codes, in an order by chance, and what they are is sealed."
)
MEANT = (
    "Codes and order follow from the seed. Whoever knows it can read the truth; left empty it is drawn, and sealed "
    "with the truth. Targets, probe, forces and threshold are fixed once the study is made."
)


def listing(bench: Bench, viewer: Viewer) -> None:
    """Build the page."""
    shelf = StudyShelf(bench.terms.workspace)
    with ui.element("div").classes("split"):
        with ui.element("section").classes("panel stack"):
            panel_title("Studies")
            found = ui.element("div").classes("scroll")
        with ui.element("section").classes("panel stack"):
            _NewStudy(shelf, viewer)
    seen: list[object] = []

    async def look() -> None:
        stamps = await viewer.attempt(shelf.stamps)
        if stamps is None or seen == [stamps]:
            return
        seen[:] = [stamps]
        glimpses = await viewer.attempt(shelf.glimpses)
        if glimpses is not None:
            found.clear()
            with found:
                _show(glimpses)

    viewer.every(EVERY_S, look)


def _show(glimpses: tuple[StudyGlimpse, ...]) -> None:
    if not glimpses:
        ui.label(NONE_YET).classes("muted")
        return
    with rows_under(HEADINGS, label="Studies"):
        for each in glimpses:
            if each.trouble:
                with ui.element("tr"):
                    cell(each.name)
                    with ui.element("td").props("colspan=3"):
                        ui.label(each.trouble).classes("flag wordy")
                continue
            with ui.element("tr"):
                with ui.element("td"):
                    ui.link(each.name, f"/study/{each.name}").classes("link")
                cell(str(each.targets))
                cell(str(each.readings))
                cell(f"unblinded {each.unblinded}" if each.unblinded else "blinded").classes("wordy")


class _NewStudy:
    """The form of a new study."""

    def __init__(self, shelf: StudyShelf, viewer: Viewer) -> None:
        self._shelf, self._viewer = shelf, viewer
        start = StudyDraft()
        panel_title("New study")
        with ui.element("div").classes("study-fields"):
            self._name = unit_field("Name", keys="text").props("maxlength=200")
            self._who = who_field(viewer, "Made by")
            self._present = unit_field("With an inclusion", start.present, keys="numeric")
            self._blank = unit_field("Blanks", start.blank, keys="numeric")
            self._like = ui.select(LIKE, value=start.like, label="Targets")
            self._like.props("dense outlined options-dense").classes("study-wide")
            self._probe = ui.select(list(list_probes()), value=start.probe, label="Probe")
            self._probe.props("dense outlined options-dense")
            self._forces = unit_field("Forces", start.forces, unit="N", keys="text")
            self._forces.props("stack-label").props["placeholder"] = "usual of the probe"
            self._repeats = unit_field("Repeats", start.repeats, keys="numeric")
            self._threshold = unit_field("Threshold", start.threshold)
            self._seed = unit_field("Seed", start.seed, keys="numeric")
            self._seed.props("stack-label").props["placeholder"] = "drawn and sealed"
        self._reference = ui.checkbox("Press plain tissue nearby for comparison", value=start.with_reference)
        ui.label(MEANT).classes("muted")
        with ui.element("div").classes("row"):
            self._button = ui.button("Make the study", icon="add", on_click=self._make).props("no-caps")

    async def _make(self) -> None:
        draft = StudyDraft(
            name=self._name.value or "",
            like=str(self._like.value),
            present=self._present.value or "",
            blank=self._blank.value or "",
            forces=self._forces.value or "",
            probe=str(self._probe.value),
            with_reference=bool(self._reference.value),
            repeats=self._repeats.value or "",
            threshold=self._threshold.value or "",
            seed=self._seed.value or "",
        )
        with loading(self._button):
            made = await self._viewer.attempt(draft.make, self._shelf, actor=name_in(self._viewer, self._who))
        if made is not None:
            ui.navigate.to(f"/study/{made}")


__all__ = ["listing"]
