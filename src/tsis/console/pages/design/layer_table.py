"""The probe's layers as a table to type in."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.design.draft import LAYER, MOST_LAYERS, NEW_LAYER
from tsis.console.pages.design.typed import Sentences, typed_field
from tsis.console.pages.table import cell, rows_under

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.pages.design.draft import ProbeDraft

HEADINGS = ("Layer", "Thickness / mm", "Modulus / kPa", "Poisson", "Index", "Order")


class LayerTable:
    """A row a layer, with buttons that move, take out and add one.

    Parameters
    ----------
    draft
        Whose layers.
    changed
        Called after each change.
    """

    def __init__(self, draft: ProbeDraft, changed: Callable[[], object]) -> None:
        self._draft, self._changed = draft, changed
        self._place = ui.element("div").classes("stack")
        self._fill()

    def _fill(self) -> None:
        self._place.clear()
        layers = self._draft.layers
        with self._place:
            body = rows_under(HEADINGS, label="Layers, from the tissue up", look="layers")
            sentences = Sentences()
            with body:
                for at in range(len(layers)):
                    self._row(at, sentences)
            if len(layers) < MOST_LAYERS:
                ui.button("Add a layer at the glass", icon="add", on_click=self._add).props("dense no-caps flat")

    def _row(self, at: int, sentences: Sentences) -> None:
        texts, number = self._draft.layers[at], at + 1
        with ui.element("tr"):
            cell(str(number))
            for name, words in LAYER.items():
                with ui.element("td"):
                    typed_field(
                        f"Layer {number}, {words}",
                        texts[name],
                        partial(self._typed, texts, name),
                        partial(self._fault, number, texts, name),
                        sentences,
                        shown=False,
                    )
            with ui.element("td").classes("order"):
                last = len(self._draft.layers) - 1
                self._order("arrow_upward", f"Move layer {number} to the tissue", at > 0, partial(self._move, at, -1))
                self._order(
                    "arrow_downward", f"Move layer {number} to the glass", at < last, partial(self._move, at, 1)
                )
                self._order("delete", f"Take layer {number} out", last > 0, partial(self._take_out, at))

    def _order(self, icon: str, words: str, useful: bool, act: Callable[[], None]) -> None:
        button = ui.button(icon=icon, on_click=act).props("dense flat round size=sm")
        button.props["aria-label"] = words
        button.set_enabled(useful)

    def _fault(self, number: int, texts: dict[str, str], name: str) -> str:
        wrong = self._draft.layer_fault(texts, name)
        return wrong and f"Layer {number}: {wrong}"

    def _typed(self, texts: dict[str, str], name: str, text: str) -> None:
        texts[name] = text
        self._changed()

    def _add(self) -> None:
        self._draft.layers.append(dict(NEW_LAYER))
        self._fill()
        self._changed()

    def _move(self, at: int, by: int) -> None:
        layers = self._draft.layers
        layers[at], layers[at + by] = layers[at + by], layers[at]
        self._fill()
        self._changed()

    def _take_out(self, at: int) -> None:
        del self._draft.layers[at]
        self._fill()
        self._changed()
