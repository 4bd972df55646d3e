"""The page of the camera: the one in use, and the search for others."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.camera._panels import CalibrationPanel, GaugePanel, VirtualPanel, choose_and_start
from tsis.console.pages.components import (
    ChoiceField,
    OperatorControls,
    ProgressBar,
    Redrawn,
    RunButton,
    cell,
    panel_title,
    rows_under,
)
from tsis.console.services import DONE, CameraChoice

if TYPE_CHECKING:
    from tsis.console.pages.components import Viewer
    from tsis.console.services import CameraState, Instrument, InstrumentState, JobState
    from tsis.instrument import CameraInfo, CameraListing


class ChosenPanel:
    """The present camera."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with ui.element("div").classes("row"):
            with ui.element("div"):
                panel_title("Camera in use")
                self._name = ui.label()
                self._how = ui.label().classes("muted")
            ui.element("div").classes("spring")
            select = ui.select({}, label="Mode").props("dense outlined").classes("mode")
            self._mode = ChoiceField(viewer, select, self._in_mode)
            self._run = RunButton(instrument, viewer)
            ui.link("Examine", "/")
        controls.add(select, self._run.element)

    def show(self, state: InstrumentState) -> None:
        """Show the camera's state."""
        camera = state.camera
        self._name.text = camera_text(camera)
        self._how.text = streaming_text(camera)
        self._mode.show(camera.mode or None, {label: label for label in camera.modes})
        self._mode.element.set_visibility(bool(camera.modes))
        self._run.show(camera)

    def _in_mode(self, label: str) -> None:
        choose_and_start(
            self._instrument, replace(self._instrument.camera_controller.choice, mode=label), by=self._viewer.identity
        )


def camera_text(camera: CameraState) -> str:
    """Its name, or what was chosen before it was connected."""
    if camera.name:
        return camera.name
    choice = camera.choice
    return f"virtual probe {choice.probe} on {choice.phantom}" if choice.is_virtual else choice.spec


def streaming_text(camera: CameraState) -> str:
    """Whether frames come."""
    if not camera.running:
        return "stopped"
    if camera.lost:
        return f"away: {camera.failure}" if camera.failure else "away"
    return f"runs at {camera.frames_per_s:.0f} frames/s, {camera.columns} x {camera.rows} pixels"


class SearchPanel:
    """Search for cameras, and use one of them."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        with ui.element("section").classes("panel stack tight"):
            with ui.element("div").classes("row"):
                panel_title("Cameras")
                ui.element("div").classes("spring")
                self._search = ui.button("Search", icon="search", on_click=self._begin).props("no-caps outline")
            self._bar = ProgressBar("Search")
            self._message = ui.label().classes("muted").props("role=status")
            self._cameras = Redrawn(ui.element("div").classes("stack"))

    def show(self, _: InstrumentState) -> None:
        """Show the last search."""
        job = self._instrument.search.state()
        self._bar.show(job)
        self._search.set_enabled(job is None or not job.running)
        self._message.text = search_text(job)
        changed = self._cameras.changes_to(None if job is None else (job.identity, job.status))
        findings = self._instrument.search.findings
        if changed and job is not None and job.status == DONE and findings is not None:
            with self._cameras.element:
                self._show_cameras(findings)

    async def _begin(self) -> None:
        await self._viewer.attempt(self._instrument.search.begin)

    def _show_cameras(self, findings: CameraListing) -> None:
        if findings.cameras:
            with ui.element("div").classes("scroll"), rows_under(("Camera", "Source", "About it", "")):
                for camera in findings.cameras:
                    self._line(camera)
        if findings.missing:
            with (
                ui.expansion(f"{len(findings.missing)} sources could not be searched").props("dense").classes("missing")
            ):
                for source, message in findings.missing.items():
                    with ui.element("p"):
                        ui.label(source).classes("strong")
                        ui.label(message).classes("muted")

    def _line(self, camera: CameraInfo) -> None:
        with ui.element("tr"):
            cell(" ".join(filter(None, (camera.maker, camera.model))) or camera.identity)
            cell(camera.source)
            cell(", ".join(filter(None, (camera.identity, camera.note)))).classes("muted")
            with ui.element("td"):
                use = ui.button("Use", on_click=partial(self._use, camera)).props("no-caps outline dense")
                use.props["aria-label"] = f"Use {camera.identity}"
                self._controls.add(use)

    async def _use(self, camera: CameraInfo) -> None:
        await self._viewer.attempt(
            choose_and_start, self._instrument, CameraChoice(spec=camera.spec), by=self._viewer.identity
        )


def search_text(job: JobState | None) -> str:
    """How far a search is."""
    if job is None:
        return "No search yet. A search asks every source and takes some seconds."
    return "Searching all sources; this takes some seconds." if job.running else job.sentence


def camera_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    controls = OperatorControls(viewer)
    with ui.element("div").classes("panel stack"):
        chosen = ChosenPanel(instrument, viewer, controls)
        controls.why()
    with ui.element("div").classes("camera-columns"):
        with ui.element("div").classes("stack"):
            virtual = VirtualPanel(instrument, viewer, controls)
            calibration = CalibrationPanel(instrument, viewer, controls)
        with ui.element("div").classes("stack"):
            search = SearchPanel(instrument, viewer, controls)
            gauge = GaugePanel(instrument, viewer, controls)

    def show(state: InstrumentState) -> None:
        for part in (chosen, virtual, search, calibration, gauge, controls):
            part.show(state)

    viewer.follow(show)
