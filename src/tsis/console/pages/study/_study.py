"""The page of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import run, ui

from tsis.console.pages import components as kit
from tsis.console.pages.study._context import StudyView, view_study
from tsis.console.pages.study._listing import CodeTable
from tsis.console.pages.study._outcome import (
    JobProgress,
    Outcome,
    Running,
    Unblinding,
    import_button,
    show_devices,
    verify_button,
)
from tsis.console.studies import StudyRepository, unblinded_text
from tsis.errors import TsisError

if TYPE_CHECKING:
    from tsis.console.services import Instrument


EVERY_S = 0.5


def show_study(instrument: Instrument, viewer: kit.Viewer, name: str) -> None:
    """Build the page of the study whose name stands in the address."""
    viewer.every(EVERY_S, StudyPage(instrument, viewer, name).refresh)


class StudyPage:
    """The open page of the study whose name stands in the address."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, name: str) -> None:
        self.jobs, self.viewer, self.name = instrument.jobs, viewer, name
        self.repository = StudyRepository(instrument.terms.workspace)
        self._shown: tuple[int, int] | None = None
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel stack"):
                with ui.element("div").classes("row"):
                    ui.link("All studies", "/study").classes("link")
                    self._title = kit.panel_title("Study").classes("target-title")
                    ui.element("div").classes("spring")
                    self._commands = ui.element("div").classes("row")
                self._job = JobProgress(self)
                self._refusal = ui.label().classes("flag wordy").props('role="alert"')
                self._below = ui.element("div")
            self._outcome = Outcome(self)
            with ui.element("div").classes("split") as self._parts:
                with ui.element("section").classes("panel stack"):
                    self._codes = CodeTable()
                with ui.element("div").classes("stack"):
                    with ui.element("section").classes("panel stack") as self._run:
                        self._running = Running(self)
                    with kit.panel("Devices"):
                        self._devices = ui.element("div").classes("stack tight")
                    with kit.panel("Plan"):
                        self._plan = kit.FactList()
        with self._commands:
            self._import = import_button(self)
            verify_button(self, self._below)
            self._unblinding = Unblinding(self)
        for part in (self._parts, self._commands, self._refusal):
            part.set_visibility(False)

    async def refresh(self) -> None:
        """Show how far the job is, and the study anew when its log has changed."""
        self._running.allow(not self._job.refresh())
        stamp = self.repository.stamp(self.name) if self.name.isascii() else (0, 0)
        if stamp != self._shown:
            self._shown = stamp
            await self._load()

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
