"""The newest frame's press: force and its source, settling, and flags."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.components import Redrawn, force_text, set_class

if TYPE_CHECKING:
    from tsis.console.services import FrameAnalysis, InstrumentState


SOURCES = {"gauge": "from the gauge", "virtual": "of the virtual probe", "typed": "as typed"}


class ForceRow:
    """Force and whether the press has settled, on one line."""

    def __init__(self) -> None:
        self._force = ui.label().classes("number")
        self._source = ui.label().classes("muted")
        ui.element("div").classes("spring")
        self._still = ui.label().classes("chip still")

    def show(self, state: InstrumentState) -> None:
        """Show the newest analysis."""
        analysis = present(state)
        force = None if analysis is None else analysis.force
        self._force.text = "" if force is None else f"{force.value_n:.2f} N"
        self._source.text = force_text(None) if force is None else SOURCES[force.source]
        self._still.text = "" if analysis is None else analysis.still
        self._still.set_visibility(bool(self._still.text))
        set_class(self._still, "good", self._still.text == "settled")


class FlagList:
    """Flags of the press, with advice."""

    def __init__(self) -> None:
        self._list = Redrawn(ui.element("ul").classes("flags").props('aria-label="Flags of this press"'))

    def show(self, state: InstrumentState) -> None:
        """Show the flags of the newest analysis; an unchanged list stays, so that screen readers do not repeat it."""
        result = flags(present(state))
        if self._list.changes_to(result):
            with self._list.element:
                for name, advice in result:
                    with ui.element("li"):
                        ui.label(name).classes("flag" if advice else "good")
                        ui.label(advice).classes("muted")


def present(state: InstrumentState) -> FrameAnalysis | None:
    """The present analysis; None while the camera is stopped or away."""
    return state.frame_analysis if state.camera.running and not state.camera.lost else None


def flags(analysis: FrameAnalysis | None) -> tuple[tuple[str, str], ...]:
    """Names of the flags with their advice; one line without advice when there are none."""
    if analysis is None:
        return ()
    return tuple((flag.name, flag.advice) for flag in analysis.flags) or (("No flags.", ""),)
