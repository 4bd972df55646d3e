"""The fields of presses and question."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.design.asked import COMPARED, CRITERIA, AskedDraft
from tsis.console.pages.design.draft import sentence
from tsis.console.pages.design.typed import Sentences, typed_field
from tsis.console.pages.headings import panel_title

if TYPE_CHECKING:
    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.design.desk import DrawingDesk


class AskedForm:
    """How one would press, what to compare with, and what a good design is.

    Parameters
    ----------
    desk
        What is filled.
    """

    def __init__(self, desk: DrawingDesk) -> None:
        self._desk, draft = desk, desk.asked
        panel_title("Presses")
        self._presses(draft)
        panel_title("Compare with", level=3).classes("below")
        with ui.element("div").classes("choices"):
            for aspect, words in COMPARED.items():
                ui.checkbox(words, value=aspect in draft.compared, on_change=partial(self._compare, aspect)).props(
                    "dense"
                )
        panel_title("Judge by", level=3).classes("below")
        with ui.element("div").classes("fields"):
            ui.select(CRITERIA, value=draft.criterion, label="The expected error of").props(
                "dense outlined options-dense"
            ).bind_value_to(draft, "criterion")
            ui.switch("Light by the lamps, traced", value=draft.traced).props("dense").bind_value_to(draft, "traced")
        with ui.element("div").classes("fields"):
            search = ui.switch("Search better layers and forces, for minutes", value=draft.search).props("dense")
            search.bind_value_to(draft, "search")
            tries = ui.element("div")
        sentences = Sentences()
        with tries:
            typed_field(
                "Stacks to try",
                draft.evaluations,
                self._evaluations,
                lambda: self._fault(AskedDraft(evaluations=draft.evaluations, search=True)),
                sentences,
            )
        tries.bind_visibility_from(draft, "search")

    def _presses(self, draft: AskedDraft) -> None:
        fields = ui.element("div").classes("fields")
        sentences = Sentences()
        with fields:
            typed_field(
                "Forces / N",
                draft.forces,
                self._forces,
                lambda: self._fault(AskedDraft(forces=draft.forces)),
                sentences,
                empty="1; on a dome 0.5, 1",
            )
            typed_field(
                "Frames of each",
                draft.frames,
                self._frames,
                lambda: self._fault(AskedDraft(frames=draft.frames)),
                sentences,
            )
            ui.switch("Press plain tissue too", value=draft.with_reference).props("dense").bind_value_to(
                draft, "with_reference"
            )

    def _fault(self, alone: AskedDraft) -> str:
        """What is wrong with one field, the others being as they are at first."""
        return sentence(lambda: alone.question(self._desk.probe.start))

    def _forces(self, text: str) -> None:
        self._desk.asked.forces = text

    def _frames(self, text: str) -> None:
        self._desk.asked.frames = text

    def _evaluations(self, text: str) -> None:
        self._desk.asked.evaluations = text

    def _compare(self, aspect: str, event: ValueChangeEventArguments[bool]) -> None:
        if event.value:
            self._desk.asked.compared.add(aspect)
        else:
            self._desk.asked.compared.discard(aspect)
