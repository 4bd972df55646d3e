"""One setting of the camera: a slider where its range is known, and a field for the exact number."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.number_field import NumberField

if TYPE_CHECKING:
    from collections.abc import Callable

    from nicegui.events import GenericEventArguments

    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer
    from tsis.instrument import Setting

STEPS = 200  # of a slider
UNITS_IN_NAMES = ("_ms", "_db", "_s", "_n")


class SettingLine:
    """A setting as people read and change it.

    Parameters
    ----------
    setting
        With its range and unit.
    adjust
        Changes it.
    viewer, operated
        Who looks; takes the controls.
    """

    def __init__(self, setting: Setting, adjust: Callable[[float], object], viewer: Viewer, operated: Operated) -> None:
        self._setting, self._adjust, self._viewer = setting, adjust, viewer
        self._slider: ui.slider | None = None
        self._moving = False
        words = setting_words(setting.name)
        with ui.element("div").classes("setting"):
            self._field = NumberField(viewer, words, adjust, unit=setting.unit)
            operated.add(self._field.element)
            if math.isfinite(setting.low) and math.isfinite(setting.high) and setting.low < setting.high:
                span = setting.high - setting.low
                self._slider = ui.slider(min=setting.low, max=setting.high, step=span / STEPS, value=setting.value)
                self._slider.props("dense").props["aria-label"] = words
                self._slider.on("update:model-value", self._moved)
                self._slider.on("change", self._released)
                operated.add(self._slider)
                ui.label(f"{setting.low:g} to {setting.high:.4g} {setting.unit}").classes("muted range")

    def show(self, value: float) -> None:
        """Show the camera's value, unless another one is being given."""
        self._field.show(value)
        if self._slider is not None and not self._moving and self._slider.value != value:
            self._slider.set_value(value)

    def _moved(self) -> None:
        self._moving = True

    async def _released(self, event: GenericEventArguments) -> None:
        value = min(max(float(event.args), self._setting.low), self._setting.high)
        await self._viewer.attempt(self._adjust, value)
        self._moving = False


def setting_words(name: str) -> str:
    """A setting's name for people: without its unit, which stands behind the number.

    Examples
    --------
    >>> setting_words("exposure_ms"), setting_words("frames_per_s"), setting_words("gain")
    ('Exposure', 'Frames per s', 'Gain')
    """
    if name != "frames_per_s":
        for ending in UNITS_IN_NAMES:
            name = name.removesuffix(ending)
    return name.replace("_", " ").capitalize()
