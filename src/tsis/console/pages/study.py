"""Studies: blinded, from the targets to the report."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING

import numpy as np
from nicegui import run, ui

from tsis.__about__ import LARGEST_SEED
from tsis.catalog.probes import list_probes
from tsis.console import widgets
from tsis.console.messages import field_messages, plain_message
from tsis.console.studies import (
    StudyRepository,
    begin_publishing,
    begin_reading,
    has_report,
    job_of,
    unblinded_text,
)
from tsis.console.viewer import LONGEST_OPERATOR, Viewer
from tsis.errors import InputError, TsisError
from tsis.files.reading import one_line
from tsis.model.require import require_number
from tsis.present.labels import counted
from tsis.present.page import address
from tsis.present.study import study_page, targets_table
from tsis.study.analysis import analyse
from tsis.study.folder import MOST_TARGETS, open_study, printed_targets, random_targets, verify_study
from tsis.study.plan import TARGETS
from tsis.study.readings import READING_COLUMNS, export_readings, import_table, threshold_note

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from nicegui.events import GenericEventArguments, UploadEventArguments

    from tsis.console.services.instrument import Instrument
    from tsis.console.studies import StudySummary
    from tsis.present.page import Page, Table
    from tsis.study.folder import Study, StudyVerification
    from tsis.study.plan import TargetTruth


MOST_RESULTS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceProgress:
    """Progress of a device: an operator's readings, and all expected ones."""

    device: str
    operator: str
    read: int
    expected: int
    undecided: int
    threshold: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyResult:
    """Results of an unblinded study: report, drawn curves, every target with its truth."""

    page: Page
    curves: str
    targets: Table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyView:
    """A study at one moment."""

    study: Study
    devices: tuple[DeviceProgress, ...]
    reported: bool
    most_read: Mapping[tuple[str, str], int]  # most readings of a (code, device) by one operator


def view_study(repository: StudyRepository, name: str) -> StudyView:
    """Read a study; errors as `StudyRepository.study`."""
    study = repository.study(name)
    devices = [
        DeviceProgress(
            device=device,
            operator=operator,
            read=count,
            expected=len(study.plan.codes) * study.plan.repeats,
            undecided=undecided,
            threshold=study.threshold_of(device),
        )
        for device, operator, count, undecided in study.tally
    ]
    most: Counter[tuple[str, str]] = Counter()
    for (code, device, _), count in Counter(
        (reading.code, reading.device, reading.operator) for reading in study.readings
    ).items():
        most[code, device] = max(most[code, device], count)
    return StudyView(study=study, devices=tuple(devices), reported=has_report(study), most_read=most)


def study_result(study: Study) -> StudyResult:
    """Results of an unblinded study, cached until the log grows."""
    return _result(study.folder.resolve(), study.chain.head)


@lru_cache(MOST_RESULTS)
def _result(folder: Path, head: str) -> StudyResult:  # another head, another log
    analysis = analyse(open_study(folder))
    page, drawn = study_page(analysis), any(device.curve is not None for device in analysis.devices)
    curves = address(page.pictures[0]) if drawn else ""
    return StudyResult(page=page, curves=curves, targets=targets_table(analysis))


def who_field(viewer: Viewer, label: str) -> ui.input:
    """Place a field for a person's name: the operator's, where it is known."""
    field = widgets.unit_field(label, keys="text").bind_value_from(viewer, "operator")
    field.props["readonly"], field.props["maxlength"] = viewer.logged_in, LONGEST_OPERATOR
    return field


def name_in(viewer: Viewer, field: ui.input) -> str:
    """The name to enter; a browser may send what it likes, so a login's is taken from the login.

    A typed name is kept as the operator's.
    """
    name = viewer.operator if viewer.logged_in else (field.value or "").strip()
    if name:
        viewer.remember_operator(name)
    return name


class Outcome:
    """A panel that is there once the study is unblinded."""

    def __init__(self, page: StudyPage) -> None:
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
        with widgets.title_row("Results of the study"):
            if view.reported:
                url = f"/files/study/{self._page.name}/report"
                ui.link("Report", f"{url}.html", new_tab=True).classes("link button")
                ui.link("PDF", f"{url}.pdf").classes("link button").props("download")
            else:
                widgets.muted("No report yet: Analyse again creates it.")

    def _body(self, result: StudyResult) -> None:
        widgets.cards(result.page.cards)
        with ui.element("div").classes("study-outcome"):
            if result.curves:
                widgets.figure(result.page.pictures[0], result.curves)
            with ui.element("div"):
                widgets.panel_title("Notes", level=3)
                with ui.element("div").classes("wordy"):
                    widgets.message_list(result.page.notes)


MOST_SHOWN = 5  # faults
UNBLINDING_MEANS = (
    "This opens the seal: the codes are shown with their true targets, and no more readings are accepted. The study's "
    "log records who did it and when; this cannot be undone. Then the readings are analysed and the report is "
    "written."
)
FAULTY = "The study's files were changed; the log records that as well:"


class Unblinding:
    """The button, and its dialog."""

    def __init__(self, page: StudyPage) -> None:
        self._page, self._blind = page, True
        self._dialog: ui.dialog | None = None
        self._who: ui.input | None = None
        self._container = ui.element("div")
        self._button = widgets.button("Unblind and analyse", self._clicked, icon="visibility", look="outline dense")

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
        with widgets.loading(self._button):
            result = await page.viewer.attempt(
                lambda: (page.repository.study(page.name), verify_study(page.repository.path(page.name)))
            )
        if result is not None:
            self._confirm(*result)

    def _confirm(self, study: Study, verification: StudyVerification) -> None:
        page, left = self._page, study.unread
        blind = study.unblinded is None
        title = ("Unblind study {name}" if blind else "Analyse study {name}").format(name=study.plan.name)
        with widgets.open_dialog(self._container, title, style="dialog-card study-dialog") as dialog:
            self._dialog = dialog
            if blind:
                ui.label(f"{UNBLINDING_MEANS} The study has {counted(len(study.readings), 'reading')}.")
            if verification.faults:
                ui.label(FAULTY).classes("flag")
                widgets.message_list(str(fault) for fault in verification.faults[:MOST_SHOWN])
            although = ui.checkbox("even if incomplete").props("dense")
            although.set_visibility(blind and bool(left))
            if blind:
                for device, lacking in left:
                    ui.label(f"{device} has not read {lacking} of {counted(len(study.plan.codes), 'target')}.").classes(
                        "flag"
                    )
            self._who = who = who_field(page.viewer, "Done by")

            async def begin() -> None:
                with widgets.loading(button):
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

            button = widgets.dialog_buttons(dialog, "Unblind and analyse" if blind else "Analyse", begin)


MOST_FAULTS_SHOWN = 100  # faults; a study that has more has one cause
VERIFICATION_MEANING = (
    "Lines missing at the end of the log, or a rewritten log, are only detected with a log head that was saved "
    "elsewhere."
)


def verify_button(page: StudyPage, place: ui.element) -> None:
    """A button that verifies plan, seal, reports and log, and shows the result in ``place``."""

    async def begin(head: str = "") -> None:
        with widgets.loading(button):
            result = await page.viewer.attempt(
                lambda: verify_study(page.repository.path(page.name), head=head.strip() or None)
            )
        if result is not None:
            place.clear()
            with place:
                show(result, head)

    def show(verification: StudyVerification, head: str) -> None:
        with ui.element("section").classes("outcome").props('role="status"'):
            widgets.panel_title("Verification", level=3)
            ui.label(verdict(verification)).classes("good" if verification.sound else "flag")
            with widgets.message_list():
                for fault in verification.faults[:MOST_FAULTS_SHOWN]:
                    widgets.list_message(str(fault), "doubtful")
            if len(verification.faults) > MOST_FAULTS_SHOWN:
                ui.label(f"and {len(verification.faults) - MOST_FAULTS_SHOWN} more")
            ui.label(f"Head of the log: {verification.head}").classes("muted identity")
            with ui.element("div").classes("row"):
                saved_head = widgets.unit_field("Log head saved elsewhere", head, keys="text").classes("study-head")
                widgets.button("Compare", lambda: begin(saved_head.value or ""), look="outline dense")
                widgets.button("Close", place.clear, look="flat dense")
            widgets.muted(VERIFICATION_MEANING)

    button = widgets.button("Verify", lambda: begin(), icon="verified_user", look="outline dense")


def verdict(verification: StudyVerification) -> str:
    """Whether the study is unchanged."""
    if verification.sound:
        return f"The study is unchanged, all {counted(verification.lines, 'line')} of its log."
    return f"The study was CHANGED: it differs in {counted(len(verification.faults), 'place')}."


NO_READINGS = "No readings yet. Run the virtual probe, or import the readings of another device."


def show_devices(page: StudyPage, view: StudyView) -> None:
    """Place the devices with their operators."""
    if not view.devices:
        widgets.muted(NO_READINGS)
    for device in view.study.devices:
        stored = [item for item in view.devices if item.device == device]
        with ui.element("div").classes("study-device"):
            with ui.element("div").classes("row"):
                ui.label(device).classes("strong wordy")
                widgets.muted(f"threshold {stored[0].threshold:g}")
                ui.element("div").classes("spring")
                widgets.button(
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


async def _export(page: StudyPage, device: str) -> None:
    content = await page.viewer.attempt(lambda: export_readings(page.repository.study(page.name), device))
    if content is not None:
        text = re.sub(r"[^A-Za-z0-9]+", "-", device).strip("-") or "device"
        ui.download.content(content, f"{page.name}-{text[:60]}.csv", "text/csv")


READING_MEANS = (
    "The virtual probe of this study reads the remaining targets by their codes. No camera is needed. Cancel at any "
    "time: readings are saved, and the next run continues from there. Each operator reads every target."
)


class Running:
    """Operator and button."""

    def __init__(self, page: StudyPage) -> None:
        self._page = page
        self._named = False
        widgets.panel_title("Virtual probe")
        widgets.muted(READING_MEANS)
        with ui.element("div").classes("row"):
            self._who = who_field(page.viewer, "Operator")
            self._begin = widgets.button("Run on the virtual probe", self._run, icon="play_arrow", look="unelevated")

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
        with widgets.loading(self._begin):
            begin = partial(begin_reading, page.jobs, page.repository, page.name)
            operator = name_in(page.viewer, self._who)
            await widgets.submit(page.viewer, {"operator": self._who}, partial(begin, operator=operator))


EXPLAINED = (
    "A CSV file with the columns {columns}. A higher score means that an inclusion is more likely; an empty score "
    "means undecided. The last three columns may be empty. A file is imported completely or not at all."
)
TOO_LARGE = f"readings must be one CSV file of at most {widgets.LARGEST_MIB} MiB here"
CUT = "The upload is incomplete: try again."


def import_button(page: StudyPage) -> ui.button:
    """A button that asks for device, threshold and file, and enters its readings."""
    viewer = page.viewer
    with widgets.titled_dialog("Import readings", style="dialog-card study-dialog") as dialog:
        widgets.muted(EXPLAINED.format(columns=", ".join(READING_COLUMNS)))
        device = widgets.unit_field("Device", keys="text")
        threshold = widgets.unit_field("Threshold")
        threshold.props("stack-label").props["placeholder"] = "the study's, or that of the first import"
        who = who_field(viewer, "Entered by")
        upload = widgets.one_file(viewer, "CSV file of readings", accept=".csv,text/csv", refused=TOO_LARGE)
        widgets.button("Close", dialog.close, look="flat dense")

    async def uploaded(event: UploadEventArguments) -> None:
        upload.reset()
        try:
            content = await event.file.read()
        except OSError:
            viewer.complain(CUT)
            return
        named = one_line(widgets.uploaded_name(event))
        fields = {"device": device, "threshold": threshold, "actor": who}
        texts = (device.value or "").strip(), threshold.value or "", name_in(viewer, who)
        entered = await widgets.submit(viewer, fields, _enter, page, content, named, *texts)
        if entered is not None:
            viewer.notify(entered)
            dialog.close()

    upload.on_upload(uploaded)
    return widgets.button("Import readings", dialog.open, icon="upload_file", look="outline dense")


def _enter(page: StudyPage, content: bytes, file: str, device: str, threshold: str, actor: str) -> str:
    study = page.repository.study(page.name)
    limit = widgets.typed_number("threshold", threshold) if threshold.strip() else None
    after = import_table(study, content, file, device=device, threshold=limit, actor=actor)
    said = f"{len(after.readings) - len(study.readings)} readings entered."
    return f"{said} {note}" if (note := threshold_note(after, device)) else said


SHEETS = (20, 50, 200)


class CodeTable:
    """The table of targets; a browser gets one sheet of it, so that a large study costs no more than a small one."""

    def __init__(self) -> None:
        self._view: StudyView | None = None
        self._result: StudyResult | None = None
        self._sheet, self._size, self._total = 1, SHEETS[0], 0
        widgets.panel_title("Targets")
        with ui.element("div").classes("study-codes").props('tabindex=0 role=region aria-label="Targets"'):
            self._table = ui.table(rows=[], columns=[], row_key="number", pagination=self._pages())
        self._table.on("request", self._requested)
        widgets.sheets_of_targets(self._table, SHEETS, self._pages)

    def show(self, view: StudyView, result: StudyResult | None) -> None:
        """Show codes with their readings, or with the truth of an unblinded study."""
        self._view, self._result = view, result
        self._draw()

    def _requested(self, event: GenericEventArguments) -> None:
        sent = event.args.get("pagination") if isinstance(event.args, dict) else None
        if isinstance(sent, dict):
            page, size = sent.get("page"), sent.get("rowsPerPage")
            self._sheet = page if isinstance(page, int) and page > 0 else 1
            self._size = next((sheet for sheet in SHEETS if sheet == size), SHEETS[0])
        self._draw()

    def _draw(self) -> None:
        if self._view is None:
            return
        self._total = len(self._view.study.plan.codes)
        self._sheet = min(self._sheet, max(1, -(-self._total // self._size)))
        begin = (self._sheet - 1) * self._size
        part = slice(begin, begin + self._size)
        if self._result is None:
            headings, rows = _progress(self._view, part)
        else:
            headings, rows = self._result.targets.headings, list(self._result.targets.rows[part])
        self._table.columns = [
            {"name": f"c{at}", "label": text, "field": f"c{at}", "align": "left"}
            for at, text in enumerate(("order", *headings))
        ]
        self._table.rows = [
            {"number": number, **{f"c{at}": text for at, text in enumerate((str(number), *row))}}
            for number, row in enumerate(rows, start=begin + 1)
        ]
        self._table.pagination = self._pages()
        self._table.update()

    def _pages(self) -> dict[str, int]:
        return {"page": self._sheet, "rowsPerPage": self._size, "rowsNumber": self._total}


def _progress(view: StudyView, part: slice) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Codes of a sheet, and for each device whether it has read them; the virtual probe's first."""
    plan, devices = view.study.plan, tuple(dict.fromkeys((view.study.plan.device, *view.study.devices)))
    rows = [
        (code, *(_state(view.most_read.get((code, device), 0), plan.repeats) for device in devices))
        for code in plan.codes[part]
    ]
    return ("code", *devices), rows


def _state(read: int, repeats: int) -> str:
    if read >= repeats:
        return "read"
    return f"read {read} of {repeats}" if read else "left"


USUAL_FORCES = (0.5, 1.0)  # at most; a flat probe has one
KINDS = ("present", "blank")
LARGE = 1000  # readings, beyond which the size is confirmed first
SECONDS_PER_READING = 0.55  # of one core, with four presses; measured on the domed probe


@dataclass(frozen=True, slots=True, kw_only=True)
class StudySize:
    """What one operator has to read.

    Examples
    --------
    >>> StudySize(readings=100_000, presses=400_000).text()
    'It has 100,000 readings, 400,000 presses: about 15 hours of computing on the virtual probe.'
    """

    readings: int
    presses: int

    def text(self) -> str:
        """Its size and what it costs."""
        seconds = SECONDS_PER_READING * self.presses / 4
        unit, length = next(item for item in DURATIONS if seconds >= 2 * item[1] or item[1] == 1.0)
        return (
            f"It has {self.readings:,} readings, {self.presses:,} presses: about {seconds / length:.0f} {unit} of "
            "computing on the virtual probe."
        )


DURATIONS = (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0), ("s", 1.0))
LIKE = {"printed": "like the printed study", "random": "random"}
LABELS = {"present": "targets with an inclusion", "blank": "blanks", "forces_n": "forces"}
MOST_FORCES = 16
MOST_REPEATS = 1000


@dataclass(slots=True)
class StudyDraft:
    """Contents of the fields of a new study."""

    name: str = ""
    like: str = "printed"
    present: str = "8"
    blank: str = "8"
    forces: str = ""
    probe: str = "tsis-domed"
    with_reference: bool = True
    repeats: str = "1"
    threshold: str = "0.5"
    seed: str = ""

    def make(self, repository: StudyRepository, *, actor: str, progress: Callable[[int, int], None]) -> str:
        """Create the study, and return its name; `InputError` for an invalid field."""
        name = self.name.strip()
        with field_messages(LABELS):
            repository.make(
                name,
                self._targets(),
                seed=widgets.typed_integer("seed", self.seed, 0, LARGEST_SEED) if self.seed.strip() else None,
                probe=self.probe,
                forces_n=widgets.typed_forces(self.forces, most=MOST_FORCES) or None,
                with_reference=self.with_reference,
                repeats=widgets.typed_integer("repeats", self.repeats, 1, MOST_REPEATS),
                threshold=self._threshold(),
                actor=actor,
                progress=progress,
            )
        return name

    def _threshold(self) -> float:
        return require_number("threshold", widgets.typed_number("threshold", self.threshold), 0.0, 1.0)

    def size(self) -> StudySize:
        """Readings and presses of the virtual probe; `InputError` for an invalid field."""
        with field_messages(LABELS):
            present, blank = self._counts()
            repeats = widgets.typed_integer("repeats", self.repeats, 1, MOST_REPEATS)
            forces = widgets.typed_forces(self.forces, most=MOST_FORCES) or USUAL_FORCES
            readings = (present + blank) * repeats
            return StudySize(readings=readings, presses=readings * len(forces) * (1 + self.with_reference))

    def _counts(self) -> tuple[int, int]:
        """Targets with and without an inclusion."""
        present, blank = (widgets.typed_integer(LABELS[name], getattr(self, name), 0, MOST_TARGETS) for name in KINDS)
        return present, blank

    def _targets(self) -> Sequence[TargetTruth] | Callable[[int], Sequence[TargetTruth]]:
        present, blank = self._counts()
        if self.like == "random":
            return lambda seed: random_targets(present, blank, rng=np.random.default_rng([seed, TARGETS]))
        return printed_targets(present, blank)


EVERY_S, PROGRESS_EVERY_S = 1.0, 0.5
HEADINGS = ("Study", "Targets", "Readings", "State")
NONE_YET = "No study yet. Create one here: its targets get codes in random order, and the truth is sealed."
MEANT = (
    "The seed determines the codes and their order; whoever knows it can compute the truth. Leave it empty for a "
    "random seed, which is sealed with the truth. Targets, probe, forces and threshold are fixed once the study is "
    "created."
)


def study_listing(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    repository = StudyRepository(instrument.terms.workspace)
    with ui.element("div").classes("split empty-first") as columns:
        with widgets.panel("Studies"):
            studies = widgets.scrolling("Studies")
        with ui.element("section").classes("panel stack"):
            _NewStudy(repository, viewer)
    shown: object = None

    async def refresh() -> None:
        nonlocal shown
        stamps = await viewer.attempt(repository.stamps)
        if stamps is None or stamps == shown:
            return
        shown = stamps
        summaries = await viewer.attempt(repository.summaries)
        if summaries is not None:
            widgets.set_class(columns, "empty-first", not summaries)
            studies.clear()
            with studies:
                _show(summaries)

    viewer.every(EVERY_S, refresh)


def _show(summaries: tuple[StudySummary, ...]) -> None:
    if not summaries:
        widgets.muted(NONE_YET)
        return
    with widgets.rows_under(HEADINGS, label="Studies"):
        for item in summaries:
            if item.trouble:
                with ui.element("tr"):
                    widgets.cell(item.name)
                    with ui.element("td").props("colspan=3"):
                        ui.label(item.trouble).classes("flag wordy")
                continue
            with ui.element("tr"):
                with ui.element("td"):
                    ui.link(item.name, f"/study/{item.name}").classes("link")
                widgets.cell(str(item.targets))
                widgets.cell(str(item.readings))
                widgets.cell(f"unblinded {item.unblinded}" if item.unblinded else "blinded").classes("wordy")


class _NewStudy:
    """The form of a new study."""

    def __init__(self, repository: StudyRepository, viewer: Viewer) -> None:
        self._repository, self._viewer = repository, viewer
        start = StudyDraft()
        widgets.panel_title("New study")
        with ui.element("div").classes("study-fields"):
            name = widgets.unit_field("Name", keys="text").props("maxlength=200")
            self._who = who_field(viewer, "Made by")
            present = widgets.unit_field("With an inclusion", start.present, keys="numeric")
            blank = widgets.unit_field("Blanks", start.blank, keys="numeric")
            self._like = widgets.select_field(LIKE, value=start.like, label="Targets")
            self._like.props("options-dense").classes("study-wide")
            self._probe = widgets.select_field(list(list_probes()), value=start.probe, label="Probe")
            self._probe.props("options-dense")
            forces = widgets.unit_field("Forces", start.forces, unit="N", keys="text")
            forces.props("stack-label").props["placeholder"] = "usual of the probe"
            repeats = widgets.unit_field("Repeats", start.repeats, keys="numeric")
            threshold = widgets.unit_field("Threshold", start.threshold)
            seed = widgets.unit_field("Seed", start.seed, keys="numeric")
            seed.props("stack-label").props["placeholder"] = "drawn and sealed"
        self._texts = {
            "name": name,
            "present": present,
            "blank": blank,
            "forces": forces,
            "repeats": repeats,
            "threshold": threshold,
            "seed": seed,
        }
        named = {
            "targets with an inclusion": present,
            "blanks": blank,
            "force": forces,
            "operator": self._who,
            "actor": self._who,
        }
        self._fields = {**named, **self._texts}
        for field in (present, blank, forces, repeats):
            field.on_value_change(self._count)
        threshold.props["hint"] = "probability, 0 to 1"
        self._reference = ui.checkbox("Reference presses on tissue nearby", value=start.with_reference)
        self._reference.on_value_change(self._count)
        widgets.muted(MEANT)
        self._size = widgets.muted()
        with ui.element("div").classes("row"):
            self._button = widgets.button("Create the study", self._make, icon="add", look="unelevated")
            self._bar = ui.linear_progress(0.0, show_value=False, size="6px").props(
                'aria-label="Progress of the study"'
            )
        self._sealed = 0.0  # fraction of the targets
        self._dialogs = ui.element("div")
        self._count()
        viewer.every(PROGRESS_EVERY_S, self._show_progress)

    def _draft(self) -> StudyDraft:
        return StudyDraft(
            like=str(self._like.value),
            probe=str(self._probe.value),
            with_reference=bool(self._reference.value),
            **{name: field.value or "" for name, field in self._texts.items()},
        )

    def _count(self) -> None:
        """Show what the study costs, while its numbers are typed."""
        try:
            self._size.text = self._draft().size().text()
        except InputError as error:
            self._size.text = plain_message(error)

    async def _make(self) -> None:
        draft = self._draft()
        size = await widgets.submit(self._viewer, self._fields, draft.size)
        if size is None:
            return
        if size.readings <= LARGE:
            await self._made(draft)
            return
        with widgets.open_dialog(self._dialogs, "A large study") as dialog:
            ui.label(f"{size.text()} The targets are fixed once the study is created.")

            async def confirmed() -> None:
                dialog.close()
                await self._made(draft)

            widgets.dialog_buttons(dialog, f"Make {size.readings:,} readings", confirmed)

    async def _made(self, draft: StudyDraft) -> None:
        def sealed(done: int, total: int) -> None:
            self._sealed = done / total

        with widgets.loading(self._button):
            who = name_in(self._viewer, self._who)
            make = partial(draft.make, self._repository, actor=who, progress=sealed)
            created = await widgets.submit(self._viewer, self._fields, make)
        self._sealed = 0.0
        if created is not None:
            ui.navigate.to(f"/study/{created}")

    async def _show_progress(self) -> None:
        self._bar.set_visibility(self._sealed > 0.0)
        self._bar.value = self._sealed


STUDY_EVERY_S = 0.5


def show_study(instrument: Instrument, viewer: Viewer, name: str) -> None:
    """Build the page of the study whose name stands in the address."""
    viewer.every(STUDY_EVERY_S, StudyPage(instrument, viewer, name).refresh)


class StudyPage:
    """The open page of the study whose name stands in the address."""

    def __init__(self, instrument: Instrument, viewer: Viewer, name: str) -> None:
        self.jobs, self.viewer, self.name = instrument.jobs, viewer, name
        self.repository = StudyRepository(instrument.terms.workspace)
        self._shown: tuple[int, int] | None = None
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel stack"):
                with ui.element("div").classes("row"):
                    ui.link("All studies", "/study").classes("link")
                    self._title = widgets.panel_title("Study").classes("target-title")
                    ui.element("div").classes("spring")
                    self._commands = ui.element("div").classes("row")
                self._job = widgets.JobLine("Progress of the study", self._end_job)
                self._refusal = ui.label().classes("flag wordy").props('role="alert"')
                self._below = ui.element("div")
            self._outcome = Outcome(self)
            with ui.element("div").classes("split") as self._parts:
                with ui.element("section").classes("panel stack"):
                    self._codes = CodeTable()
                with ui.element("div").classes("stack"):
                    with ui.element("section").classes("panel stack") as self._run:
                        self._running = Running(self)
                    with widgets.panel("Devices"):
                        self._devices = ui.element("div").classes("stack tight")
                    with widgets.panel("Plan"):
                        self._plan = widgets.FactList()
        with self._commands:
            self._import = import_button(self)
            verify_button(self, self._below)
            self._unblinding = Unblinding(self)
        for part in (self._parts, self._commands, self._refusal):
            part.set_visibility(False)

    async def refresh(self) -> None:
        """Show how far the job is, and the study anew when its log has changed."""
        job = job_of(self.jobs, self.name)
        running = self._job.show(job, "" if job is None else job.sentence or "Waiting for other jobs.")
        self._running.allow(not running)
        stamp = self.repository.stamp(self.name) if self.name.isascii() else (0, 0)
        if stamp != self._shown:
            self._shown = stamp
            await self._load()

    def _end_job(self) -> None:
        job = job_of(self.jobs, self.name)
        if job is not None and job.running:
            self.jobs.get(job.identity).end()

    async def _load(self) -> None:
        view, refusal = None, ""
        try:
            view = await run.io_bound(view_study, self.repository, self.name)
        except TsisError as error:
            refusal = str(error)
        self._refusal.text = refusal
        self._refusal.set_visibility(bool(refusal))
        for part in (self._parts, self._commands):
            part.set_visibility(view is not None)
        if view is not None:  # None while the console closes
            await self._show(view)

    async def _show(self, view: StudyView) -> None:
        study, blind = view.study, view.study.unblinded is None
        self._title.text = f"Study {study.plan.name}"
        self._run.set_visibility(blind)
        self._import.set_visibility(blind)
        self._running.show(view)
        await self._unblinding.show(view)
        self._plan.show(_facts(view))
        self._devices.clear()
        with self._devices:
            show_devices(self, view)
        reported = await self._outcome.show(view)
        self._codes.show(view, reported)


def _facts(view: StudyView) -> tuple[tuple[str, str], ...]:
    plan, head = view.study.plan, view.study.chain.head
    forces = ", ".join(f"{force:g}" for force in plan.forces_n)
    return (
        ("State", f"unblinded {unblinded_text(view.study)}" if view.study.unblinded else "blinded"),
        ("Targets", str(len(plan.codes))),
        ("Repeats", str(plan.repeats)),
        ("Threshold", f"{plan.threshold:g}, fixed beforehand"),
        ("Virtual probe", f"{plan.probe}, {forces} N{', reference presses' if plan.with_reference else ''}"),
        ("Seed", "in the seal" if plan.seed is None else str(plan.seed)),
        ("Made", f"{plan.made:%Y-%m-%d %H:%M} UTC"),
        ("Sealed truth", f"SHA-256 {plan.commitment[:16]}"),
        ("Head of the log", head[:16]),
    )
