"""Dialogs that show and edit a press or a target, and conflicts with another editor."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from datetime import timedelta
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from nicegui import run, ui

from tsis.calibration.guard import GUARD_FLAGS
from tsis.console.pages import components as kit
from tsis.console.pages.records._context import fault_of, flags_of
from tsis.errors import StaleRecordError
from tsis.present.labels import quantity_of
from tsis.present.target import SHORT, measure
from tsis.records.deidentification import DAMAGED
from tsis.records.reader import ARCHIVED, DELETED
from tsis.records.rows import EDITABLE
from tsis.records.store import UNDO_DAYS
from tsis.records.values import ROLE_NAMES, parse_force, parse_truth

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.console.pages.records._context import TargetContext, TargetView
    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


MOST_SHOWN = 120  # letters of a value
Record = TypeVar("Record")


@dataclass(frozen=True, slots=True, kw_only=True)
class Edited(Generic[Record]):
    """Result of a change: the record as stored now; where it was refused, why, and the other editor's changes."""

    record: Record
    refused: str = ""  # why it was not changed; empty when it was
    differences: tuple[str, ...] = ()  # one message for each field that another editor has changed


def edit_target(store: Store, target: Target, changes: Mapping[str, Any]) -> Edited[Target]:
    """Change a target as it was read; errors as `tsis.records.store.Store.edit_target`, but for that of being late."""
    try:
        return Edited(record=store.edit_target(target, **changes))
    except StaleRecordError as error:
        now = store.target(target.number)
        return Edited(record=now, refused=str(error), differences=differences(target, now, EDITABLE["target"]))


def edit_press(store: Store, target: Target, press: StoredPress, changes: Mapping[str, Any]) -> Edited[StoredPress]:
    """Change a press as it was read; errors as `edit_target`."""
    try:
        return Edited(record=store.edit_press(press, **changes))
    except StaleRecordError as error:
        now = store.press(target, press.id)
        return Edited(record=now, refused=str(error), differences=differences(press, now, EDITABLE["press"]))


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


class Editing(ABC, Generic[Record]):
    """The fields of a record in a dialog; ``leave`` labels the button that changes nothing."""

    _fields: Mapping[str, ui.input | ui.textarea]  # by their names in errors

    def __init__(self, page: TargetContext, record: Record, dialog: ui.dialog, *, leave: str) -> None:
        self._page, self._record, self._dialog = page, record, dialog
        self._lay_out()
        self._conflict = ui.element("div")
        self._fill(record)
        kit.dialog_buttons(dialog, "Save", self._save, leave=leave)

    @abstractmethod
    def _lay_out(self) -> None:
        """Make the fields."""

    @abstractmethod
    def _show(self, record: Record) -> None:
        """Write a record into the fields."""

    @abstractmethod
    def _written(self) -> tuple[Any, ...]:
        """Contents of the fields, for `_edited`."""

    @abstractmethod
    def _edited(self, *written: Any) -> Edited[Record]:
        """Change the record in the store, away from the event loop."""

    @abstractmethod
    def _saved(self, record: Record) -> str:
        """Say that it was saved."""

    def _fill(self, record: Record) -> None:
        self._record = record
        self._show(record)
        self._conflict.clear()

    async def _save(self) -> None:
        result = await kit.submit(self._page.viewer, self._fields, self._edited, *self._written())
        if result is None:
            return
        if result.refused:
            self._show_conflict(result)
            return
        self._dialog.close()
        self._page.viewer.notify(self._saved(result.record))
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
                kit.button("Discard my changes", lambda: self._fill(result.record), look="outline dense")
                kit.button("Overwrite with mine", overwrite, look="outline dense")


LARGE_PX = 768


def open_press(page: TargetContext, view: TargetView, press: StoredPress) -> None:
    """Show a press in a dialog."""
    title = f"Press {kit.press_label(press)}"
    with (
        kit.open_dialog(page.dialogs, title, style="dialog-card wide") as dialog,
        ui.element("div").classes("press-large"),
    ):
        with ui.element("div").classes("stack"):
            picture = ui.element("img").classes("press-picture")
            picture.props["alt"] = f"Frame {kit.press_label(press)}"
            picture.props["src"] = f"/files/press/{view.target.number}/{press.id}.png?size={LARGE_PX}"
            why = ui.label().classes("flag identity").props('role="alert"')
            picture.on("error", lambda: _show_fault(page, view, press, why), args=[])
            _facts(view, press)
        with ui.element("div").classes("stack"):
            _PressEditing(page, view.target, press, dialog)


async def _show_fault(page: TargetContext, view: TargetView, press: StoredPress, place: ui.label) -> None:
    """Show why the frame of a press cannot be read; of a subject without the path, which may identify the person."""
    message = await run.io_bound(fault_of, page.instrument.store, press)
    place.text = DAMAGED if view.private and message else message


def _facts(view: TargetView, press: StoredPress) -> None:
    """Fixed facts of the press."""
    given = view.record.calibrations.get(press.calibration or "")
    calibration = "none" if press.calibration is None else press.calibration[:SHORT]
    rows = {
        "taken": kit.time_label(press.taken),
        "frame": f"{press.columns} × {press.rows} px, SHA-256 {press.frame[:SHORT]}",
        "scale": "not known"
        if press.mm_per_pixel is None
        else "{:.4g} × {:.4g} mm per pixel".format(*press.mm_per_pixel),
        "probe": "not shown of a subject" if view.private else press.probe or "not named",
        "calibration": calibration if given is None or view.private else f"{given.name} ({calibration})",
        "flags": ", ".join(flags_of(press, private=view.private)) or "none",
        "version": f"{press.version}",
    }
    kit.FactList().show(rows.items())


class _PressEditing(Editing["StoredPress"]):
    """The fields of a press of a target in a dialog."""

    def __init__(self, page: TargetContext, target: Target, press: StoredPress, dialog: ui.dialog) -> None:
        self._target = target
        super().__init__(page, press, dialog, leave="Close")

    def _lay_out(self) -> None:
        self._role = kit.select_field(ROLE_NAMES, label="What was pressed")
        self._force = kit.text_field("Force in newtons; empty if unknown")
        names = list(dict.fromkeys([*GUARD_FLAGS, *self._record.flags]))
        self._flags = kit.select_field(
            names, label="Flags", multiple=True, with_input=True, new_value_mode="add-unique"
        ).props("use-chips")
        self._note = kit.text_area("Note").props("autogrow")
        self._fields = {"force": self._force, "note": self._note}
        kit.muted("After a change of force or role, recompute the estimates.")

    def _show(self, record: StoredPress) -> None:
        self._role.value, self._note.value = record.role, record.note
        self._force.value = "" if record.force_n is None else number_text(record.force_n)
        self._flags.value = list(record.flags)

    def _written(self) -> tuple[str, dict[str, Any]]:
        requested = {"role": self._role.value, "flags": tuple(self._flags.value or ()), "note": self._note.value or ""}
        return self._force.value or "", requested

    def _edited(self, *written: Any) -> Edited[StoredPress]:
        force, requested = written
        force_n = parse_force(force.strip(), called="force", nothing="")
        changes = changed(self._record, {**requested, "force_n": force_n})
        if not changes:
            return Edited(record=self._record)
        with kit.field_messages(kit.FORCE):
            return edit_press(self._page.instrument.store, self._target, self._record, changes)

    def _saved(self, record: StoredPress) -> str:
        return f"The press is version {record.version} now."


PSEUDONYM = "A pseudonym, never a name."


def about_target(page: TargetContext, view: TargetView) -> None:
    """Show name, note and truth of a target; of a subject no note."""
    target = view.target

    def edit() -> None:
        with kit.open_dialog(page.dialogs, f"Edit target {target.number}") as dialog:
            _TargetEditing(page, target, dialog, leave="Cancel")

    with kit.title_row("About this target", level=3):
        kit.button("Edit", edit, icon="edit", look="outline dense")
        if view.state is None:
            kit.button("Archive", lambda: _set_state(page, target, ARCHIVED), icon="archive", look="outline dense")
            kit.button("Delete", lambda: _delete(page, target), icon="delete", look="outline dense")
    rows = {
        "name": target.name or "none",
        "note": "not shown of a subject" if view.private else target.note or "none",
        **{
            f"true {quantity_of(name).title}": measure(value, quantity_of(name).unit)
            for name, value in target.truth.items()
        },
        "entered": kit.time_label(target.made),
        "version": f"{target.version}",
    }
    kit.FactList().show(rows.items())


def state_banner(page: TargetContext, view: TargetView) -> None:
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
        kit.button("Restore", lambda: _set_state(page, view.target, ""), icon="undo", look="outline dense")


async def _set_state(page: TargetContext, target: Target, state: str) -> None:
    if await page.viewer.attempt(lambda: (page.instrument.store.set_state(target, state), True)) is None:
        return
    page.viewer.notify(f"Target {target.number} is {state or 'restored'}.")
    await page.load()


async def _delete(page: TargetContext, target: Target) -> None:
    why = (
        f"It is removed from the lists and accepts no more presses. For {UNDO_DAYS} days it can be restored on this "
        "page; then its presses, estimates and frames are erased. The audit and study logs remain."
    )
    with page.dialogs:
        sure = await kit.is_confirmed(f"Delete target {target.number}?", yes="Delete", why=why)
    if sure:
        await _set_state(page, target, DELETED)


class _TargetEditing(Editing["Target"]):
    """The fields of a target in a dialog."""

    def _lay_out(self) -> None:
        subject = self._record.kind == "subject"
        self._name = kit.text_field("Name")
        self._name.props["hint"] = PSEUDONYM if subject else ""
        self._note = kit.text_area("Note").props("autogrow")
        self._truth = kit.text_area("True values, one on a line: diameter_mm=10").props("autogrow")
        self._truth.set_visibility(not subject)
        self._fields = {"name": self._name, "note": self._note, "true value": self._truth, "truth": self._truth}

    def _show(self, record: Target) -> None:
        self._name.value, self._note.value = record.name, record.note
        self._truth.value = truth_text(record.truth)

    def _written(self) -> tuple[str, str, str]:
        return self._name.value or "", self._note.value or "", self._truth.value or ""

    def _edited(self, *written: Any) -> Edited[Target]:
        name, note, truth = written
        lines = (line for line in truth.splitlines() if line.strip())
        changes = changed(self._record, {"name": name, "note": note, "truth": parse_truth(lines)})
        return (
            edit_target(self._page.instrument.store, self._record, changes) if changes else Edited(record=self._record)
        )

    def _saved(self, record: Target) -> str:
        return f"Target {record.number} is version {record.version} now."
