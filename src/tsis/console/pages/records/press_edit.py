"""A press at large, and what people may change of it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import run, ui

from tsis.calibration.guard import FLAGS
from tsis.console.pages.fact_list import FactList
from tsis.console.pages.field_words import FORCE, field_words
from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.conflict import show_conflict
from tsis.console.pages.records.edits import Edited, changed, edit_press, number_text
from tsis.console.pages.records.reading import fault_of, flags_of
from tsis.console.pages.words import press_words, time_words
from tsis.records.deidentified import DAMAGED
from tsis.records.values import ROLE_WORDS
from tsis.records.written import written_force
from tsis.report.target_words import SHORT

if TYPE_CHECKING:
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.console.pages.records.target import TargetPage
    from tsis.records import Press, Store, Target

LARGE_PX = 768


def open_press(page: TargetPage, seen: TargetSeen, press: Press) -> None:
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
                _Editing(page, seen, press, dialog)
    dialog.on("hide", dialog.delete)


async def _tell_why(page: TargetPage, seen: TargetSeen, press: Press, place: ui.label) -> None:
    """Say why the frame of a press cannot be shown; of a subject without the place, whose name may tell whose it is."""
    sentence = await run.io_bound(fault_of, page.bench.store, press)
    place.text = DAMAGED if seen.private and sentence else sentence


def _facts(seen: TargetSeen, press: Press) -> None:
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


class _Editing:
    """The fields of a press in a dialog."""

    def __init__(self, page: TargetPage, seen: TargetSeen, press: Press, dialog: ui.dialog) -> None:
        self._page, self._target, self._press, self._dialog = page, seen.target, press, dialog
        self._role = ui.select(ROLE_WORDS, label="What was pressed").props("outlined dense")
        self._force = ui.input("Force in newtons; empty where nobody knows it").props("outlined dense")
        names = list(dict.fromkeys([*FLAGS, *press.flags]))
        self._flags = ui.select(
            names, label="What speaks against it", multiple=True, with_input=True, new_value_mode="add-unique"
        ).props("outlined dense use-chips")
        self._note = ui.textarea("Note").props("outlined dense autogrow")
        ui.label("Where force or role are changed, recompute the estimates.").classes("muted")
        self._conflict = ui.element("div")
        self._fill(press)
        with ui.element("div").classes("row"):
            ui.button("Save", on_click=self._save).props("no-caps dense unelevated")
            ui.button("Close", on_click=dialog.close).props("no-caps dense flat")

    def _fill(self, press: Press) -> None:
        self._press = press
        self._role.value, self._note.value = press.role, press.note
        self._force.value = "" if press.force_n is None else number_text(press.force_n)
        self._flags.value = list(press.flags)
        self._conflict.clear()

    async def _save(self) -> None:
        wanted = {
            "role": self._role.value,
            "flags": tuple(self._flags.value or ()),
            "note": self._note.value or "",
        }
        found: Edited[Press] | None = await self._page.viewer.attempt(
            _edited, self._page.bench.store, self._target, self._press, self._force.value or "", wanted
        )
        if found is None:
            return
        if found.refused:
            show_conflict(
                self._conflict, found, take=lambda: self._fill(found.record), keep=lambda: self._save_over(found.record)
            )
            return
        self._dialog.close()
        self._page.viewer.tell(f"The press is version {found.record.version} now.")
        await self._page.load()

    async def _save_over(self, now: Press) -> None:
        self._press = now
        await self._save()


def _edited(store: Store, target: Target, press: Press, force: str, wanted: dict[str, Any]) -> Edited[Press]:
    force_n = written_force(force.strip(), called="force", nothing="")
    changes = changed(press, {**wanted, "force_n": force_n})
    with field_words(FORCE):
        return edit_press(store, target, press, changes) if changes else Edited(record=press)
