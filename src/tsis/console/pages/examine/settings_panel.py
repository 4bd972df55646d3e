"""Settings of the camera with their ranges, and two ways back to a known state of them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.examine.setting_line import SettingLine, setting_words
from tsis.console.pages.field_words import field_words
from tsis.instrument.presets import PRESETS

if TYPE_CHECKING:
    from tsis.console.bench import Bench, BenchState
    from tsis.console.pages.operated import Operated
    from tsis.console.pages.viewer import Viewer

PRESET_WORDS = {"default": "As the camera came", "minimal": "As dark as it goes"}


class SettingsPanel:
    """One slider and one field a setting; what is changed elsewhere appears.

    Parameters
    ----------
    bench, viewer, operated
        As of `PressPanel`.
    """

    def __init__(self, bench: Bench, viewer: Viewer, operated: Operated) -> None:
        self._bench, self._viewer, self._operated = bench, viewer, operated
        self._lines: dict[str, SettingLine] = {}
        self._shape: tuple[object, ...] | None = None
        with ui.element("div").classes("row"):
            for name in PRESETS:
                button = ui.button(name.capitalize(), on_click=partial(self._preset, name)).props(
                    "outline dense no-caps"
                )
                with operated.add(button):
                    ui.tooltip(PRESET_WORDS[name])
        self._place = ui.element("div").classes("settings")
        self._none = ui.label("Start the camera to adjust it.").classes("muted")

    def show(self, state: BenchState) -> None:
        """Show the camera's settings."""
        settings = state.camera.settings
        shape = tuple((each.name, each.low, each.high, each.unit) for each in settings)
        if shape != self._shape:
            self._shape = shape
            self._place.clear()
            with self._place:
                self._lines = {
                    each.name: SettingLine(each, partial(self._adjust, each.name), self._viewer, self._operated)
                    for each in settings
                }
        self._none.set_visibility(not settings)
        self._none.text = "The camera is away." if state.camera.lost else "Start the camera to adjust it."
        for each in settings:
            self._lines[each.name].show(each.value)

    async def _preset(self, name: str) -> None:
        await self._viewer.attempt(self._bench.preset, name, by=self._viewer.identity)

    def _adjust(self, name: str, value: float) -> None:
        with field_words({name: setting_words(name).lower()}):
            self._bench.adjust(name, value, by=self._viewer.identity)
