"""Records of one target: presses, estimates, report, exports."""

from __future__ import annotations

from dataclasses import dataclass, replace
from datetime import timedelta
from functools import partial
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from nicegui import run, ui

from tsis.calibration.guard.limits import GUARD_FLAGS
from tsis.console import widgets
from tsis.console.files import sequence_folders
from tsis.console.live.comparison import FrameComparison
from tsis.console.live.panel import still_panel
from tsis.console.messages import FORCE, field_messages
from tsis.console.pages.records import (
    AT_ONCE,
    ReportButton,
    TargetView,
    export_button,
    flag_text,
    flags_of,
    follow_job,
    follow_store,
    read_target,
)
from tsis.errors import StaleRecordError, TsisError
from tsis.model.image import TactileImage
from tsis.present.images import comparison, difference
from tsis.present.labels import counted, in_order, quantity_of
from tsis.present.page import flags_table
from tsis.present.records import recomputation_message, recomputation_notes, shift_table
from tsis.present.target import (
    IDENTITY_NOTE,
    SHORT,
    history_tables,
    measure,
    newest_first,
    origin,
    result_flags,
    result_messages,
    result_tables,
    target_cards,
)
from tsis.records.deidentification import DAMAGED
from tsis.records.reader import ARCHIVED, DELETED
from tsis.records.rows import EDITABLE
from tsis.records.store import UNDO_DAYS
from tsis.records.values import ESTIMATES, MAP, ROLE_NAMES, parse_force, parse_truth

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from nicegui.events import ValueChangeEventArguments

    from tsis.calibration.file import ProbeCalibration
    from tsis.console.services.instrument import Instrument
    from tsis.console.viewer import Viewer
    from tsis.present.page import Page
    from tsis.records.recomputation import Recomputation
    from tsis.records.store import Store
    from tsis.records.values import StoredEstimate, StoredPress, Target


MOST_SHOWN = 120  # letters of a value
Record = TypeVar("Record", bound="Target | StoredPress")


@dataclass(frozen=True, slots=True, kw_only=True)
class Edited(Generic[Record]):
    """Result of a change: the record as stored now; where it was refused, why, and the other editor's changes."""

    record: Record
    refused: str = ""  # why it was not changed; empty when it was
    differences: tuple[str, ...] = ()  # one message for each field that another editor has changed


def edit_target(store: Store, target: Target, changes: Mapping[str, Any]) -> Edited[Target]:
    """Change a target as it was read; errors as `tsis.records.store.Store.edit_target`, but for that of being late."""
    return _edit("target", target, changes, store.edit_target, lambda: store.target(target.number))


def edit_press(store: Store, target: Target, press: StoredPress, changes: Mapping[str, Any]) -> Edited[StoredPress]:
    """Change a press as it was read; errors as `edit_target`."""
    return _edit("press", press, changes, store.edit_press, lambda: store.press(target, press.id))


def _edit(
    kind: str, record: Record, changes: Mapping[str, Any], edit: Callable[..., Record], read: Callable[[], Record]
) -> Edited[Record]:
    try:
        return Edited(record=edit(record, **changes) if changes else record)
    except StaleRecordError as error:
        now = read()
        return Edited(record=now, refused=str(error), differences=differences(record, now, EDITABLE[kind]))


def differences(before: object, now: object, names: tuple[str, ...]) -> tuple[str, ...]:
    """Changes between two versions of a record, one message per field."""
    changed = ((name, getattr(before, name), getattr(now, name)) for name in names)
    return tuple(
        f"{_label(name)}: was {_value_text(was)}, is {_value_text(new)} now."
        for name, was, new in changed
        if was != new
    )


def changed(record: object, requested: Mapping[str, Any]) -> dict[str, Any]:
    """The values that differ from the record's."""
    return {name: value for name, value in requested.items() if getattr(record, name) != value}


def _label(name: str) -> str:
    return {"force_n": "Force"}.get(name, name.capitalize())


def _value_text(value: Any) -> str:
    if value is None:
        return "not measured"
    if isinstance(value, tuple):
        value = ", ".join(value)
    elif not isinstance(value, (str, float)):
        value = truth_text(value).replace("\n", ", ")
    text = f"{value:g} N" if isinstance(value, float) else value
    return f"“{text[:MOST_SHOWN]}”" if text else "empty"


def truth_text(truth: Mapping[str, float]) -> str:
    """True values as people write them, one on a line; read again they are the same to the last digit."""
    return "\n".join(f"{name}={number_text(value)}" for name, value in truth.items())


def number_text(value: float) -> str:
    """A number with all its digits, and no more."""
    return repr(value).removesuffix(".0")


class Editing(Generic[Record]):
    """The fields of a record in a dialog, by their names in errors; ``leave`` labels the button that changes nothing.

    ``show`` writes a record into the fields, ``edit`` changes it in the store as they say, away from the event loop,
    and ``title`` names it in the message that it was saved.
    """

    def __init__(
        self,
        page: TargetPage,
        record: Record,
        dialog: ui.dialog,
        fields: Mapping[str, ui.input | ui.textarea],
        *,
        show: Callable[[Record], None],
        edit: Callable[[Record], Edited[Record]],
        title: str,
        leave: str,
    ) -> None:
        self._page, self._record, self._dialog, self._fields = page, record, dialog, fields
        self._show, self._edit, self._title = show, edit, title
        self._conflict = ui.element("div")
        self._fill(record)
        widgets.dialog_buttons(dialog, "Save", self._save, leave=leave)

    def _fill(self, record: Record) -> None:
        self._record = record
        self._show(record)
        self._conflict.clear()

    async def _save(self) -> None:
        result = await widgets.submit(self._page.viewer, self._fields, self._edit, self._record)
        if result is None:
            return
        if result.refused:
            self._show_conflict(result)
            return
        self._dialog.close()
        self._page.viewer.notify(f"{self._title} is version {result.record.version} now.")
        await self._page.load()

    def _show_conflict(self, result: Edited[Record]) -> None:
        """Let the user take the stored record, or overwrite it."""

        async def overwrite() -> None:
            self._record = result.record
            await self._save()

        self._conflict.clear()
        with self._conflict, ui.element("div").classes("conflict").props('role="alert"'):
            ui.label(result.refused).classes("flag")
            for difference in result.differences or ("Your fields are unchanged; another field has changed.",):
                ui.label(difference)
            with ui.element("div").classes("row"):
                widgets.button("Discard my changes", lambda: self._fill(result.record), look="outline dense")
                widgets.button("Overwrite with mine", overwrite, look="outline dense")


async def open_press(page: TargetPage, view: TargetView, press: StoredPress) -> None:
    """Show a press in a dialog."""
    title = f"Press {widgets.press_label(press)}"
    with (
        widgets.open_dialog(page.dialogs, title, style="dialog-card wide") as dialog,
        ui.element("div").classes("press-large"),
    ):
        with ui.element("div").classes("stack"):
            frame = ui.element("div").classes("stack")
            _facts(view, press)
        with ui.element("div").classes("stack"):
            _edit_press_fields(page, view.target, press, dialog)
    await _show_frame(page, view, press, frame)


async def _show_frame(page: TargetPage, view: TargetView, press: StoredPress, place: ui.element) -> None:
    """Show the frame of a press with all tools, or why it cannot be read."""
    image = await run.io_bound(_frame_of, page.instrument.store, view.target, press)
    if place.is_deleted:  # the dialog was closed meanwhile
        return
    with place:
        if isinstance(image, TactileImage):
            still_panel(image, f"Frame {widgets.press_label(press)}")
        else:  # of a subject without the path, which may identify the person
            ui.label(DAMAGED if view.private else str(image)).classes("flag identity").props('role="alert"')


def _frame_of(store: Store, target: Target, press: StoredPress) -> TactileImage | TsisError:
    try:
        return replace(store.record(target, limit=0), presses=(press,)).image(press)
    except TsisError as error:
        return error


def _facts(view: TargetView, press: StoredPress) -> None:
    """Fixed facts of the press."""
    given = view.record.calibrations.get(press.calibration or "")
    calibration = "none" if press.calibration is None else press.calibration[:SHORT]
    rows = {
        "taken": widgets.time_label(press.taken),
        "frame": f"{press.columns} × {press.rows} px, SHA-256 {press.frame[:SHORT]}",
        "scale": "not known"
        if press.mm_per_pixel is None
        else "{:.4g} × {:.4g} mm per pixel".format(*press.mm_per_pixel),
        "probe": "not shown of a subject" if view.private else press.probe or "not named",
        "calibration": calibration if given is None or view.private else f"{given.name} ({calibration})",
        "flags": "; ".join(map(flag_text, flags_of(press, private=view.private))) or "none",
        "version": f"{press.version}",
    }
    widgets.FactList().show(rows.items())


def _edit_press_fields(page: TargetPage, target: Target, press: StoredPress, dialog: ui.dialog) -> None:
    """Place the fields of a press of a target in a dialog."""
    role = widgets.select_field(ROLE_NAMES, label="What was pressed")
    force = widgets.text_field("Force in newtons; empty if unknown")
    names = list(dict.fromkeys([*GUARD_FLAGS, *press.flags]))
    flags = widgets.select_field(names, label="Flags", multiple=True, with_input=True, new_value_mode="add-unique")
    flags.props("use-chips")
    note = widgets.text_area("Note").props("autogrow")
    widgets.muted("After a change of force or role, recompute the estimates.")

    def show(record: StoredPress) -> None:
        role.value, note.value, flags.value = record.role, record.note, list(record.flags)
        force.value = "" if record.force_n is None else number_text(record.force_n)

    def edit(record: StoredPress) -> Edited[StoredPress]:
        force_n = parse_force((force.value or "").strip(), called="force", nothing="")
        requested = {
            "role": role.value,
            "flags": tuple(flags.value or ()),
            "note": note.value or "",
            "force_n": force_n,
        }
        with field_messages(FORCE):
            return edit_press(page.instrument.store, target, record, changed(record, requested))

    fields = {"force": force, "note": note}
    Editing(page, press, dialog, fields, show=show, edit=edit, title="The press", leave="Close")


PSEUDONYM = "A pseudonym, never a name."


def about_target(page: TargetPage, view: TargetView) -> None:
    """Show name, note and truth of a target; of a subject no note."""
    target = view.target

    def edit() -> None:
        with widgets.open_dialog(page.dialogs, f"Edit target {target.number}") as dialog:
            _edit_target_fields(page, target, dialog)

    with widgets.title_row("About this target", level=3):
        widgets.button("Edit", edit, icon="edit", look="outline dense").set_enabled(not view.deleted)
        if view.state is None:
            widgets.button("Archive", lambda: _set_state(page, target, ARCHIVED), icon="archive", look="outline dense")
            widgets.button("Delete", lambda: _delete(page, target), icon="delete", look="outline dense")
    rows = {
        "name": target.name or "none",
        "note": "not shown of a subject" if view.private else target.note or "none",
        **{
            f"true {quantity_of(name).title}": measure(value, quantity_of(name).unit)
            for name, value in in_order(target.truth).items()
        },
        "entered": widgets.time_label(target.made),
        "version": f"{target.version}",
    }
    widgets.FactList().show(rows.items())


def state_banner(page: TargetPage, view: TargetView) -> None:
    """Say that a target is archived or deleted, with the button that restores it; nothing for the others."""
    state = view.state
    if state is None:
        return
    message = f"Archived on {state.since:%Y-%m-%d}: it is hidden from the lists; nothing was deleted."
    if state.name == DELETED:
        until = state.since + timedelta(days=UNDO_DAYS)
        message = f"Deleted on {state.since:%Y-%m-%d}. It can be restored until {until:%Y-%m-%d}, and is erased then."
    with ui.element("div").classes("row conflict").props('role="status"'):
        ui.label(message).classes("flag" if state.name == DELETED else "strong")
        widgets.button("Restore", lambda: _set_state(page, view.target, ""), icon="undo", look="outline dense")


async def _set_state(page: TargetPage, target: Target, state: str) -> None:
    if await page.viewer.attempt(lambda: (page.instrument.store.set_state(target, state), True)) is None:
        return
    page.viewer.notify(f"Target {target.number} is {state or 'restored'}.")
    await page.load()


async def _delete(page: TargetPage, target: Target) -> None:
    why = (
        f"It is removed from the lists and accepts no more presses. For {UNDO_DAYS} days it can be restored on this "
        "page; then its presses, estimates and frames are erased. The audit and study logs remain."
    )
    with page.dialogs:
        sure = await widgets.is_confirmed(f"Delete target {target.number}?", yes="Delete", why=why)
    if sure:
        await _set_state(page, target, DELETED)


def _edit_target_fields(page: TargetPage, target: Target, dialog: ui.dialog) -> None:
    """Place the fields of a target in a dialog."""
    subject = target.kind == "subject"
    name, note = widgets.text_field("Name"), widgets.text_area("Note").props("autogrow")
    name.props["hint"] = PSEUDONYM if subject else ""
    truth = widgets.text_area("True values, one on a line: diameter_mm=10").props("autogrow")
    truth.set_visibility(not subject)

    def show(record: Target) -> None:
        name.value, note.value, truth.value = record.name, record.note, truth_text(record.truth)

    def edit(record: Target) -> Edited[Target]:
        true = parse_truth(line for line in (truth.value or "").splitlines() if line.strip())
        requested = {"name": name.value or "", "note": note.value or "", "truth": true}
        return edit_target(page.instrument.store, record, changed(record, requested))

    fields = {"name": name, "note": note, "true value": truth, "truth": truth}
    Editing(page, target, dialog, fields, show=show, edit=edit, title=f"Target {target.number}", leave="Cancel")


SMALL_PX = 240
TWO = 2
NO_PICTURE = "This frame cannot be shown: open the press to see why."


class Presses:
    """The presses on the page of a target."""

    def __init__(self, page: TargetPage, place: ui.element) -> None:
        self._page, self._sheet = page, widgets.Redrawn(place)
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
                widgets.panel_title("Presses", level=3)
                widgets.muted(_range(view))
                ui.element("div").classes("spring")
                self._compare = widgets.button(
                    "Compare presses", lambda: compare(self._page, view), icon="compare", look="outline dense"
                )
                if view.total > AT_ONCE:
                    for text, icon, by in (("Earlier", "chevron_left", -AT_ONCE), ("Later", "chevron_right", AT_ONCE)):
                        turn = widgets.button(text, partial(self._turn, by), icon=icon, look="outline dense")
                        turn.set_enabled(0 <= view.offset + by < view.total)
            if not view.presses:
                widgets.muted("Nothing recorded yet: snapshots on the page Examine become presses.")
            with ui.element("div").classes("presses"):
                for press in view.presses:
                    self._press(press, view)

    async def _turn(self, by: int) -> None:
        self.offset = max(0, self.offset + by)
        await self._page.load()

    def _press(self, press: StoredPress, view: TargetView) -> None:
        text = widgets.press_label(press)
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
                    ui.label(widgets.force_text(press.force_n))
                widgets.muted(widgets.time_label(press.taken))
                for flag in flags:
                    ui.label(flag_text(flag)).classes("press-flag")
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
            self._compare.text = f"Compare presses ({len(self.chosen)} chosen)"


def _range(view: TargetView) -> str:
    if view.total <= AT_ONCE:
        return widgets.count_text(view.total, "press")
    return f"{view.offset + 1} to {view.offset + len(view.presses)} of {view.total}"


def _leave_out(frame: ui.element) -> None:
    """Show a message in place of a missing picture."""
    frame.clear()
    with frame:
        ui.label(NO_PICTURE).classes("press-damaged")


async def compare(page: TargetPage, view: TargetView, *, match_light: bool = False) -> None:
    """Show the two chosen presses, what differs, and the features of each."""
    compared, chosen = page.compared, tuple(page.presses.chosen)
    compared.set_visibility(True)
    compared.clear()
    with compared:
        ui.label("Loading …").classes("muted").props('role="status"')
    result = await page.viewer.attempt(_compared, page.instrument.store, view.target, chosen, match_light=match_light)
    compared.clear()
    if result is None:
        compared.set_visibility(False)
        return
    content, images, change = result
    with compared:
        with widgets.title_row(content.title, level=3):
            ui.switch(
                "match brightness",
                value=match_light,
                on_change=lambda event: compare(page, view, match_light=event.value),
            ).props("dense")
            ui.button(icon="close", on_click=lambda: compared.set_visibility(False)).props(
                'flat dense round aria-label="Close the comparison"'
            )
        FrameComparison(images, change)
        for note in content.notes:
            ui.label(note)
        for item in content.tables:
            widgets.table(item)


def _compared(
    store: Store, target: Target, chosen: Sequence[str], *, match_light: bool
) -> tuple[Page, tuple[TactileImage, ...], TactileImage | None]:
    """The comparison, the two frames, and their difference where there is one."""
    presses = [store.press(target, item) for item in chosen]
    record = replace(store.record(target, limit=0), presses=tuple(presses))
    names = [widgets.press_label(press) for press in presses]
    names = names if len(set(names)) == len(names) else [f"{name} ({at})" for at, name in enumerate(names, 1)]
    images = tuple(replace(record.image(press), name=name) for press, name in zip(presses, names, strict=True))
    item, other = images
    return comparison(item, other, match_light=match_light), images, difference(item, other, match_light=match_light)


FRAME_EVERY_S = 0.2  # of a sequence that is played; the browser fetches each frame


def play_sequence(place: ui.element, number: int, name: str, frames: int) -> None:
    """Play a recorded sequence of a target in a dialog: by itself, or frame by frame with the slider."""
    with widgets.open_dialog(place, f"{name} of target {number}", style="dialog-card wide"):
        picture = ui.element("img").classes("press-picture")
        with ui.element("div").classes("row"):
            playing = ui.switch("Play", value=True)
            slider = ui.slider(min=0, max=frames - 1, value=0).props("label").classes("sequence-slider")
            slider.props["aria-label"] = "Frame"
            text = widgets.muted()

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


def ask_to_compare(page: TargetPage, view: TargetView) -> None:
    """Ask for another target, and open both beside each other."""
    number = view.target.number
    with widgets.open_dialog(page.dialogs, f"Compare target {number}") as dialog:
        other = widgets.unit_field("Number of the other target", keys="numeric").props("autofocus")

        def go() -> None:
            text = (other.value or "").strip()
            if not text.isdecimal():
                other.error = "Enter the number of the other target."
                return
            dialog.close()
            ui.navigate.to(f"/records/compare/{number}-{int(text[:20])}")

        other.on("keydown.enter", go)
        widgets.dialog_buttons(dialog, "Compare", go)


async def compare_targets(instrument: Instrument, viewer: Viewer, pair: str) -> None:
    """Build the page of two targets beside each other: their estimates, true values and newest presses."""
    with ui.element("div").classes("stack"):
        ui.link("All targets", "/records").classes("link")
        place = ui.element("div").classes("grid")
    for number in pair.split("-", 1):
        view = await viewer.attempt(read_target, instrument.store, number, LARGEST_OFFSET)
        if view is None:
            continue
        with place, ui.element("section").classes("panel stack") as part:
            part.props["aria-label"] = f"Target {view.target.number}"
            name = f": {view.target.name}" if view.target.name else ""
            widgets.panel_title(f"Target {view.target.number}{name}").classes("target-title")
            ui.link("Open", f"/records/{view.target.number}").classes("link")
            truth = {quantity_of(key): value for key, value in in_order(view.target.truth).items()}
            facts = {f"true {item.title}": measure(value, item.unit) for item, value in truth.items()}
            widgets.FactList().show({"presses": f"{view.total}", **facts}.items())
            estimates(view)
            with ui.element("div").classes("compared"):
                for press in view.presses[:SHOWN_PRESSES]:
                    with ui.element("figure").classes("press"):
                        picture = ui.element("img").classes("press-picture")
                        picture.props["alt"] = f"Frame {widgets.press_label(press)}"
                        picture.props["src"] = f"/files/press/{view.target.number}/{press.id}.png?size=360"
                        with ui.element("figcaption"):
                            ui.label(widgets.press_label(press))


NONE_YET = "Nothing was estimated yet. Estimate needs presses that were taken under a calibration."


def estimates(view: TargetView) -> None:
    """Show the estimates and the map in force, and what of the target is damaged."""
    widgets.panel_title("Current estimates", level=3)
    current = newest_first(view.record)
    if current:
        widgets.cards(target_cards(view.record))
    else:
        widgets.muted(NONE_YET)
    with widgets.message_list():
        for message in view.stale:
            widgets.list_message(message, "doubtful")
        for stored in current:
            for message in (*result_messages(stored), origin(stored)):
                of_kind = f"Of the {stored.kind}: {message}"
                widgets.list_message(of_kind if len(current) > 1 else message)
            for table in flags_table(stored.estimate.flags, result_flags(stored)):
                for _, means, cure, _ in table.rows:
                    widgets.list_message(f"{means[:1].upper()}{means[1:]}{f': {cure}' if cure else ''}.", "doubtful")
        for message in view.record.damaged:
            widgets.list_message(f"Left out: {message}", "flag")
    for stored in current:
        if stored.kind == MAP:
            for table in result_tables(view.record, stored):
                widgets.table(table)
    if view.private:
        widgets.muted(IDENTITY_NOTE)


def history(view: TargetView) -> None:
    """Show all estimates."""
    tables = history_tables(view.record)
    for table in tables:
        widgets.table(table)
    if not tables:
        widgets.panel_title("History", level=3)
        widgets.muted("No estimate can be read." if view.record.damaged else "No estimate yet.")


NEWEST = "the newest press of each role and force"


def estimate_button(page: TargetPage, view: TargetView) -> ui.button:
    """A button that asks what to estimate from, and does it."""
    return widgets.button("Estimate", lambda: _ask(page, view), icon="calculate", look="outline dense")


def _ask(page: TargetPage, view: TargetView) -> None:
    chosen, number, last = tuple(page.presses.chosen), view.target.number, view.record.estimate
    ways = {"newest": NEWEST, **({"chosen": f"the {counted(len(chosen), 'press')} chosen below"} if chosen else {})}
    with widgets.open_dialog(page.dialogs, f"Estimate target {number}") as dialog:
        kind = widgets.select_field(list(ESTIMATES), value=ESTIMATES[0] if last is None else last.kind, label="What")
        way = ui.radio(ways, value="chosen" if chosen else "newest").props("dense")
        widgets.muted("All presses must be of one probe under one calibration.")
        active = page.instrument.calibration
        bare = active is not None and any(press.calibration is None for press in view.presses)
        name = "" if active is None else active.calibration.name
        calibrated = ui.switch(f"presses without a calibration were taken under {name}", value=False)
        calibrated.set_visibility(bare)

        async def begin() -> None:
            dialog.close()
            if calibrated.value and active is not None:
                named = await page.viewer.attempt(_calibrate, page.instrument.store, view.target, active.calibration)
                if named is None:
                    return
            presses = chosen if way.value == "chosen" else None
            estimate = partial(page.instrument.estimate, number, kind=kind.value, presses=presses)
            await follow_job(page.viewer, page.below, estimate, _show)

        widgets.dialog_buttons(dialog, "Estimate", begin)


def _calibrate(store: Store, target: Target, calibration: ProbeCalibration) -> int:
    """Say that the presses without a calibration were taken under this one; gives how many."""
    bare = [press for press in store.presses(target) if press.calibration is None]
    for press in bare:
        store.calibrate_press(press, calibration)
    return len(bare)


def _show(_: StoredEstimate) -> None:
    ui.label("The estimate is stored and current.").classes("good").props('role="status"')


EXPLAINED = (
    "The current estimates are recomputed from the stored frames. A different result is stored as a new "
    "estimate that says which one it replaces; the old one stays."
)


def recompute_button(page: TargetPage, view: TargetView) -> ui.button:
    """A button that asks whether to store what comes out, and computes."""
    button = widgets.button(
        "Repeat the estimates", lambda: _ask_to_recompute(page, view), icon="restart_alt", look="outline dense"
    )
    button.set_enabled(bool(view.record.active_results))
    return button


def _ask_to_recompute(page: TargetPage, view: TargetView) -> None:
    target = view.target
    with widgets.open_dialog(page.dialogs, f"Repeat the estimates of target {target.number}") as dialog:
        ui.label(EXPLAINED)
        dry = ui.switch("dry run: show changes, store nothing", value=False)

        async def begin() -> None:
            dialog.close()
            recompute = partial(page.instrument.recompute, target, dry_run=dry.value)
            await follow_job(page.viewer, page.below, recompute, partial(_show_recomputation, page))

        widgets.dialog_buttons(dialog, "Repeat", begin)


def _show_recomputation(page: TargetPage, recomputations: tuple[Recomputation, ...]) -> None:
    with ui.element("div").classes("outcome").props('role="status"'):
        for item in recomputations:
            ui.label(f"{item.before.kind.capitalize()}: {item.message}").classes("good" if item.same else "doubtful")
            for note in recomputation_notes(item):
                widgets.muted(note)
            if not item.same:
                widgets.table(shift_table(item))
                ui.label(recomputation_message(item))
        widgets.button("Close", page.below.clear, look="flat dense")


def target_buttons(page: TargetPage, view: TargetView) -> None:
    """Show the name of the target, the way back, and the buttons."""
    target = view.target
    name = f": {target.name}" if target.name else ""
    ui.link("All targets", "/records").classes("link")
    title = "Subject, target {number}{name}" if view.private else "Target {number}{name}"
    widgets.panel_title(title.format(number=target.number, name=name)).classes("target-title")
    ui.element("div").classes("spring")
    for change in (estimate_button(page, view), recompute_button(page, view)):
        change.set_enabled(change.enabled and not view.deleted)
    widgets.button(
        "Compare with a target", lambda: ask_to_compare(page, view), icon="compare_arrows", look="outline dense"
    )
    export_button(page.viewer, page.dialogs, lambda: [view.target.number], text="Export")
    ReportButton(page.viewer, target.number)
    ui.link("Read the report", f"/files/report/{target.number}.html", new_tab=True).classes("link button")


def show_target(instrument: Instrument, viewer: Viewer, number: str) -> None:
    """Build the page of the target whose number stands in the address."""
    follow_store(viewer, TargetPage(instrument, viewer, number).load)


def sequences(workspace: Path, number: int, dialogs: ui.element) -> None:
    """The recorded sequences of a target: played here, or downloaded as a zip file of frames, index and report."""
    widgets.panel_title("Sequences")
    found = sequence_folders(workspace, number)
    if not found:
        widgets.muted("No sequence yet: record one on the page Examine.")
        return
    with widgets.rows_under(("Sequence", "Frames", ""), label=f"Sequences of target {number}"):
        for name, frames in found.items():
            with ui.element("tr"):
                widgets.cell(name)
                widgets.cell(f"{frames:,}")
                with ui.element("td"), ui.element("div").classes("row"):
                    play = widgets.button(
                        "Play",
                        partial(play_sequence, dialogs, number, name, frames),
                        look="outline dense",
                        label=f"Play {name}",
                    )
                    play.set_visibility(frames > 0)
                    link = ui.link("Download", f"/files/sequence/{number}/{name}.zip").classes("link")
                    link.props["aria-label"] = f"Download {name}"


class TargetPage:
    """The open page of the target whose number stands in the address."""

    def __init__(self, instrument: Instrument, viewer: Viewer, number: str) -> None:
        self.instrument, self.viewer, self.number = instrument, viewer, number
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                self._head = widgets.Redrawn(ui.element("div").classes("row"))
                self._state = ui.element("div")
                self.below = ui.element("div")
            with ui.element("div").classes("split records-split") as self._parts:
                with ui.element("div").classes("stack"):
                    presses = ui.element("section").classes("panel")
                    self.compared = ui.element("section").classes("panel")
                    self._sequences = ui.element("section").classes("panel")
                    self._history = ui.element("section").classes("panel history")
                with ui.element("div").classes("stack"):
                    self._estimates = ui.element("section").classes("panel")
                    self._about = ui.element("section").classes("panel")
            self.dialogs = ui.element("div")
        self._requested = 0
        self.presses = Presses(self, presses)
        self.compared.set_visibility(False)
        self._parts.set_visibility(False)

    async def load(self) -> None:
        """Read the target anew; of several readings at once the last requested one is shown."""
        self._requested += 1
        turn = self._requested
        try:
            view = await run.io_bound(read_target, self.instrument.store, self.number, self.presses.offset)
        except TsisError as error:
            if turn == self._requested:
                self._refuse(str(error))
            return
        if turn == self._requested and view is not None:  # None while the console closes
            self._show(view)

    def _show(self, view: TargetView) -> None:
        if not self._head.changes_to(view.fingerprint):  # unchanged buttons stay: they lose clicks while replaced
            return
        self._parts.set_visibility(True)
        with self._head.element:
            target_buttons(self, view)
        self.presses.show(view)
        for position in (self._state, self._estimates, self._about, self._history):
            position.clear()
        with self._state:
            state_banner(self, view)
        with self._estimates:
            estimates(view)
        with self._about:
            about_target(self, view)
        with self._history:
            history(view)
        self._sequences.clear()
        with self._sequences:
            sequences(self.instrument.terms.workspace, view.target.number, self.dialogs)

    def _refuse(self, message: str) -> None:
        self._parts.set_visibility(False)
        self._head.changes_to(None)
        self._head.element.clear()
        with self._head.element:
            widgets.panel_title("Target")
            ui.label(message).classes("flag").props('role="alert"')
            ui.link("All targets", "/records").classes("link")
