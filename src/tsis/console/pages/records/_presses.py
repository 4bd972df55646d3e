"""Presses of a target as small pictures, the comparison of two, and its estimates: the current ones, all before."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages import components as kit
from tsis.console.pages.records._context import AT_ONCE, TargetView, flags_of, follow_job, read_target
from tsis.console.pages.records._edit import open_press
from tsis.present.hardness import estimate_messages_of
from tsis.present.images import comparison
from tsis.present.labels import quantity_of
from tsis.present.records import recomputation_message, recomputation_notes, shift_table
from tsis.present.target import (
    IDENTITY_NOTE,
    count_of,
    history_tables,
    measure,
    newest_first,
    origin,
    target_cards,
)
from tsis.records.values import ESTIMATES, ROLE_NAMES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.records._context import TargetContext
    from tsis.console.services import Instrument
    from tsis.present.page import Page
    from tsis.records.recomputation import Recomputation
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target


SMALL_PX = 240
TWO = 2
NO_PICTURE = "This frame cannot be shown: open the press to see why."


class Presses:
    """The presses on the page of a target."""

    def __init__(self, page: TargetContext, place: ui.element) -> None:
        self._page, self._sheet = page, kit.Redrawn(place)
        self.offset = 0
        self.chosen: list[str] = []
        self._compare: ui.button | None = None

    def show(self, view: TargetView) -> None:
        """Show a page of presses.

        An unchanged page stays: a click on a box that is being replaced would be lost.
        """
        self.offset = view.offset
        if self._sheet.changes_to(view.sheet):
            self._draw(view)
        self._show_count()

    def _draw(self, view: TargetView) -> None:
        with self._sheet.element:
            with ui.element("div").classes("row"):
                kit.panel_title("Presses", level=3)
                kit.muted(_range(view))
                ui.element("div").classes("spring")
                self._compare = kit.button(
                    "Compare two", lambda: self._page.compare(view), icon="compare", look="outline dense"
                )
                if view.total > AT_ONCE:
                    for text, icon, by in (("Earlier", "chevron_left", -AT_ONCE), ("Later", "chevron_right", AT_ONCE)):
                        turn = kit.button(text, partial(self._turn, by), icon=icon, look="outline dense")
                        turn.set_enabled(0 <= view.offset + by < view.total)
            if not view.presses:
                kit.muted("Nothing recorded yet: snapshots on the page Examine become presses.")
            with ui.element("div").classes("presses"):
                for press in view.presses:
                    self._press(press, view)

    async def _turn(self, by: int) -> None:
        self.offset = max(0, self.offset + by)
        await self._page.load()

    def _press(self, press: StoredPress, view: TargetView) -> None:
        text = kit.press_label(press)
        flags = flags_of(press, private=view.private)
        with ui.element("figure").classes("press"):
            with (
                ui.element("button")
                .classes("press-open")
                .props("type=button")
                .on("click", lambda: open_press(self._page, view, press)) as frame
            ):
                frame.props["aria-label"] = f"Open the press {text}"
                picture = ui.element("img").props("loading=lazy").classes("press-picture")
                picture.props["src"] = f"/files/press/{view.target.number}/{press.id}.png?size={SMALL_PX}"
                picture.props["alt"] = f"Frame {text}"
                picture.on("error", lambda: _leave_out(frame), args=[])
            with ui.element("figcaption"):
                with ui.element("div").classes("press-line"):
                    ui.label(ROLE_NAMES[press.role]).classes("press-role")
                    ui.label(kit.force_text(press.force_n))
                kit.muted(kit.time_label(press.taken))
                for flag in flags:
                    ui.label(flag).classes("press-flag")
                choose = ui.checkbox(
                    "choose", value=press.id in self.chosen, on_change=lambda event: self._choose(press, event)
                )
                choose.props("dense").props["aria-label"] = f"Choose the press {text}"

    def _choose(self, press: StoredPress, event: ValueChangeEventArguments[bool]) -> None:
        self.chosen = [item for item in self.chosen if item != press.id] + ([press.id] if event.value else [])
        self._show_count()

    def _show_count(self) -> None:
        if self._compare is not None:
            self._compare.set_enabled(len(self.chosen) == TWO)
            self._compare.text = f"Compare two ({len(self.chosen)} chosen)"


def _range(view: TargetView) -> str:
    if view.total <= AT_ONCE:
        return kit.count_text(view.total, "press")
    return f"{view.offset + 1} to {view.offset + len(view.presses)} of {view.total}"


def _leave_out(frame: ui.element) -> None:
    """Show a message in place of a missing picture."""
    frame.clear()
    with frame:
        ui.label(NO_PICTURE).classes("press-damaged")


async def compare(page: TargetContext, view: TargetView, *, same_light: bool = False) -> None:
    """Show the two chosen presses, what differs, and the features of each."""
    position, chosen = page.compared, tuple(page.presses.chosen)
    position.set_visibility(True)
    position.clear()
    with position:
        ui.label("Loading …").classes("muted").props('role="status"')
    result = await page.viewer.attempt(_compared, page.instrument.store, view.target, chosen, same_light=same_light)
    position.clear()
    if result is None:
        position.set_visibility(False)
        return
    content, sources = result
    with position:
        with kit.title_row(content.title, level=3):
            ui.switch(
                "match brightness",
                value=same_light,
                on_change=lambda event: compare(page, view, same_light=event.value),
            ).props("dense")
            ui.button(icon="close", on_click=lambda: position.set_visibility(False)).props(
                'flat dense round aria-label="Close the comparison"'
            )
        with ui.element("div").classes("compared"):
            for picture, source in zip(content.pictures, sources, strict=True):
                kit.figure(picture, source)
        for note in content.notes:
            ui.label(note)
        for item in content.tables:
            kit.table(item)


def _compared(store: Store, target: Target, chosen: Sequence[str], *, same_light: bool) -> tuple[Page, tuple[str, ...]]:
    """The comparison, and its pictures drawn."""
    presses = [store.press(target, item) for item in chosen]
    record = replace(store.record(target, limit=0), presses=tuple(presses))
    names = [kit.press_label(press) for press in presses]
    names = names if len(set(names)) == len(names) else [f"{name} ({at})" for at, name in enumerate(names, 1)]
    item, other = (replace(record.image(press), name=name) for press, name in zip(presses, names, strict=True))
    content = comparison(item, other, same_light=same_light)
    return content, kit.drawings(content)


FRAME_EVERY_S = 0.2  # of a sequence that is played; the browser fetches each frame


def play_sequence(place: ui.element, number: int, name: str, frames: int) -> None:
    """Play a recorded sequence of a target in a dialog: by itself, or frame by frame with the slider."""
    with kit.open_dialog(place, f"{name} of target {number}", style="dialog-card wide"):
        picture = ui.element("img").classes("press-picture")
        with ui.element("div").classes("row"):
            playing = ui.switch("Play", value=True)
            slider = ui.slider(min=0, max=frames - 1, value=0).props("label").classes("sequence-slider")
            slider.props["aria-label"] = "Frame"
            text = kit.muted()

        def show() -> None:
            at = int(slider.value)
            picture.props["src"] = f"/files/sequence/{number}/{name}/{at}.png"
            picture.props["alt"] = text.text = f"Frame {at + 1} of {frames}"

        def advance() -> None:
            if playing.value:
                slider.value = (int(slider.value) + 1) % frames

        slider.on_value_change(show)
        ui.timer(FRAME_EVERY_S, advance)
        show()


SHOWN_PRESSES, LARGEST_OFFSET = 6, 10**9  # of a comparison; the last page of presses


def ask_to_compare(page: TargetContext, view: TargetView) -> None:
    """Ask for another target, and open both beside each other."""
    number = view.target.number
    with kit.open_dialog(page.dialogs, f"Compare target {number}") as dialog:
        other = kit.unit_field("Number of the other target", keys="numeric").props("autofocus")

        def go() -> None:
            text = (other.value or "").strip()
            if not text.isdecimal():
                other.error = "Enter the number of the other target."
                return
            dialog.close()
            ui.navigate.to(f"/records/compare/{number}-{int(text[:20])}")

        other.on("keydown.enter", go)
        kit.dialog_buttons(dialog, "Compare", go)


async def compare_targets(instrument: Instrument, viewer: kit.Viewer, pair: str) -> None:
    """Build the page of two targets beside each other: their estimates, true values and newest presses."""
    ui.link("All targets", "/records").classes("link")
    place = ui.element("div").classes("grid")
    for number in pair.split("-", 1):
        view = await viewer.attempt(read_target, instrument.store, number, LARGEST_OFFSET)
        if view is None:
            continue
        with place, ui.element("section").classes("panel stack") as part:
            part.props["aria-label"] = f"Target {view.target.number}"
            name = f": {view.target.name}" if view.target.name else ""
            kit.panel_title(f"Target {view.target.number}{name}").classes("target-title")
            ui.link("Open", f"/records/{view.target.number}").classes("link")
            truth = {quantity_of(key): value for key, value in view.target.truth.items()}
            facts = {f"true {item.title}": measure(value, item.unit) for item, value in truth.items()}
            kit.FactList().show({"presses": f"{view.total}", **facts}.items())
            estimates(view)
            with ui.element("div").classes("compared"):
                for press in view.presses[:SHOWN_PRESSES]:
                    with ui.element("figure").classes("press"):
                        picture = ui.element("img").classes("press-picture")
                        picture.props["alt"] = f"Frame {kit.press_label(press)}"
                        picture.props["src"] = f"/files/press/{view.target.number}/{press.id}.png?size=360"
                        with ui.element("figcaption"):
                            ui.label(kit.press_label(press))


NONE_YET = "Nothing was estimated yet. Estimate needs presses that were taken under a calibration."


def estimates(view: TargetView) -> None:
    """Show the estimates in force, and what of the target is damaged."""
    kit.panel_title("Current estimates", level=3)
    result = newest_first(view.record)
    if result:
        kit.cards(target_cards(view.record))
    else:
        kit.muted(NONE_YET)
    with kit.message_list():
        for stored in result:
            for message in (*estimate_messages_of(stored), origin(stored)):
                of_kind = f"Of the {stored.kind}: {message}"
                kit.list_message(of_kind if len(result) > 1 else message)
            if stored.estimate.flags:
                kit.list_message(f"Flags: {', '.join(stored.estimate.flags)}", "doubtful")
        for message in view.record.damaged:
            kit.list_message(f"Left out: {message}", "flag")
    if view.private:
        kit.muted(IDENTITY_NOTE)


def history(view: TargetView) -> None:
    """Show all estimates."""
    result = history_tables(view.record)
    for item in result:
        kit.table(item)
    if not result:
        kit.panel_title("History", level=3)
        kit.muted("No estimate yet.")


NEWEST = "the newest press of each role and force"


def estimate_button(page: TargetContext, view: TargetView) -> None:
    """A button that asks what to estimate from, and does it."""
    kit.button("Estimate", lambda: _ask(page, view), icon="calculate", look="outline dense")


def _ask(page: TargetContext, view: TargetView) -> None:
    chosen, number, last = tuple(page.presses.chosen), view.target.number, view.record.estimate
    ways = {"newest": NEWEST, **({"chosen": f"the {count_of(len(chosen), 'press')} chosen below"} if chosen else {})}
    with kit.open_dialog(page.dialogs, f"Estimate target {number}") as dialog:
        kind = kit.select_field(list(ESTIMATES), value=ESTIMATES[0] if last is None else last.kind, label="What")
        kind.props("outlined dense")
        way = ui.radio(ways, value="chosen" if chosen else "newest").props("dense")
        kit.muted("All presses must be of one probe under one calibration.")

        async def begin() -> None:
            dialog.close()
            presses = chosen if way.value == "chosen" else None
            estimate = partial(page.instrument.estimate, number, kind=kind.value, presses=presses)
            await follow_job(page.viewer, page.below, estimate, _show)

        kit.dialog_buttons(dialog, "Estimate", begin)


def _show(_: StoredEstimate) -> None:
    ui.label("The estimate is stored and current.").classes("good").props('role="status"')


EXPLAINED = (
    "The current estimates are recomputed from the stored frames. A different result is stored as a new "
    "estimate that says which one it replaces; the old one stays."
)


def recompute_button(page: TargetContext, view: TargetView) -> None:
    """A button that asks whether to store what comes out, and computes."""
    button = kit.button("Recompute", lambda: _ask_to_recompute(page, view), icon="restart_alt", look="outline dense")
    button.set_enabled(bool(view.record.estimates))


def _ask_to_recompute(page: TargetContext, view: TargetView) -> None:
    target = view.target
    with kit.open_dialog(page.dialogs, f"Recompute target {target.number}") as dialog:
        ui.label(EXPLAINED)
        dry = ui.switch("dry run: show changes, store nothing", value=False)

        async def begin() -> None:
            dialog.close()
            recompute = partial(page.instrument.recompute, target, dry_run=dry.value)
            await follow_job(page.viewer, page.below, recompute, partial(_show_recomputation, page))

        kit.dialog_buttons(dialog, "Recompute", begin)


def _show_recomputation(page: TargetContext, recomputations: tuple[Recomputation, ...]) -> None:
    with ui.element("div").classes("outcome").props('role="status"'):
        for item in recomputations:
            ui.label(f"{item.before.kind.capitalize()}: {item.message}").classes("good" if item.same else "doubtful")
            for note in recomputation_notes(item):
                kit.muted(note)
            if not item.same:
                kit.table(shift_table(item))
                ui.label(recomputation_message(item))
        kit.button("Close", page.below.clear, look="flat dense")
