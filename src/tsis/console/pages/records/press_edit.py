"""A press at large, and what people may change of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import run, ui

from tsis.calibration.guard import FLAGS
from tsis.console.pages.fact_list import FactList
from tsis.console.pages.field_words import FORCE, field_words
from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.editing import Editing
from tsis.console.pages.records.edits import Edited, changed, edit_press, number_text
from tsis.console.pages.records.reading import fault_of, flags_of
from tsis.console.pages.words import press_words, time_words
from tsis.records.deidentified import DAMAGED
from tsis.records.values import ROLE_WORDS
from tsis.records.written import parse_force
from tsis.report.target_words import SHORT

if TYPE_CHECKING:
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.records import StoredPress, Target

LARGE_PX = 768


def open_press(page: TargetContext, seen: TargetSeen, press: StoredPress) -> None:
    """Show a press in a dialog."""
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked wide"):
        panel_title(f"Press {press_words(press)}")
        with ui.element("div").classes("press-large"):
            with ui.element("div").classes("stack"):
                picture = ui.element("img").classes("press-picture")
                picture.props["alt"] = f"Frame {press_words(press)}"
                picture.props["src"] = f"/files/press/{seen.target.number}/{press.id}.png?size={LARGE_PX}"
                why = ui.label().classes("flag identity").props('role="alert"')
                picture.on("error", lambda: _tell_why(page, seen, press, why), args=[])
                _facts(seen, press)
            with ui.element("div").classes("stack"):
                _PressEditing(page, seen.target, press, dialog)
    dialog.on("hide", dialog.delete)


async def _tell_why(page: TargetContext, seen: TargetSeen, press: StoredPress, place: ui.label) -> None:
    """Say why the frame of a press cannot be shown; of a subject without the place, whose name may tell whose it is."""
    sentence = await run.io_bound(fault_of, page.bench.store, press)
    place.text = DAMAGED if seen.private and sentence else sentence


def _facts(seen: TargetSeen, press: StoredPress) -> None:
    """What the store knows of the press and nobody may change."""
    known = seen.dossier.calibrations.get(press.calibration or "")
    calibration = "none" if press.calibration is None else press.calibration[:SHORT]
    rows = {
        "taken": time_words(press.taken),
        "frame": f"{press.columns} × {press.rows} px, SHA-256 {press.frame[:SHORT]}",
        "scale": "not known"
        if press.mm_per_pixel is None
        else "{:.4g} × {:.4g} mm per pixel".format(*press.mm_per_pixel),
        "probe": "not shown of a subject" if seen.private else press.probe or "not named",
        "calibration": calibration if known is None or seen.private else f"{known.name} ({calibration})",
        "flags": ", ".join(flags_of(press, private=seen.private)) or "none",
        "version": f"{press.version}",
    }
    FactList().show(rows.items())


class _PressEditing(Editing["StoredPress"]):
    """The fields of a press of a target in a dialog."""

    def __init__(self, page: TargetContext, target: Target, press: StoredPress, dialog: ui.dialog) -> None:
        self._target = target
        super().__init__(page, press, dialog, leave="Close")

    def _lay_out(self) -> None:
        self._role = ui.select(ROLE_WORDS, label="What was pressed").props("outlined dense")
        self._force = ui.input("Force in newtons; empty where nobody knows it").props("outlined dense")
        names = list(dict.fromkeys([*FLAGS, *self._record.flags]))
        self._flags = ui.select(
            names, label="What speaks against it", multiple=True, with_input=True, new_value_mode="add-unique"
        ).props("outlined dense use-chips")
        self._note = ui.textarea("Note").props("outlined dense autogrow")
        ui.label("Where force or role are changed, recompute the estimates.").classes("muted")

    def _show(self, record: StoredPress) -> None:
        self._role.value, self._note.value = record.role, record.note
        self._force.value = "" if record.force_n is None else number_text(record.force_n)
        self._flags.value = list(record.flags)

    def _written(self) -> tuple[str, dict[str, Any]]:
        wanted = {"role": self._role.value, "flags": tuple(self._flags.value or ()), "note": self._note.value or ""}
        return self._force.value or "", wanted

    def _edited(self, *written: Any) -> Edited[StoredPress]:
        force, wanted = written
        force_n = parse_force(force.strip(), called="force", nothing="")
        changes = changed(self._record, {**wanted, "force_n": force_n})
        if not changes:
            return Edited(record=self._record)
        with field_words(FORCE):
            return edit_press(self._page.bench.store, self._target, self._record, changes)

    def _saved(self, record: StoredPress) -> str:
        return f"The press is version {record.version} now."
