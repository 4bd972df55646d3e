"""Readings of a study, its unblinding and verification, and its results with the report."""

from __future__ import annotations

import re
from functools import partial
from pathlib import PurePosixPath
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages import components as kit
from tsis.console.pages.study._context import name_in, study_result, who_field
from tsis.console.studies import begin_publishing, begin_reading, job_of, unread
from tsis.files.reading import one_line
from tsis.present.target import count_of
from tsis.study.folder import verify_study
from tsis.study.readings import READING_COLUMNS, export_readings, import_table

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.console.pages.study._context import StudyContext, StudyResult, StudyView
    from tsis.study.folder import Study, StudyVerification


class Outcome:
    """A panel that is there once the study is unblinded."""

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        self._panel = ui.element("section").classes("panel stack").props('aria-label="Results of the study"')
        self._panel.set_visibility(False)

    async def show(self, view: StudyView) -> StudyResult | None:
        """Show and return the numbers; None while the study is blind, or without numbers."""
        if view.study.unblinded is None:
            return None
        self._panel.set_visibility(True)
        self._panel.clear()
        with self._panel:
            ui.label("Comparing the readings with the truth ...").classes("muted").props('role="status"')
        result = await self._page.viewer.attempt(study_result, view.study)
        self._panel.clear()
        with self._panel:
            self._head(view)
            if result is None:
                ui.label("The results cannot be read; Verify shows the cause.").classes("flag")
            else:
                self._body(result)
        return result

    def _head(self, view: StudyView) -> None:
        with kit.title_row("Results of the study"):
            if view.reported:
                position = f"/files/study/{self._page.name}/report"
                ui.link("Report", f"{position}.html", new_tab=True).classes("link button")
                ui.link("PDF", f"{position}.pdf").classes("link button").props("download")
            else:
                kit.muted("No report yet: Analyse again creates it.")

    def _body(self, result: StudyResult) -> None:
        kit.cards(result.page.cards)
        with ui.element("div").classes("study-outcome"):
            if result.curves:
                kit.figure(result.page.pictures[0], result.curves)
            with ui.element("div"):
                kit.panel_title("Notes", level=3)
                with ui.element("div").classes("wordy"):
                    kit.message_list(result.page.notes)


MOST_SHOWN = 5  # faults
MEANT = (
    "This opens the seal: the codes are shown with their true targets, and no more readings are accepted. The study's "
    "log records who did it and when; this cannot be undone. Then the readings are analysed and the report is "
    "written."
)
FAULTY = "The study's files were changed; the log records that as well:"


class Unblinding:
    """The button, and its dialog."""

    def __init__(self, page: StudyContext) -> None:
        self._page, self._blind = page, True
        self._dialog: ui.dialog | None = None
        self._who: ui.input | None = None
        self._container = ui.element("div")
        self._button = kit.button("Unblind and analyse", self._clicked, icon="visibility", look="outline dense")

    async def show(self, view: StudyView) -> None:
        """Say what a click would do; an open dialog is asked anew, since it told of the study before."""
        self._blind = view.study.unblinded is None
        self._button.text = "Unblind and analyse" if self._blind else "Analyse again"
        if self._dialog is not None and not self._dialog.is_deleted and self._dialog.value:
            who = "" if self._who is None else self._who.value or ""
            self._dialog.delete()
            await self._clicked()
            if self._who is not None and who:
                self._who.set_value(who)

    async def _clicked(self) -> None:
        page = self._page
        with kit.loading(self._button):
            result = await page.viewer.attempt(
                lambda: (page.repository.study(page.name), verify_study(page.repository.path(page.name)))
            )
        if result is not None:
            self._confirm(*result)

    def _confirm(self, study: Study, verification: StudyVerification) -> None:
        page, left = self._page, unread(study)
        blind = study.unblinded is None
        title = ("Unblind study {name}" if blind else "Analyse study {name}").format(name=study.plan.name)
        with kit.open_dialog(self._container, title, style="dialog-card study-dialog") as dialog:
            self._dialog = dialog
            if blind:
                ui.label(f"{MEANT} The study has {count_of(len(study.readings), 'reading')}.")
            if verification.faults:
                ui.label(FAULTY).classes("flag")
                kit.message_list(str(fault) for fault in verification.faults[:MOST_SHOWN])
            although = ui.checkbox("even if incomplete").props("dense")
            although.set_visibility(blind and bool(left))
            if blind:
                for device, lacking in left:
                    ui.label(
                        f"{device} has not read {lacking} of {count_of(len(study.plan.codes), 'target')}."
                    ).classes("flag")
            self._who = who = who_field(page.viewer, "Done by")

            async def begin() -> None:
                with kit.loading(button):
                    job = await page.viewer.attempt(
                        begin_publishing,
                        page.jobs,
                        page.repository,
                        page.name,
                        by=name_in(page.viewer, who),
                        although_incomplete=bool(although.value),
                    )
                if job is not None:
                    dialog.close()

            button = kit.dialog_buttons(dialog, "Unblind and analyse" if blind else "Analyse", begin)


MOST_FAULTS_SHOWN = 100  # faults; a study that has more has one cause
VERIFICATION_MEANING = (
    "Lines missing at the end of the log, or a rewritten log, are only detected with a log head that was saved "
    "elsewhere."
)


def verify_button(page: StudyContext, place: ui.element) -> None:
    """A button that verifies plan, seal, reports and log, and shows the result in ``place``."""

    async def begin(head: str = "") -> None:
        with kit.loading(button):
            result = await page.viewer.attempt(
                lambda: verify_study(page.repository.path(page.name), head=head.strip() or None)
            )
        if result is not None:
            place.clear()
            with place:
                show(result, head)

    def show(verification: StudyVerification, head: str) -> None:
        with ui.element("section").classes("outcome").props('role="status"'):
            kit.panel_title("Verification", level=3)
            ui.label(verdict(verification)).classes("good" if verification.sound else "flag")
            with kit.message_list():
                for fault in verification.faults[:MOST_FAULTS_SHOWN]:
                    kit.list_message(str(fault), "doubtful")
            if len(verification.faults) > MOST_FAULTS_SHOWN:
                ui.label(f"and {len(verification.faults) - MOST_FAULTS_SHOWN} more (tsis study verify shows all)")
            ui.label(f"Head of the log: {verification.head}").classes("muted identity")
            with ui.element("div").classes("row"):
                saved = kit.unit_field("Log head saved elsewhere", head, keys="text").classes("study-head")
                kit.button("Compare", lambda: begin(saved.value or ""), look="outline dense")
                kit.button("Close", place.clear, look="flat dense")
            kit.muted(VERIFICATION_MEANING)

    button = kit.button("Verify", lambda: begin(), icon="verified_user", look="outline dense")


def verdict(verification: StudyVerification) -> str:
    """Whether the study is unchanged."""
    if verification.sound:
        return f"The study is unchanged, all {count_of(verification.lines, 'line')} of its log."
    return f"The study was CHANGED: it differs in {count_of(len(verification.faults), 'place')}."


NONE_YET = "No readings yet. Run the virtual probe, or import the readings of another device."


def show_devices(page: StudyContext, view: StudyView) -> None:
    """Place the devices with their operators."""
    if not view.devices:
        kit.muted(NONE_YET)
    for device in view.study.devices:
        stored = [item for item in view.devices if item.device == device]
        with ui.element("div").classes("study-device"):
            with ui.element("div").classes("row"):
                ui.label(device).classes("strong wordy")
                kit.muted(f"threshold {stored[0].threshold:g}")
                ui.element("div").classes("spring")
                kit.button(
                    "Export readings",
                    lambda _, device=device: _export(page, device),
                    icon="download",
                    look="outline dense",
                    label=f"Export readings of {device}",
                )
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
                self._end = kit.button("Cancel", self._ended, look="outline dense")
            self._bar = kit.ProgressBar("Progress of the study")
        self._container.set_visibility(False)

    def refresh(self) -> bool:
        """Show how far it is, and return whether it is under way."""
        state = job_of(self._page.jobs, self._page.name)
        self._container.set_visibility(state is not None)
        if state is None:
            return False
        self._message.text = state.sentence or "Waiting for other jobs."
        self._end.set_visibility(state.running)
        self._bar.show(state)
        return state.running

    def _ended(self) -> None:
        state = job_of(self._page.jobs, self._page.name)
        if state is not None and state.running:
            self._page.jobs.get(state.identity).end()


READING_MEANS = (
    "The virtual probe of this study reads the remaining targets by their codes. No camera is needed. Cancel at any "
    "time: readings are saved, and the next run continues from there. Each operator reads every target."
)


class Running:
    """Operator and button."""

    def __init__(self, page: StudyContext) -> None:
        self._page = page
        self._named = False
        kit.panel_title("Virtual probe")
        kit.muted(READING_MEANS)
        with ui.element("div").classes("row"):
            self._who = who_field(page.viewer, "Operator")
            self._begin = kit.button("Run on the virtual probe", self._run, icon="play_arrow", look="unelevated")

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
        with kit.loading(self._begin):
            begin = partial(begin_reading, page.jobs, page.repository, page.name)
            operator = name_in(page.viewer, self._who)
            await kit.submit(page.viewer, {"operator": self._who}, partial(begin, operator=operator))


EXPLAINED = (
    "A CSV file with the columns {columns}. A higher score means that an inclusion is more likely; an empty score "
    "means undecided. The last three columns may be empty. A file is imported completely or not at all."
)
TOO_LARGE = f"readings must be one CSV file of at most {kit.LARGEST_MIB} MiB here; larger ones: tsis study import"
CUT = "The upload is incomplete: try again."


def import_button(page: StudyContext) -> ui.button:
    """A button that asks for device, threshold and file, and enters its readings."""
    viewer = page.viewer
    with kit.titled_dialog("Import readings", style="dialog-card study-dialog") as dialog:
        kit.muted(EXPLAINED.format(columns=", ".join(READING_COLUMNS)))
        device = kit.unit_field("Device", keys="text")
        threshold = kit.unit_field("Threshold")
        threshold.props("stack-label").props["placeholder"] = "the study's, or that of the first import"
        who = who_field(viewer, "Entered by")
        upload = kit.one_file(viewer, "CSV file of readings", accept=".csv,text/csv", refused=TOO_LARGE)
        kit.button("Close", dialog.close, look="flat dense")

    async def uploaded(event: UploadEventArguments) -> None:
        upload.reset()
        try:
            content = await event.file.read()
        except OSError:
            viewer.complain(CUT)
            return
        named = one_line(PurePosixPath(event.file.name.replace("\\", "/")).name or "readings.csv")
        fields = {"device": device, "threshold": threshold, "actor": who}
        texts = (device.value or "").strip(), threshold.value or "", name_in(viewer, who)
        entered = await kit.submit(viewer, fields, _enter, page, content, named, *texts)
        if entered is not None:
            viewer.notify(f"{entered} readings entered.")
            dialog.close()

    upload.on_upload(uploaded)
    return kit.button("Import readings", dialog.open, icon="upload_file", look="outline dense")


def _enter(page: StudyContext, content: bytes, file: str, device: str, threshold: str, actor: str) -> int:
    study = page.repository.study(page.name)
    limit = kit.typed_number("threshold", threshold) if threshold.strip() else None
    after = import_table(study, content, file, device=device, threshold=limit, actor=actor)
    return len(after.readings) - len(study.readings)
