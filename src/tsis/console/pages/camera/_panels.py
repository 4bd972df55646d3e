"""Panels of the active calibration, the force gauge and the virtual probe."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from nicegui import run, ui

from tsis.__about__ import LARGEST_SEED
from tsis.calibration import parse_usable_calibration
from tsis.calibration.file import LARGEST_BYTES
from tsis.catalog import list_phantoms, list_probes, list_spheres
from tsis.console.pages.components import (
    CalibrationMemory,
    field_messages,
    loading,
    number_text_of_field,
    one_file,
    panel_title,
    time_label,
    typed_integer,
    typed_number,
    unit_field,
)
from tsis.console.services import CameraChoice
from tsis.errors import GaugeError
from tsis.instrument.gauge import BAUD, connected_gauge, find_ports

if TYPE_CHECKING:
    from nicegui.events import UploadEventArguments

    from tsis.calibration import UsableCalibration
    from tsis.console.pages.components import OperatorControls, Viewer
    from tsis.console.services import Instrument, InstrumentState


def choose_and_start(instrument: Instrument, choice: CameraChoice, *, by: str) -> None:
    """Choose another camera and start it; a camera that does not start stays chosen."""
    instrument.choose(choice, by=by)
    instrument.start(by=by)


SHORT = 12


class CalibrationPanel:
    """Show and change the active calibration."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer, self._calibration = instrument, viewer, CalibrationMemory(instrument)
        with ui.element("section").classes("panel stack tight"):
            panel_title("Active calibration")
            self._name = ui.label()
            self._identity = ui.label().classes("muted wordy")
            refused = f"a calibration file must end in .json and hold at most {LARGEST_BYTES // 2**20} MiB"
            self._upload = one_file(
                viewer, "Calibration file", accept=".json", refused=refused, most_bytes=LARGEST_BYTES
            )
            self._upload.on_upload(self._uploaded)
            self._none = ui.button("Use none", on_click=viewer.command(instrument.use_calibration, None))
            controls.add(self._upload, self._none.props("no-caps outline"))

    def show(self, state: InstrumentState) -> None:
        """Show which it is."""
        own = state.camera.choice.is_virtual
        self._name.text = state.calibration or ("the virtual probe's own, once it runs" if own else "none")
        given = self._calibration.of(state)
        self._identity.text = "" if given is None and own else calibration_text(given)
        self._none.text = "Use the virtual probe's own" if own else "Use none"

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
    when = "" if created is None else f", made {time_label(created)}"
    until = "" if expires is None else f", expires {time_label(expires)}"
    left = "" if expires is None else f" ({max(0, (expires - datetime.now(UTC)).days)} days left)"
    return f"{usable.identity[:SHORT]}{when}{until}{left}"


ITS_OWN = "as it sends"
UNITS = (ITS_OWN, "N", "mN", "kN", "gf", "kgf", "lbf", "ozf")
FASTEST = 4_000_000


class GaugePanel:
    """Connect and disconnect a gauge; only there for real cameras."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with ui.element("section").classes("panel stack tight") as self._panel:
            panel_title("Force gauge")
            self._in_use = ui.label().props("role=status")
            with ui.element("div").classes("row"):
                self._port = ui.select([], label="Serial port", with_input=True, new_value_mode="add-unique")
                self._unit = ui.select(list(UNITS), value=ITS_OWN, label="Unit")
                self._baud = unit_field("Bits per second", str(BAUD), keys="numeric")
            self._sends = ui.switch("It sends on its own and is not to be asked")
            with ui.element("div").classes("row"):
                self._connect = ui.button("Connect", on_click=self._begin).props("no-caps outline")
                leave = ui.button("Use no gauge", on_click=viewer.command(instrument.use_gauge, None))
            for item in (self._port, self._unit, self._baud):
                controls.add(item.props("dense outlined"))
            controls.add(self._sends, self._connect, leave.props("no-caps outline"))
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
            self._viewer.complain(str(error))
            return
        self._port.set_options([port.device for port in ports], value=ports[0].device if ports else None)

    async def _begin(self) -> None:
        with loading(self._connect):
            await self._viewer.attempt(self._connected)

    def _connected(self) -> None:
        baud = typed_integer("baud", self._baud.value, 50, FASTEST, hint="bits per second")
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

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        choice = instrument.camera_controller.choice
        with ui.element("section").classes("panel stack tight"):
            panel_title("Virtual probe")
            ui.label("No hardware: mechanics, light and camera are calculated.").classes("muted")
            with ui.element("div").classes("row"):
                self._probe = ui.select(list(list_probes()), value=choice.probe, label="Probe")
                self._phantom = ui.select(subjects(), value=choice.phantom, label="Pressed object")
                self._phantom.on_value_change(self._show_changes)
                self._seed = unit_field("Seed", str(choice.seed), keys="numeric").classes("seed")
            self._changes = ui.element("div").classes("row")
            with self._changes:
                ui.label("Inclusion other than the catalog's:").classes("muted whole-line")
                self._values = {
                    name: unit_field(label, number_text_of_field(getattr(choice, name)), unit=unit).classes(
                        "number-field"
                    )
                    for name, (label, unit) in CHANGED.items()
                }
            for select in (self._probe, self._phantom):
                controls.add(select).props("dense outlined")
            self._use = ui.button("Use the virtual probe", on_click=self._chosen).props("no-caps unelevated")
            controls.add(self._seed, *self._values.values(), self._use)
        self._show_changes()

    def show(self, state: InstrumentState) -> None:
        """Show whether it is in use."""
        self._use.text = "Use it so" if state.camera.choice.is_virtual else "Use the virtual probe"

    def _show_changes(self) -> None:
        """Show the inclusion's fields, which spheres do not have."""
        self._changes.set_visibility(self._phantom.value not in list_spheres())

    async def _chosen(self) -> None:
        with loading(self._use):
            await self._viewer.attempt(self._apply)

    def _apply(self) -> None:
        changed: dict[str, Any] = {}
        if self._phantom.value not in list_spheres():
            changed = {
                name: typed_number(CHANGED[name][0].lower(), text)
                for name, field in self._values.items()
                if (text := (field.value or "").strip())
            }
        with field_messages({name: label.lower() for name, (label, _) in CHANGED.items()}):
            choice = CameraChoice(
                probe=self._probe.value,
                phantom=self._phantom.value,
                seed=typed_integer("seed", self._seed.value, 0, LARGEST_SEED),
                **changed,
            )
        choose_and_start(self._instrument, choice, by=self._viewer.identity)


def subjects() -> dict[str, str]:
    """The subjects of the virtual probe as text."""
    return {name: name for name in list_phantoms()} | {
        name: f"{name} (sphere, for hardness)" for name in list_spheres()
    }
