"""The page Design: a probe, a question about it, and the analysis as a job."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from nicegui import background_tasks, ui

from tsis.catalog.probes import probe_toml
from tsis.console.pages import components as kit
from tsis.console.pages.design._draft import ProbeEditor
from tsis.console.pages.design._forms import ProbeForm, QuestionForm
from tsis.console.services import DONE, JobCancelled
from tsis.errors import InputError
from tsis.files.canonical_json import json_bytes
from tsis.present.design import analyse_designs, compared_designs, design_document, design_page, searched_design
from tsis.present.figures import probe_section
from tsis.present.page import Picture, address

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from tsis.console.services import Instrument, Job
    from tsis.model.probe import Probe
    from tsis.present.design import DesignAnalysis, DesignQuestion
    from tsis.present.page import Page


EMPTY = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 24 12'/%3E"
WIDE_IN, LABELS_IN = 6.0, 0.65  # of the picture; of the labels beside and below its axes
LEAST_IN, MOST_IN = 1.8, 4.5  # of its height


class Section:
    """The probe from the side; with a wrong field its message and the last valid probe."""

    def __init__(self, editor: ProbeEditor, viewer: kit.Viewer) -> None:
        self._editor, self._viewer = editor, viewer
        self._requested = 0
        kit.panel_title("Side view")
        with ui.element("div").classes("section"):
            self._picture = kit.drawing()
            kit.show_drawing(self._picture, EMPTY, "the probe, not yet drawn")
        self._fault = ui.label().classes("doubtful").props('role="status"')

    async def draw(self) -> None:
        """Draw the probe as it is now."""
        self._requested += 1
        turn = self._requested
        try:
            probe = self._editor.probe.probe()
        except InputError as error:
            beside = any(self._editor.probe.field_faults())  # which has its own message
            self._fault.text = (
                "Not drawn while a field is invalid." if beside else f"Not drawn: {kit.plain_message(error)}"
            )
            return
        self._fault.text = ""
        source = await self._viewer.attempt(address, picture_of(probe))
        gone = self._picture.is_deleted or turn != self._requested  # what was typed meanwhile is drawn by who typed it
        if source is not None and not gone:
            kit.show_drawing(self._picture, source, described(probe))


def picture_of(probe: Probe) -> Picture:
    """The probe's section as a picture."""
    span, up = 2 * probe.radius_mm + 4.8, probe.thickness_mm + probe.glass.thickness_mm + 2  # as they are drawn
    height = min(max((WIDE_IN - LABELS_IN) * up / span + LABELS_IN, LEAST_IN), MOST_IN)
    return Picture(title="", draw=partial(_draw, probe), size=(WIDE_IN, height), alt=described(probe))


def described(probe: Probe) -> str:
    """The probe as text."""
    layers = ", ".join(f"{layer.thickness_mm:g} mm of {layer.young_kpa:g} kPa" for layer in probe.layers)
    face = "flat" if probe.face_curvature_mm is None else f"domed by {probe.face_curvature_mm:g} mm"
    return (
        f"Section of the probe: face of {2 * probe.radius_mm:g} mm, {face}; from the tissue up {layers}, glass; "
        f"{len(probe.leds)} lamps"
    )


def _draw(probe: Probe, figure: Figure) -> None:
    probe_section(probe, figure.subplots())


EVERY_S = 0.4  # between two readings of the job
Draft = TypeVar("Draft")
SCROLL = 'getHtmlElement({}).scrollIntoView({{behavior: "smooth", block: "start"}})'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignResult:
    """An analysis, and its page with drawn pictures."""

    analysis: DesignAnalysis
    page: Page
    pictures: tuple[str, ...]


def analysis_of(question: DesignQuestion) -> Callable[[Job], DesignResult]:
    """The work of a job that answers a question; a cancelled search leaves the comparisons before it."""

    def work(job: Job) -> DesignResult:
        result = compared_designs(question, progress=job.advance)
        job.report(0, question.evaluations or 0)
        try:
            optimum = searched_design(question, progress=job.advance)
        except JobCancelled:
            optimum = None
            job.say("The search was cancelled; these designs were compared before it.")
        analysis = analyse_designs(question, result, optimum)
        page = design_page(analysis)
        return DesignResult(analysis=analysis, page=page, pictures=kit.drawings(page))

    return work


class DesignResultPanel:
    """Button, progress and result."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, editor: ProbeEditor) -> None:
        self._instrument, self._viewer, self._editor = instrument, viewer, editor
        self._shown: Job | None = None
        self._begun_here = False
        with ui.element("div").classes("row below"):
            self._start = kit.button("Predict performance", self._started, look="unelevated")
            self._end = kit.button("Cancel", self._ended)
            ui.element("div").classes("spring")
            kit.button("Save the probe", self._save_probe, look="flat dense")
        self._bar = kit.ProgressBar("Progress of the designs")
        self._message = ui.label().props('role="status"')

    def result_container(self) -> None:
        """Place the result here."""
        self._result = ui.element("section").classes("panel stack design-answer").props('aria-label="Answer"')
        self._result.set_visibility(False)
        ui.timer(EVERY_S, self._refresh)

    def _started(self) -> None:
        if self._running():
            return
        if (question := self._valid(lambda: self._editor.question.question(self._editor.probe.probe()))) is None:
            return
        self._editor.job = self._instrument.jobs.begin(
            f"performance of {question.planned.described}", analysis_of(question)
        )
        self._refresh()

    def _ended(self) -> None:
        if self._editor.job is not None:
            self._editor.job.end()

    def _running(self) -> bool:
        return self._editor.job is not None and self._editor.job.state().running

    def _refresh(self) -> None:
        job = self._editor.job
        state = None if job is None else job.state()
        running = state is not None and state.running
        self._start.set_enabled(not running)
        self._end.set_visibility(running)
        self._bar.show(state)
        if job is None or state is None:
            return
        if running:
            self._begun_here = True
            self._message.text = (
                f"{state.done} of {state.total} solved"
                if state.done
                else "The first press of a new probe takes a while."
            )
        elif job is not self._shown:
            self._shown = job
            self._message.text = state.sentence
            if state.status == DONE:
                self._show(job.result)
                if self._begun_here:
                    self._result.client.run_javascript(SCROLL.format(self._result.id))

    def _show(self, result: DesignResult) -> None:
        self._result.clear()
        self._result.set_visibility(True)
        with self._result:
            with kit.title_row(f"{result.page.title}: {result.page.subtitle}"):
                kit.button("Save the result", lambda: self._save(result.analysis), look="flat dense")
            kit.report_parts(result.page, result.pictures)

    def _save(self, analysis: DesignAnalysis) -> None:
        ui.download.content(json_bytes(design_document(analysis)), "design.json", "application/json")

    def _save_probe(self) -> None:
        if (probe := self._valid(self._editor.probe.probe)) is not None:
            ui.download.content(probe_toml(probe).encode(), f"{file_name(probe.name)}.toml", "application/toml")

    def _valid(self, read: Callable[[], Draft]) -> Draft | None:
        """What the fields say; None, and a message, when one is wrong."""
        try:
            return read()
        except InputError as error:
            self._viewer.complain(kit.plain_message(error))
            return None


def file_name(name: str) -> str:
    """A name of a probe as one of a file.

    Examples
    --------
    >>> file_name("tsis-2011 (changed)")
    'tsis-2011-changed'
    """
    return re.sub(r"[^A-Za-z0-9_]+", "-", name).strip("-") or "probe"


WHAT = "No camera is needed: the model predicts how well diameter, depth and modulus of inclusions could be estimated."


async def design_tab(instrument: Instrument, viewer: kit.Viewer) -> None:
    """Build the page with this tab's draft."""
    await ui.context.client.connected()
    editor = viewer.saved(ProbeEditor)
    with ui.element("div").classes("design"):
        probe_panel = ui.element("section").classes("panel")
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                section = Section(editor, viewer)
            with ui.element("section").classes("panel"):
                QuestionForm(editor)
                reporting = DesignResultPanel(instrument, viewer, editor)
        with probe_panel:
            ProbeForm(editor, lambda: background_tasks.create(section.draw(), name="section of the probe"))
            ui.label(WHAT).classes("muted below")
    reporting.result_container()
    ui.timer(0.0, section.draw, once=True)  # the page does not wait for its picture
