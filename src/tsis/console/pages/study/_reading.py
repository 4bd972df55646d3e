"""Progress of the devices, and import and export of readings."""

from __future__ import annotations

import re
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import (
    LARGEST_MIB,
    ProgressBar,
    loading,
    one_file,
    panel_title,
    typed_number,
    unit_field,
)
from tsis.console.pages.study._context import name_in, who_field
from tsis.console.studies import begin_reading, job_of
from tsis.files import one_line
from tsis.study import READING_COLUMNS, export_readings, import_table

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.console.pages.study._context import StudyContext, StudyView


NONE_YET = "Nothing was read yet. Run the virtual probe, or import the readings of another device."


def show_devices(page: StudyContext, view: StudyView) -> None:
    """Place the devices with their operators."""
    if not view.devices:
        ui.label(NONE_YET).classes("muted")
    for device in view.study.devices:
        stored = [item for item in view.devices if item.device == device]
        with ui.element("div").classes("study-device"):
            with ui.element("div").classes("row"):
                ui.label(device).classes("strong wordy")
                ui.label(f"threshold {stored[0].threshold:g}").classes("muted")
                ui.element("div").classes("spring")
                export = ui.button(
                    "Export readings", icon="download", on_click=lambda _, device=device: _export(page, device)
                )
                export.props("dense no-caps outline").props["aria-label"] = f"Export readings of {device}"
            for item in stored:
                undecided = f", {item.undecided} undecided" if item.undecided else ""
                ui.label(f"{item.operator}: {item.read} of {item.expected} read{undecided}").classes("wordy")
                bar = ui.linear_progress(min(1.0, item.read / item.expected), show_value=False, size="6px")
                bar.props["aria-label"] = f"Read with {device} by {item.operator}"


async def _export(page: StudyContext, device: str) -> None:
    content = await page.viewer.attempt(lambda: export_readings(page.repository.study(page.name), device))
    if content is not None:
        text = re.sub(r"[^A-Za-z0-9]+", "-", device).strip("-") or "device"
        ui.download.content(content, f"{page.name}-{text[:60]}.csv", "text/csv")


class JobProgress:
    """Progress, message and a button that ends the job."""

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        with ui.element("div").classes("stack tight") as self._container:
            with ui.element("div").classes("row"):
                self._message = ui.label().classes("wordy").props('role="status"')
                self._end = ui.button("End", on_click=self._ended).props("dense no-caps outline")
            self._bar = ProgressBar("Progress of the study")
        self._container.set_visibility(False)

    def refresh(self) -> bool:
        """Show how far it is, and return whether it is under way."""
        state = job_of(self._page.jobs, self._page.name)
        self._container.set_visibility(state is not None)
        if state is None:
            return False
        count = f" {state.done} of {state.total}." if state.running and state.total else ""
        self._message.text = f"{state.sentence or 'It begins when others are done.'}{count}"
        self._end.set_visibility(state.running)
        self._bar.show(state)
        return state.running

    def _ended(self) -> None:
        state = job_of(self._page.jobs, self._page.name)
        if state is not None and state.running:
            self._page.jobs.get(state.identity).end()


MEANT = (
    "The virtual probe of this study presses what is left, under the codes. It needs no camera. End it at any time: "
    "what was read is kept, and the next run goes on there. Another operator reads every target anew."
)


class Running:
    """Operator and button."""

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        self._named = False
        panel_title("Virtual probe")
        ui.label(MEANT).classes("muted")
        with ui.element("div").classes("row"):
            self._who = who_field(page.viewer, "Operator")
            self._begin = ui.button("Run on the virtual probe", icon="play_arrow", on_click=self._run).props("no-caps")

    def show(self, view: StudyView) -> None:
        """Suggest the operator who has still to read, in a browser that knows no name."""
        own = [device for device in view.devices if device.device == view.study.plan.device]
        before = [device for device in own if device.read < device.expected]
        if before and not self._named and not self._page.viewer.operator and not self._who.value:
            self._who.set_value(max(before, key=lambda item: item.read).operator)
        self._named = True

    def allow(self, possible: bool) -> None:
        """Enable the button, or disable it while a job runs."""
        self._begin.set_enabled(possible)

    async def _run(self) -> None:
        page = self._page
        with loading(self._begin):
            await page.viewer.attempt(
                begin_reading, page.jobs, page.repository, page.name, operator=name_in(page.viewer, self._who)
            )


EXPLAINED = (
    f"A CSV file with the columns {', '.join(READING_COLUMNS)}. A higher score says that an inclusion is "
    "likelier, an empty one is undecided; the last three may be empty. A table is entered whole or not at all."
)
TOO_LARGE = f"readings must be one CSV file of at most {LARGEST_MIB} MiB here; larger ones: tsis study import"
CUT = "the file did not come whole; try again"


def import_button(page: StudyContext) -> ui.button:
    """A button that asks for device, threshold and file, and enters its readings."""
    viewer = page.viewer
    with ui.dialog() as dialog, ui.card().classes("dialog-card study-dialog"):
        panel_title("Import readings")
        ui.label(EXPLAINED).classes("muted")
        device = unit_field("Device", keys="text")
        threshold = unit_field("Threshold")
        threshold.props("stack-label").props["placeholder"] = "the study's, or that of the first import"
        who = who_field(viewer, "Entered by")
        upload = one_file(viewer, "CSV file of readings", accept=".csv,text/csv", refused=TOO_LARGE)
        ui.button("Close", on_click=dialog.close).props("dense no-caps flat")

    async def uploaded(event: UploadEventArguments) -> None:
        upload.reset()
        try:
            content = await event.file.read()
        except OSError:
            viewer.complain(CUT)
            return
        named = one_line(PurePosixPath(event.file.name.replace("\\", "/")).name or "readings.csv")
        entered = await viewer.attempt(
            _enter, page, content, named, (device.value or "").strip(), threshold.value or "", name_in(viewer, who)
        )
        if entered is not None:
            viewer.notify(f"{entered} readings entered.")
            dialog.close()

    upload.on_upload(uploaded)
    return ui.button("Import readings", icon="upload_file", on_click=dialog.open).props("dense no-caps outline")


def _enter(page: StudyContext, content: bytes, file: str, device: str, threshold: str, actor: str) -> int:
    study = page.repository.study(page.name)
    limit = typed_number("threshold", threshold) if threshold.strip() else None
    after = import_table(study, content, file, device=device, threshold=limit, actor=actor)
    return len(after.readings) - len(study.readings)
