"""Camera: the one in use, and the search for others."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from nicegui import run, ui

from tsis.__about__ import LARGEST_SEED
from tsis.calibration.file import LARGEST_BYTES
from tsis.calibration.frames import parse_usable_calibration
from tsis.catalog.phantoms import list_phantoms, list_spheres
from tsis.catalog.probes import list_probes
from tsis.console import widgets
from tsis.console.messages import plain_message
from tsis.console.services.choice import CameraChoice
from tsis.console.services.jobs import DONE
from tsis.errors import GaugeError
from tsis.instrument.force_log import BAUD, connected_gauge
from tsis.instrument.serial_gauge import find_ports

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.calibration.frames import UsableCalibration
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import JobState
    from tsis.console.services.state import CameraState, InstrumentState
    from tsis.console.viewer import Viewer
    from tsis.instrument.discovery import CameraInfo, CameraListing


def choose_and_start(instrument: Instrument, choice: CameraChoice, *, by: str) -> None:
    """Choose another camera and start it; a camera that does not start stays chosen."""
    instrument.choose(choice, by=by)
    instrument.start(by=by)


SHORT = 12


class CalibrationPanel:
    """Show and change the active calibration."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with widgets.panel("Active calibration", style="panel stack tight"):
            self._name = ui.label()
            self._identity = ui.label().classes("muted wordy")
            refused = f"a calibration file must end in .json and hold at most {LARGEST_BYTES // 2**20} MiB"
            self._upload = widgets.one_file(
                viewer, "Calibration file", accept=".json", refused=refused, most_bytes=LARGEST_BYTES
            )
            self._upload.on_upload(self._uploaded)
            self._none = widgets.button("Deactivate", viewer.command(instrument.use_calibration, None))
            controls.add(self._upload, self._none)

    def show(self, state: InstrumentState) -> None:
        """Show which it is."""
        own = state.camera.choice.is_virtual
        self._name.text = state.calibration or ("the virtual probe's own, once it runs" if own else "none")
        active = state.active
        self._identity.text = "" if active is None and own else calibration_text(active)
        self._none.text = "Use the virtual probe's own" if own else "Deactivate"

    async def _uploaded(self, event: UploadEventArguments) -> None:
        content = await event.file.read()
        self._upload.reset()

        def activated() -> str:
            usable = parse_usable_calibration(content, event.file.name)
            self._instrument.use_calibration(usable, by=self._viewer.identity)
            return usable.calibration.name

        name = await self._viewer.attempt(activated)
        if name is not None:
            self._viewer.notify(f"The calibration {name} is active.")


def calibration_text(usable: UsableCalibration | None) -> str:
    """Its identity and dates."""
    if usable is None:
        return "Without one presses are saved, but nothing can be estimated from them."
    created, expires = usable.calibration.made, usable.calibration.expires
    when = "" if created is None else f", made {widgets.time_label(created)}"
    until = "" if expires is None else f", expires {widgets.time_label(expires)}"
    left = "" if expires is None else f" ({max(0, (expires - datetime.now(UTC)).days)} days left)"
    return f"{usable.identity[:SHORT]}{when}{until}{left}"


ITS_OWN = "as it sends"
UNITS = (ITS_OWN, "N", "mN", "kN", "gf", "kgf", "lbf", "ozf")
FASTEST = 4_000_000


class GaugePanel:
    """Connect and disconnect a gauge; only there for real cameras."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with widgets.panel("Force gauge", style="panel stack tight") as self._panel:
            self._in_use = ui.label().props("role=status")
            with ui.element("div").classes("row"):
                self._port = widgets.select_field([], label="Serial port", with_input=True, new_value_mode="add-unique")
                self._unit = widgets.select_field(list(UNITS), value=ITS_OWN, label="Unit")
                self._baud = widgets.unit_field("Bits per second", str(BAUD), keys="numeric")
            self._sends = ui.switch("Sends continuously (do not query it)")
            with ui.element("div").classes("row"):
                self._connect = widgets.button("Connect", self._begin)
                leave = widgets.button("Use no gauge", viewer.command(instrument.use_gauge, None))
            controls.add(self._port, self._unit, self._baud, self._sends, self._connect, leave)
        self._panel.set_visibility(False)
        ui.timer(0.0, self._ports, once=True)

    def show(self, state: InstrumentState) -> None:
        """Show for real cameras which gauge is connected."""
        self._panel.set_visibility(not state.camera.choice.is_virtual)
        self._in_use.text = (
            f"Forces are read from the {state.gauge}." if state.gauge else "Forces are typed, or not known."
        )

    async def _ports(self) -> None:
        try:
            ports = await run.io_bound(find_ports) or ()
        except GaugeError as error:
            self._viewer.complain(plain_message(error))
            return
        self._port.set_options([port.device for port in ports], value=ports[0].device if ports else None)

    async def _begin(self) -> None:
        with widgets.loading(self._connect):
            await widgets.submit(self._viewer, {"baud": self._baud, "port": self._port}, self._connected)

    def _connected(self) -> None:
        baud = widgets.typed_integer("baud", self._baud.value, 50, FASTEST, hint="bits per second")
        unit = None if self._unit.value == ITS_OWN else str(self._unit.value)
        self._instrument.control.require(self._viewer.identity)
        log = connected_gauge(str(self._port.value or ""), unit=unit, baud=baud, sends=bool(self._sends.value))
        try:
            self._instrument.use_gauge(log, by=self._viewer.identity)
        except Exception:
            log.stop()
            raise


CHANGED = {"diameter_mm": ("Diameter", "mm"), "depth_mm": ("Depth", "mm"), "young_kpa": ("Modulus", "kPa")}


class VirtualPanel:
    """Choose the virtual probe and its subject; a button applies the choice."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        choice = instrument.camera_controller.choice
        with widgets.panel("Virtual probe", style="panel stack tight"):
            widgets.muted("No hardware: mechanics, light and camera are calculated.")
            with ui.element("div").classes("row"):
                self._probe = widgets.select_field(list(list_probes()), value=choice.probe, label="Probe")
                self._phantom = widgets.select_field(subjects(), value=choice.phantom, label="Pressed object")
                self._phantom.on_value_change(self._show_changes)
                self._seed = widgets.unit_field("Seed", str(choice.seed), keys="numeric").classes("seed")
            self._changes = ui.element("div").classes("row")
            with self._changes:
                ui.label("Inclusion other than the catalog's:").classes("muted whole-line")
                self._values = {
                    name: widgets.unit_field(
                        label, widgets.number_text_of_field(getattr(choice, name)), unit=unit
                    ).classes("number-field")
                    for name, (label, unit) in CHANGED.items()
                }
            self._use = widgets.button("Use the virtual probe", self._chosen, look="unelevated")
            controls.add(self._probe, self._phantom, self._seed, *self._values.values(), self._use)
        self._show_changes()

    def show(self, state: InstrumentState) -> None:
        """Show whether it is in use."""
        self._use.text = "Apply" if state.camera.choice.is_virtual else "Use the virtual probe"

    def _show_changes(self) -> None:
        """Show the inclusion's fields, which spheres do not have."""
        self._changes.set_visibility(self._phantom.value not in list_spheres())

    async def _chosen(self) -> None:
        with widgets.loading(self._use):
            await widgets.submit(self._viewer, {**self._values, "seed": self._seed}, self._apply)

    def _apply(self) -> None:
        changed: dict[str, Any] = {}
        if self._phantom.value not in list_spheres():
            changed = {
                name: widgets.typed_number(name, text)
                for name, field in self._values.items()
                if (text := (field.value or "").strip())
            }
        choice = CameraChoice(
            probe=self._probe.value,
            phantom=self._phantom.value,
            seed=widgets.typed_integer("seed", self._seed.value, 0, LARGEST_SEED),
            **changed,
        )
        choose_and_start(self._instrument, choice, by=self._viewer.identity)


def subjects() -> dict[str, str]:
    """The subjects of the virtual probe as text."""
    return {name: name for name in list_phantoms()} | {
        name: f"{name} (sphere, for hardness)" for name in list_spheres()
    }


class ChosenPanel:
    """The present camera."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with ui.element("div").classes("row"):
            with ui.element("div"):
                widgets.panel_title("Camera in use")
                self._name = ui.label()
                self._how = widgets.muted()
            ui.element("div").classes("spring")
            select = widgets.select_field({}, label="Mode").classes("mode")
            self._mode = widgets.ChoiceField(viewer, select, self._in_mode)
            self._run = widgets.RunButton(instrument, viewer)
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

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        with ui.element("section").classes("panel stack tight"):
            with widgets.title_row("Cameras"):
                self._search = widgets.button("Search", self._begin, icon="search")
            self._bar = widgets.ProgressBar("Search")
            self._message = widgets.status()
            self._cameras = widgets.Redrawn(ui.element("div").classes("stack"))

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
            with widgets.scrolling("Cameras"), widgets.rows_under(("Camera", "Source", "Details", "")):
                for camera in findings.cameras:
                    self._line(camera)
        if findings.missing:
            with (
                ui.expansion(f"{len(findings.missing)} sources could not be searched").props("dense").classes("missing")
            ):
                for source, message in findings.missing.items():
                    with ui.element("p"):
                        ui.label(source).classes("strong")
                        widgets.muted(message)

    def _line(self, camera: CameraInfo) -> None:
        with ui.element("tr"):
            widgets.cell(" ".join(filter(None, (camera.maker, camera.model))) or camera.identity)
            widgets.cell(camera.source)
            widgets.cell(", ".join(filter(None, (camera.identity, camera.note)))).classes("muted")
            with ui.element("td"):
                self._controls.add(
                    widgets.button(
                        "Use", partial(self._use, camera), look="outline dense", label=f"Use {camera.identity}"
                    )
                )

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
    controls = widgets.OperatorControls(viewer)
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
