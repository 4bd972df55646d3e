"""Cameras that answer a search, and what the sources that could not look are missing."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.bench import CameraChoice
from tsis.console.bench.jobs import DONE
from tsis.console.pages.camera.choosing import choose_and_start
from tsis.console.pages.headings import panel_title
from tsis.console.pages.progress_bar import ProgressBar
from tsis.console.pages.table import cell, rows_under

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState, JobState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer
    from tsis.instrument.discovery import CameraListing
    from tsis.instrument.found import CameraInfo


class FoundPanel:
    """Search, and use one of those that were found.

    Parameters
    ----------
    bench, viewer, operated
        As of `ChosenPanel`.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer, self._operated = bench, viewer, operated
        self._shown: tuple[str, str] | None = None
        with ui.element("section").classes("panel stack tight"):
            with ui.element("div").classes("row"):
                panel_title("Cameras")
                ui.element("div").classes("spring")
                self._search = ui.button("Search", icon="search", on_click=self._begin).props("no-caps outline")
            self._bar = ProgressBar("Search")
            self._said = ui.label().classes("muted").props("role=status")
            self._place = ui.element("div").classes("stack")

    def show(self, _: BenchState) -> None:
        """Show the last search, whoever began it."""
        job = self._bench.search.state()
        self._bar.show(job)
        self._search.set_enabled(job is None or not job.running)
        self._said.text = search_words(job)
        now = None if job is None else (job.identity, job.status)
        if now != self._shown:
            self._shown = now
            self._place.clear()
            findings = self._bench.search.findings
            if job is not None and job.status == DONE and findings is not None:
                with self._place:
                    self._show_found(findings)

    async def _begin(self) -> None:
        await self._viewer.attempt(self._bench.search.begin)

    def _show_found(self, findings: CameraListing) -> None:
        if findings.found:
            with ui.element("div").classes("scroll"), rows_under(("Camera", "Source", "About it", "")):
                for camera in findings.found:
                    self._line(camera)
        if findings.missing:
            with ui.expansion(f"{len(findings.missing)} sources could not look").props("dense").classes("missing"):
                for source, sentence in findings.missing.items():
                    with ui.element("p"):
                        ui.label(source).classes("strong")
                        ui.label(sentence).classes("muted")

    def _line(self, camera: CameraInfo) -> None:
        with ui.element("tr"):
            cell(" ".join(filter(None, (camera.maker, camera.model))) or camera.identity)
            cell(camera.source)
            cell(", ".join(filter(None, (camera.identity, camera.note)))).classes("muted")
            with ui.element("td"):
                use = ui.button("Use", on_click=partial(self._use, camera)).props("no-caps outline dense")
                use.props["aria-label"] = f"Use {camera.identity}"
                self._operated.add(use)

    async def _use(self, camera: CameraInfo) -> None:
        await self._viewer.attempt(
            choose_and_start, self._bench, CameraChoice(spec=camera.spec), by=self._viewer.identity
        )


def search_words(job: JobState | None) -> str:
    """How far a search is."""
    if job is None:
        return "Nobody has searched yet. A search asks every source and takes some seconds."
    return "Asking every source; this takes some seconds." if job.running else job.sentence
