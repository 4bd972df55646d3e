"""Presses of a target as small pictures, a sheet at a time; some of them chosen."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.press_edit import open_press
from tsis.console.pages.records.reading import AT_ONCE, TargetSeen, flags_of
from tsis.console.pages.words import force_words, press_words, time_words
from tsis.records.values import ROLE_WORDS
from tsis.report.target_words import count_of

if TYPE_CHECKING:
    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.records.context import TargetContext
    from tsis.records import StoredPress

SMALL_PX = 240
TWO = 2
NO_PICTURE = "This frame cannot be shown: open the press to see why."


class Presses:
    """The presses on the page of a target.

    Parameters
    ----------
    page
        Whose they are.
    place
        Where they are shown.
    """

    def __init__(self, page: TargetContext, place: ui.element) -> None:
        self._page, self._place = page, place
        self.offset = 0
        self.chosen: list[str] = []
        self._sheet: tuple[object, ...] = ()
        self._compare: ui.button | None = None

    def show(self, seen: TargetSeen) -> None:
        """Show a sheet of presses.

        A sheet that shows them already stays: who is just choosing one would click on a box that is being replaced.
        """
        self.offset = seen.offset
        if self._sheet != seen.sheet:
            self._sheet = seen.sheet
            self._draw(seen)
        self._tell()

    def _draw(self, seen: TargetSeen) -> None:
        self._place.clear()
        with self._place:
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

    def _turners(self, seen: TargetSeen) -> None:
        earlier = ui.button("Earlier", icon="chevron_left", on_click=lambda: self._turn(-AT_ONCE))
        later = ui.button("Later", icon="chevron_right", on_click=lambda: self._turn(AT_ONCE))
        for button in (earlier, later):
            button.props("dense no-caps outline")
        earlier.set_enabled(seen.offset > 0)
        later.set_enabled(seen.offset + AT_ONCE < seen.total)

    async def _turn(self, by: int) -> None:
        self.offset = max(0, self.offset + by)
        await self._page.load()

    def _press(self, press: StoredPress, seen: TargetSeen) -> None:
        words = press_words(press)
        flags = flags_of(press, private=seen.private)
        with ui.element("figure").classes("press"):
            with (
                ui.element("button")
                .classes("press-open")
                .props("type=button")
                .on("click", lambda: open_press(self._page, seen, press)) as frame
            ):
                frame.props["aria-label"] = f"Open the press {words}"
                picture = ui.element("img").props("loading=lazy").classes("press-picture")
                picture.props["alt"], picture.props["src"] = f"Frame {words}", _address(seen, press)
                picture.on("error", lambda: _leave_out(frame), args=[])
            with ui.element("figcaption"):
                with ui.element("div").classes("press-line"):
                    ui.label(ROLE_WORDS[press.role]).classes("press-role")
                    ui.label(force_words(press.force_n))
                ui.label(time_words(press.taken)).classes("muted")
                for flag in flags:
                    ui.label(flag).classes("press-flag")
                choose = ui.checkbox(
                    "choose", value=press.id in self.chosen, on_change=lambda event: self._choose(press, event)
                )
                choose.props("dense").props["aria-label"] = f"Choose the press {words}"

    def _choose(self, press: StoredPress, event: ValueChangeEventArguments[bool]) -> None:
        self.chosen = [each for each in self.chosen if each != press.id] + ([press.id] if event.value else [])
        self._tell()

    def _tell(self) -> None:
        if self._compare is not None:
            self._compare.set_enabled(len(self.chosen) == TWO)
            self._compare.text = f"Compare two ({len(self.chosen)} chosen)"


def _range(seen: TargetSeen) -> str:
    if seen.total <= AT_ONCE:
        return count_of(seen.total, "press")
    return f"{seen.offset + 1} to {seen.offset + len(seen.presses)} of {seen.total}"


def _leave_out(frame: ui.element) -> None:
    """Say in place of a picture that there is none; the press itself tells why."""
    frame.clear()
    with frame:
        ui.label(NO_PICTURE).classes("press-damaged")


def _address(seen: TargetSeen, press: StoredPress) -> str:
    return f"/files/press/{seen.target.number}/{press.id}.png?size={SMALL_PX}"
