"""Gel sensor: contact, depth and force, live."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.catalog.probes import list_probes
from tsis.catalog.sensors import list_sensors
from tsis.console import widgets
from tsis.console.pages.camera import choose_and_start
from tsis.console.pages.examine import MEASURE_EVERY_S, LivePanel
from tsis.console.services.choice import CameraChoice
from tsis.imaging.gel_contact import REASONS
from tsis.virtual.camera import GEL_PRESS_SETTING, GEL_PRESSES, virtual_gel_sensor

if TYPE_CHECKING:
    from tsis.console.services.frames import GelSetup
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer
    from tsis.imaging.depth import GelReading

NONE, UNTOUCHED, USUAL, SEED = "none", "0", "gelsight-mini", 1
PICTURES = ".png,.bmp,.tif,.tiff,.jpg,.jpeg"


class GelPage:
    """The live image with the contact, what it shows in numbers, and the files that this needs."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer, self._gel = instrument, viewer, instrument.gel
        self._controls = widgets.OperatorControls(viewer)
        with ui.element("div").classes("split camera-columns"):
            with ui.element("section").classes("stack"):
                with ui.element("div").classes("panel row"):
                    self._run = widgets.RunButton(instrument, viewer)
                    self._virtual = widgets.button("Use a virtual sensor", self.use_virtual)
                    press = widgets.select_field({UNTOUCHED: "untouched"}, value=UNTOUCHED, label="Virtual press")
                    self._press = widgets.ChoiceField(viewer, press, self._pressed)
                    ui.element("div").classes("spring")
                    ui.link("Another camera", "/camera")
                self._controls.why()
                self._live = LivePanel(instrument, map_name="grey")
            with ui.element("div").classes("stack"):
                with widgets.panel("Contact", style="panel stack tight"):
                    self._message = ui.label().props("role=status")
                    self.facts = widgets.FactList()
                with widgets.panel("Gel sensor", style="panel stack tight"):
                    sensor = widgets.select_field({NONE: "none: a probe"}, value=NONE, label="Sensor")
                    self._sensor = widgets.ChoiceField(viewer, sensor, self._chosen)
                    files = [widgets.file_field(viewer, "Sensor file", accept=".toml", act=self._gel.use_sensor)]
                    take = widgets.button("Take the untouched frame now", viewer.command(self._gel.use_reference))
                    files += [
                        widgets.file_field(viewer, "Untouched frame", accept=PICTURES, act=self._gel.use_reference),
                        widgets.file_field(viewer, "Depth calibration", accept=".json", act=self._gel.use_calibration),
                    ]
        self._controls.add(self._run.element, self._virtual, take, press, sensor, *files)
        viewer.follow(self.show)
        viewer.every(MEASURE_EVERY_S, self._live.frames.tools.refresh)

    def show(self, state: InstrumentState) -> None:
        """Show the instrument's state and the reading of the newest frame."""
        setup, camera = self._gel.setup, state.camera
        self._live.show(state)
        self._run.show(camera)
        self._press.element.set_visibility(bool(virtual_gel_sensor(camera.choice.spec)) and camera.running)
        place = next((item.value for item in camera.settings if item.name == GEL_PRESS_SETTING), 0.0)
        presses = {str(number): f"press {number}" for number in range(1, GEL_PRESSES + 1)}
        self._press.show(f"{place:.0f}", {UNTOUCHED: "untouched"} | presses)
        name = NONE if setup.sensor is None else setup.sensor.name
        listed = {item: item for item in (*list_sensors(), name) if item not in list_probes()}
        self._sensor.show(name, listed | {NONE: "none: a probe"})
        analysis = state.frame_analysis if camera.running and not camera.lost else None
        reading = None if analysis is None else analysis.gel
        self._message.text = next_step(setup, state) if reading is None else verdict(reading)
        self.facts.show(() if reading is None else reading_facts(reading, setup))
        self._controls.show(state)

    async def use_virtual(self) -> None:
        """Choose and start the virtual sensor: the chosen one, else the usual one."""
        present, by = self._gel.setup.sensor, self._viewer.identity
        name = present.name if present is not None and present.name in list_sensors() else USUAL

        def started() -> None:
            choose_and_start(self._instrument, CameraChoice(spec=f"virtual-gel:{name}", seed=SEED), by=by)
            self._gel.use_sensor(name, by=by)

        with widgets.loading(self._virtual):
            await self._viewer.attempt(started)

    def _chosen(self, name: str) -> None:
        self._gel.use_sensor(None if name == NONE else name, by=self._viewer.identity)

    def _pressed(self, place: str) -> None:
        self._instrument.adjust(GEL_PRESS_SETTING, float(place), by=self._viewer.identity)


def next_step(setup: GelSetup, state: InstrumentState) -> str:
    """What to do before contacts are shown."""
    if setup.sensor is None:
        return "Choose the sensor, or its file."
    if not state.camera.running:
        return "Start the camera."
    return "Remove everything from the sensor, and take its untouched frame." if setup.reference is None else ""


def verdict(reading: GelReading) -> str:
    """Whether the contact can be used, else what to do."""
    advice = " ".join(f"{reason}: {REASONS[reason]}." for reason in reading.reasons)
    return "The contact is good." if reading.good else advice


def reading_facts(reading: GelReading, setup: GelSetup) -> tuple[tuple[str, str], ...]:
    """The reading in numbers, with their units."""
    facts = [("Quality", f"{reading.quality:.2f}")]
    if reading.centre_px is not None:
        facts += [("Centre", "{:.1f}, {:.1f} px".format(*reading.centre_px))]
        mm = reading.radius_mm
        facts += [
            ("Radius", f"{reading.radius_px:.1f} px" if mm is None else f"{mm:.3f} ± {reading.radius_sd_mm:.3f} mm")
        ]
    if reading.force_interval_n is not None:
        force = f"{reading.force_n:.3g} N " + "({:.3g} … {:.3g} N)".format(*reading.force_interval_n)
        facts += [("Deepest point", f"{reading.deepest_mm:.3f} mm"), ("Force", force)]
    elif setup.calibration is None:
        facts += [("Depth and force", "need a depth calibration, a file of this sensor")]
    return (*facts, *(("Note", problem) for problem in reading.problems))
