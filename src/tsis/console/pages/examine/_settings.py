"""The camera's settings: a slider where the range is known, and a field for the exact number."""

from __future__ import annotations

import math
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages import components as kit
from tsis.instrument import PRESETS

if TYPE_CHECKING:
    from collections.abc import Callable

    from nicegui.events import GenericEventArguments

    from tsis.console.services import Instrument, InstrumentState
    from tsis.instrument import Setting


STEPS = 200  # of a slider
UNITS_IN_NAMES = ("_ms", "_db", "_s", "_n")


class SettingLine:
    """One setting of the camera, changed by ``adjust``."""

    def __init__(
        self, setting: Setting, adjust: Callable[[float], object], viewer: kit.Viewer, controls: kit.OperatorControls
    ) -> None:
        self._setting, self._adjust, self._viewer = setting, adjust, viewer
        self._slider: ui.slider | None = None
        self._moving = False
        text = setting_label(setting.name)
        with ui.element("div").classes("setting"):
            ends = f"{setting.low:g} to {setting.high:.4g} {setting.unit}".strip()
            about = f"{text} of the camera: {ends}."
            self._field = kit.NumberField(viewer, text, adjust, about=about, unit=setting.unit)
            controls.add(self._field.element)
            if math.isfinite(setting.low) and math.isfinite(setting.high) and setting.low < setting.high:
                span = setting.high - setting.low
                self._slider = ui.slider(min=setting.low, max=setting.high, step=span / STEPS, value=setting.value)
                self._slider.props("dense").props["aria-label"] = text
                self._slider.on("update:model-value", self._changed)
                self._slider.on("change", self._released)
                controls.add(self._slider)
                ui.label(ends).classes("muted range")

    def show(self, value: float) -> None:
        """Show the camera's value, unless another one is being given."""
        self._field.show(value)
        if self._slider is not None and not self._moving and self._slider.value != value:
            self._slider.set_value(value)

    def _changed(self) -> None:
        self._moving = True

    async def _released(self, event: GenericEventArguments) -> None:
        value = min(max(float(event.args), self._setting.low), self._setting.high)
        refusal = await self._viewer.refusal(partial(self._adjust, value))
        self._moving = False
        if refusal is not None:
            self._field.refuse(kit.plain_message(refusal))


def setting_label(name: str) -> str:
    """A setting's name for people: without its unit, which stands behind the number.

    Examples
    --------
    >>> setting_label("exposure_ms"), setting_label("frames_per_s"), setting_label("gain")
    ('Exposure', 'Frames per s', 'Gain')
    """
    if name != "frames_per_s":
        for ending in UNITS_IN_NAMES:
            name = name.removesuffix(ending)
    return name.replace("_", " ").capitalize()


PRESET_TEXTS = {"default": "As the camera came", "minimal": "Darkest"}


class SettingsPanel:
    """One slider and one field per setting; changes from elsewhere appear."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, controls: kit.OperatorControls) -> None:
        self._instrument, self._viewer, self._controls = instrument, viewer, controls
        self._lines: dict[str, SettingLine] = {}
        with ui.element("div").classes("row"):
            for name in PRESETS:
                act = viewer.command(instrument.preset, name)
                with controls.add(kit.button(name.capitalize(), act, look="outline dense")):
                    ui.tooltip(PRESET_TEXTS[name])
        self._container = kit.Redrawn(ui.element("div").classes("settings"))
        self._none = kit.muted("Start the camera to adjust it.")

    def show(self, state: InstrumentState) -> None:
        """Show the camera's settings."""
        settings = state.camera.settings
        shape = tuple((setting.name, setting.low, setting.high, setting.unit) for setting in settings)
        if self._container.changes_to(shape):
            with self._container.element:
                self._lines = {
                    setting.name: SettingLine(
                        setting, partial(self._adjust, setting.name), self._viewer, self._controls
                    )
                    for setting in settings
                }
        self._none.set_visibility(not settings)
        self._none.text = "The camera is away." if state.camera.lost else "Start the camera to adjust it."
        for setting in settings:
            self._lines[setting.name].show(setting.value)

    def _adjust(self, name: str, value: float) -> None:
        with kit.field_messages({name: setting_label(name).lower()}):
            self._instrument.adjust(name, value, by=self._viewer.identity)
