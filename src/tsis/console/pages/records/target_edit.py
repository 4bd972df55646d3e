"""What people wrote of a target: shown on its page, and changed in a dialog."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from tsis.console.pages.fact_list import FactList
from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.conflict import show_conflict
from tsis.console.pages.records.edits import Edited, changed, edit_target, truth_text
from tsis.console.pages.words import time_words
from tsis.records.written import written_truth
from tsis.report.target_tables import measure, named

if TYPE_CHECKING:
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.console.pages.records.target import TargetPage
    from tsis.records import Store, Target

PSEUDONYM = "A pseudonym, never a name."


def about_target(page: TargetPage, seen: TargetSeen) -> None:
    """Show name, note and truth of a target; of a subject no note."""
    target = seen.target
    with ui.element("div").classes("row"):
        panel_title("About this target", level=3)
        ui.element("div").classes("spring")
        ui.button("Edit", icon="edit", on_click=lambda: _ask(page, target)).props("dense no-caps outline")
    rows = {
        "name": target.name or "none",
        "note": "not shown of a subject" if seen.private else target.note or "none",
        **{f"true {named(name)[0]}": measure(value, named(name)[1]) for name, value in target.truth.items()},
        "entered": time_words(target.made),
        "version": f"{target.version}",
    }
    FactList().show(rows.items())


def _ask(page: TargetPage, target: Target) -> None:
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        _Editing(page, target, dialog)
    dialog.on("hide", dialog.delete)


class _Editing:
    """The fields of a target in a dialog."""

    def __init__(self, page: TargetPage, target: Target, dialog: ui.dialog) -> None:
        self._page, self._target, self._dialog = page, target, dialog
        panel_title(f"Edit target {target.number}")
        self._name = ui.input("Name").props("outlined dense")
        self._name.props["hint"] = PSEUDONYM if target.kind == "subject" else ""
        self._note = ui.textarea("Note").props("outlined dense autogrow")
        self._truth = ui.textarea("True values, one on a line: diameter_mm=10").props("outlined dense autogrow")
        self._truth.set_visibility(target.kind != "subject")
        self._conflict = ui.element("div")
        self._fill(target)
        with ui.element("div").classes("row"):
            ui.button("Save", on_click=self._save).props("no-caps dense unelevated")
            ui.button("Cancel", on_click=dialog.close).props("no-caps dense flat")

    def _fill(self, target: Target) -> None:
        self._target = target
        self._name.value, self._note.value = target.name, target.note
        self._truth.value = truth_text(target.truth)
        self._conflict.clear()

    async def _save(self) -> None:
        wanted = (self._name.value or "", self._note.value or "", self._truth.value or "")
        found: Edited[Target] | None = await self._page.viewer.attempt(
            _edited, self._page.bench.store, self._target, *wanted
        )
        if found is None:
            return
        if found.refused:
            show_conflict(
                self._conflict, found, take=lambda: self._fill(found.record), keep=lambda: self._save_over(found.record)
            )
            return
        self._dialog.close()
        self._page.viewer.tell(f"Target {found.record.number} is version {found.record.version} now.")
        await self._page.load()

    async def _save_over(self, now: Target) -> None:
        self._target = now
        await self._save()


def _edited(store: Store, target: Target, name: str, note: str, truth: str) -> Edited[Target]:
    wanted: dict[str, Any] = {
        "name": name,
        "note": note,
        "truth": written_truth(line for line in truth.splitlines() if line.strip()),
    }
    changes = changed(target, wanted)
    return edit_target(store, target, changes) if changes else Edited(record=target)
