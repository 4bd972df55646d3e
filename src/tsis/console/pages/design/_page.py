"""Asking what a design would tell: the job, how far it is, and its answer."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from nicegui import background_tasks, ui

from tsis.catalog import probe_toml
from tsis.console.pages.components import ProgressBar, drawings, panel_title, report_parts
from tsis.console.pages.design._draft import ProbeEditor
from tsis.console.pages.design._forms import ProbeForm, QuestionForm
from tsis.console.pages.design._section import Section
from tsis.console.services import DONE, JobCancelled
from tsis.errors import InputError
from tsis.files import json_bytes
from tsis.report import analyse_designs, compared_designs, design_document, design_page, searched_design

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.pages.components import Viewer
    from tsis.console.services import Instrument, Job
    from tsis.report import DesignAnalysis, DesignQuestion, Page


EVERY_S = 0.4  # between two looks at the job
SCROLL = 'getHtmlElement({}).scrollIntoView({{behavior: "smooth", block: "start"}})'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignResult:
    """An answer, and its page with its pictures drawn."""

    answer: DesignAnalysis
    page: Page
    pictures: tuple[str, ...]


def judge(question: DesignQuestion) -> Callable[[Job], DesignResult]:
    """The work of answering a question; a search that is ended leaves what was compared before."""

    def work(job: Job) -> DesignResult:
        result = compared_designs(question, progress=job.advance)
        job.tell(0, question.evaluations or 0)
        try:
            optimum = searched_design(question, progress=job.advance)
        except JobCancelled:
            optimum = None
            job.say("The search was ended; this is what was compared before it.")
        response = analyse_designs(question, result, optimum)
        page = design_page(response)
        return DesignResult(answer=response, page=page, pictures=drawings(page))

    return work


class DesignResultPanel:
    """Button, progress and answer.

    Parameters
    ----------
    bench
        Whose jobs.
    viewer
        Who asks.
    desk
        What is asked about.
    """

    def __init__(self, bench: Instrument, viewer: Viewer, desk: ProbeEditor) -> None:
        self._bench, self._viewer, self._desk = bench, viewer, desk
        self._shown: Job | None = None
        self._begun_here = False
        with ui.element("div").classes("row below"):
            self._ask = ui.button("What would it tell?", on_click=self._asked).props("no-caps")
            self._end = ui.button("End", on_click=self._ended).props("no-caps outline")
            ui.element("div").classes("spring")
            ui.button("Save the probe", on_click=self._save_probe).props("no-caps flat dense")
        self._bar = ProgressBar("Progress of the designs")
        self._sentence = ui.label().props('role="status"')

    def answer_below(self) -> None:
        """Place the answer here."""
        self._answer = ui.element("section").classes("panel stack design-answer").props('aria-label="Answer"')
        self._answer.set_visibility(False)
        ui.timer(EVERY_S, self._look)

    def _asked(self) -> None:
        if self._running():
            return
        try:
            question = self._desk.asked.question(self._desk.probe.probe())
        except InputError as error:
            self._viewer.complain(str(error))
            return
        self._desk.job = self._bench.jobs.begin(f"what {question.planned.described} would tell", judge(question))
        self._look()

    def _ended(self) -> None:
        if self._desk.job is not None:
            self._desk.job.end()

    def _running(self) -> bool:
        return self._desk.job is not None and self._desk.job.state().running

    def _look(self) -> None:
        job = self._desk.job
        state = None if job is None else job.state()
        running = state is not None and state.running
        self._ask.set_enabled(not running)
        self._end.set_visibility(running)
        self._bar.show(state)
        if job is None or state is None:
            return
        if running:
            self._begun_here = True
            self._sentence.text = (
                f"{state.done} of {state.total} solved" if state.done else "The press of a new probe takes a while."
            )
        elif job is not self._shown:
            self._shown = job
            self._sentence.text = state.sentence
            if state.status == DONE:
                self._show(job.result)
                if self._begun_here:
                    self._answer.client.run_javascript(SCROLL.format(self._answer.id))

    def _show(self, told: DesignResult) -> None:
        self._answer.clear()
        self._answer.set_visibility(True)
        with self._answer:
            with ui.element("div").classes("row"):
                panel_title(f"{told.page.title}: {told.page.subtitle}")
                ui.element("div").classes("spring")
                ui.button("Save the answer", on_click=lambda: self._save(told.answer)).props("no-caps flat dense")
            report_parts(told.page, told.pictures)

    def _save(self, answer: DesignAnalysis) -> None:
        ui.download.content(json_bytes(design_document(answer)), "design.json", "application/json")

    def _save_probe(self) -> None:
        try:
            probe = self._desk.probe.probe()
        except InputError as error:
            self._viewer.complain(str(error))
            return
        ui.download.content(probe_toml(probe).encode(), f"{file_name(probe.name)}.toml", "application/toml")


def file_name(name: str) -> str:
    """A name of a probe as one of a file.

    Examples
    --------
    >>> file_name("tsis-2011 (changed)")
    'tsis-2011-changed'
    """
    return re.sub(r"[^A-Za-z0-9_]+", "-", name).strip("-") or "probe"


WHAT = (
    "Nothing is pressed here and no camera is needed: the model behind the estimates tells how well diameter, depth "
    "and modulus of inclusions would be known."
)


async def design_tab(bench: Instrument, viewer: Viewer) -> None:
    """Build the page, with what this tab had on its desk."""
    await ui.context.client.connected()
    controller = viewer.kept(ProbeEditor)
    with ui.element("div").classes("design"):
        probe_panel = ui.element("section").classes("panel")
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                section = Section(controller, viewer)
            with ui.element("section").classes("panel"):
                QuestionForm(controller)
                reporting = DesignResultPanel(bench, viewer, controller)
        with probe_panel:
            ProbeForm(controller, lambda: background_tasks.create(section.draw(), name="section of the probe"))
            ui.label(WHAT).classes("muted below")
    reporting.answer_below()
    await section.draw()
