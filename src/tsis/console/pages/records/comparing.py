"""Two presses of a target beside each other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.report_parts import drawings, figure, table
from tsis.console.pages.words import press_words
from tsis.report.comparison import comparison

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.records import Store, Target
    from tsis.report.page import Page


async def compare(page: TargetContext, seen: TargetSeen, *, same_light: bool = False) -> None:
    """Show the two chosen presses, what differs, and the features of each."""
    place, chosen = page.compared, tuple(page.presses.chosen)
    place.set_visibility(True)
    place.clear()
    with place:
        ui.label("Reading and drawing ...").classes("muted").props('role="status"')
    found = await page.viewer.attempt(_compared, page.bench.store, seen.target, chosen, same_light=same_light)
    place.clear()
    if found is None:
        place.set_visibility(False)
        return
    told, sources = found
    with place:
        with ui.element("div").classes("row"):
            panel_title(told.title, level=3)
            ui.element("div").classes("spring")
            ui.switch(
                "bring both to the same light",
                value=same_light,
                on_change=lambda event: compare(page, seen, same_light=event.value),
            ).props("dense")
            ui.button(icon="close", on_click=lambda: place.set_visibility(False)).props(
                'flat dense round aria-label="Close the comparison"'
            )
        with ui.element("div").classes("compared"):
            for picture, source in zip(told.pictures, sources, strict=True):
                figure(picture, source)
        for note in told.notes:
            ui.label(note)
        for each in told.tables:
            table(each)


def _compared(store: Store, target: Target, chosen: Sequence[str], *, same_light: bool) -> tuple[Page, tuple[str, ...]]:
    """The comparison, and its pictures drawn."""
    presses = [store.press(target, each) for each in chosen]
    dossier = replace(store.dossier(target, limit=0), presses=tuple(presses))
    names = [press_words(press) for press in presses]
    names = names if len(set(names)) == len(names) else [f"{name} ({at})" for at, name in enumerate(names, 1)]
    one, other = (replace(dossier.image(press), name=name) for press, name in zip(presses, names, strict=True))
    told = comparison(one, other, same_light=same_light)
    return told, drawings(told)
