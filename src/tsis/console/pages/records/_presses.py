"""Presses of a target as small pictures, a page at a time; and the comparison of two."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import drawings, figure, force_text, panel_title, press_label, table, time_label
from tsis.console.pages.records._context import AT_ONCE, TargetView, flags_of
from tsis.console.pages.records._edit import open_press
from tsis.records import ROLE_NAMES
from tsis.report import comparison
from tsis.report.target import count_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.records._context import TargetContext
    from tsis.records import StoredPress, Target
    from tsis.records.store import Store
    from tsis.report import Page


SMALL_PX = 240
TWO = 2
NO_PICTURE = "This frame cannot be shown: open the press to see why."


class Presses:
    """The presses on the page of a target."""

    def __init__(self, page: TargetContext, place: ui.element) -> None:
        self._page, self._container = page, place
        self.offset = 0
        self.chosen: list[str] = []
        self._sheet: tuple[object, ...] = ()
        self._compare: ui.button | None = None

    def show(self, seen: TargetView) -> None:
        """Show a page of presses.

        An unchanged page stays: a click on a box that is being replaced would be lost.
        """
        self.offset = seen.offset
        if self._sheet != seen.sheet:
            self._sheet = seen.sheet
            self._draw(seen)
        self._notify()

    def _draw(self, seen: TargetView) -> None:
        self._container.clear()
        with self._container:
            with ui.element("div").classes("row"):
                panel_title("Presses", level=3)
                ui.label(_range(seen)).classes("muted")
                ui.element("div").classes("spring")
                self._compare = ui.button(
                    "Compare two", icon="compare", on_click=lambda: self._page.compare(seen)
                ).props("dense no-caps outline")
                if seen.total > AT_ONCE:
                    self._turners(seen)
            if not seen.presses:
                ui.label("Nothing was recorded yet: snapshots on the page Examine become presses.").classes("muted")
            with ui.element("div").classes("presses"):
                for press in seen.presses:
                    self._press(press, seen)

    def _turners(self, seen: TargetView) -> None:
        earlier = ui.button("Earlier", icon="chevron_left", on_click=lambda: self._turn(-AT_ONCE))
        later = ui.button("Later", icon="chevron_right", on_click=lambda: self._turn(AT_ONCE))
        for button in (earlier, later):
            button.props("dense no-caps outline")
        earlier.set_enabled(seen.offset > 0)
        later.set_enabled(seen.offset + AT_ONCE < seen.total)

    async def _turn(self, by: int) -> None:
        self.offset = max(0, self.offset + by)
        await self._page.load()

    def _press(self, press: StoredPress, seen: TargetView) -> None:
        text = press_label(press)
        flags = flags_of(press, private=seen.private)
        with ui.element("figure").classes("press"):
            with (
                ui.element("button")
                .classes("press-open")
                .props("type=button")
                .on("click", lambda: open_press(self._page, seen, press)) as frame
            ):
                frame.props["aria-label"] = f"Open the press {text}"
                picture = ui.element("img").props("loading=lazy").classes("press-picture")
                picture.props["alt"], picture.props["src"] = f"Frame {text}", _address(seen, press)
                picture.on("error", lambda: _leave_out(frame), args=[])
            with ui.element("figcaption"):
                with ui.element("div").classes("press-line"):
                    ui.label(ROLE_NAMES[press.role]).classes("press-role")
                    ui.label(force_text(press.force_n))
                ui.label(time_label(press.taken)).classes("muted")
                for flag in flags:
                    ui.label(flag).classes("press-flag")
                choose = ui.checkbox(
                    "choose", value=press.id in self.chosen, on_change=lambda event: self._choose(press, event)
                )
                choose.props("dense").props["aria-label"] = f"Choose the press {text}"

    def _choose(self, press: StoredPress, event: ValueChangeEventArguments[bool]) -> None:
        self.chosen = [item for item in self.chosen if item != press.id] + ([press.id] if event.value else [])
        self._notify()

    def _notify(self) -> None:
        if self._compare is not None:
            self._compare.set_enabled(len(self.chosen) == TWO)
            self._compare.text = f"Compare two ({len(self.chosen)} chosen)"


def _range(seen: TargetView) -> str:
    if seen.total <= AT_ONCE:
        return count_of(seen.total, "press")
    return f"{seen.offset + 1} to {seen.offset + len(seen.presses)} of {seen.total}"


def _leave_out(frame: ui.element) -> None:
    """Show a message in place of a missing picture."""
    frame.clear()
    with frame:
        ui.label(NO_PICTURE).classes("press-damaged")


def _address(seen: TargetView, press: StoredPress) -> str:
    return f"/files/press/{seen.target.number}/{press.id}.png?size={SMALL_PX}"


async def compare(page: TargetContext, seen: TargetView, *, same_light: bool = False) -> None:
    """Show the two chosen presses, what differs, and the features of each."""
    position, chosen = page.compared, tuple(page.presses.chosen)
    position.set_visibility(True)
    position.clear()
    with position:
        ui.label("Reading and drawing ...").classes("muted").props('role="status"')
    result = await page.viewer.attempt(_compared, page.instrument.store, seen.target, chosen, same_light=same_light)
    position.clear()
    if result is None:
        position.set_visibility(False)
        return
    reported, sources = result
    with position:
        with ui.element("div").classes("row"):
            panel_title(reported.title, level=3)
            ui.element("div").classes("spring")
            ui.switch(
                "bring both to the same light",
                value=same_light,
                on_change=lambda event: compare(page, seen, same_light=event.value),
            ).props("dense")
            ui.button(icon="close", on_click=lambda: position.set_visibility(False)).props(
                'flat dense round aria-label="Close the comparison"'
            )
        with ui.element("div").classes("compared"):
            for picture, source in zip(reported.pictures, sources, strict=True):
                figure(picture, source)
        for note in reported.notes:
            ui.label(note)
        for item in reported.tables:
            table(item)


def _compared(store: Store, target: Target, chosen: Sequence[str], *, same_light: bool) -> tuple[Page, tuple[str, ...]]:
    """The comparison, and its pictures drawn."""
    presses = [store.press(target, item) for item in chosen]
    record = replace(store.record(target, limit=0), presses=tuple(presses))
    names = [press_label(press) for press in presses]
    names = names if len(set(names)) == len(names) else [f"{name} ({at})" for at, name in enumerate(names, 1)]
    item, other = (replace(record.image(press), name=name) for press, name in zip(presses, names, strict=True))
    reported = comparison(item, other, same_light=same_light)
    return reported, drawings(reported)
