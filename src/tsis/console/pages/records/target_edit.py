"""What people wrote of a target: shown on its page, and changed in a dialog."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from nicegui import ui

from tsis.console.pages.fact_list import FactList
from tsis.console.pages.headings import panel_title
from tsis.console.pages.records.editing import Editing
from tsis.console.pages.records.edits import Edited, changed, edit_target, truth_text
from tsis.console.pages.words import time_words
from tsis.records.written import parse_truth
from tsis.report.target_tables import measure, parameter_label

if TYPE_CHECKING:
    from tsis.console.pages.records.context import TargetContext
    from tsis.console.pages.records.reading import TargetSeen
    from tsis.records import Target

PSEUDONYM = "A pseudonym, never a name."


def about_target(page: TargetContext, seen: TargetSeen) -> None:
    """Show name, note and truth of a target; of a subject no note."""
    target = seen.target
    with ui.element("div").classes("row"):
        panel_title("About this target", level=3)
        ui.element("div").classes("spring")
        ui.button("Edit", icon="edit", on_click=lambda: _ask(page, target)).props("dense no-caps outline")
    rows = {
        "name": target.name or "none",
        "note": "not shown of a subject" if seen.private else target.note or "none",
        **{
            f"true {parameter_label(name)[0]}": measure(value, parameter_label(name)[1])
            for name, value in target.truth.items()
        },
        "entered": time_words(target.made),
        "version": f"{target.version}",
    }
    FactList().show(rows.items())


def _ask(page: TargetContext, target: Target) -> None:
    with page.dialogs, ui.dialog(value=True) as dialog, ui.card().classes("asked"):
        _TargetEditing(page, target, dialog, leave="Cancel")
    dialog.on("hide", dialog.delete)


class _TargetEditing(Editing["Target"]):
    """The fields of a target in a dialog."""

    def _lay_out(self) -> None:
        subject = self._record.kind == "subject"
        panel_title(f"Edit target {self._record.number}")
        self._name = ui.input("Name").props("outlined dense")
        self._name.props["hint"] = PSEUDONYM if subject else ""
        self._note = ui.textarea("Note").props("outlined dense autogrow")
        self._truth = ui.textarea("True values, one on a line: diameter_mm=10").props("outlined dense autogrow")
        self._truth.set_visibility(not subject)

    def _show(self, record: Target) -> None:
        self._name.value, self._note.value = record.name, record.note
        self._truth.value = truth_text(record.truth)

    def _written(self) -> tuple[str, str, str]:
        return self._name.value or "", self._note.value or "", self._truth.value or ""

    def _edited(self, *written: Any) -> Edited[Target]:
        name, note, truth = written
        lines = (line for line in truth.splitlines() if line.strip())
        changes = changed(self._record, {"name": name, "note": note, "truth": parse_truth(lines)})
        return edit_target(self._page.bench.store, self._record, changes) if changes else Edited(record=self._record)

    def _saved(self, record: Target) -> str:
        return f"Target {record.number} is version {record.version} now."
