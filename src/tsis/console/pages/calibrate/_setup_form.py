"""The form of a new session."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import quote

from nicegui import ui

from tsis.__about__ import LARGEST_SEED
from tsis.calibration.force import TIPS_MM
from tsis.calibration.session import SessionSetup
from tsis.catalog import list_probes
from tsis.console.pages.components import (
    field_messages,
    number_text_of_field,
    typed_integer,
    typed_number,
    typed_numbers,
    unit_field,
)
from tsis.errors import InputError
from tsis.model import require_integer
from tsis.virtual import bench_name

if TYPE_CHECKING:
    from tsis.console.pages.components import OperatorControls, Viewer
    from tsis.console.services import Instrument, InstrumentState
    from tsis.console.services.calibrating import CalibrationSession


LEAST_LOADINGS = 2  # of a force line: the lamps' drift hides in the slope of a single one
SIDES = 4  # of a patch: left, top, right, bottom
LABELS = {
    "pitch_mm": "pitch of the dot board",
    "pitch_sd_mm": "its standard uncertainty",
    "tips_mm": "radii of the tips",
    "tip_radius_mm": "each radius of the tips",
    "gauge_share": "relative uncertainty of the gauge",
    "patch_px": "lamps seen past the probe",
}


class TermsForm:
    """Asks for the terms and begins the session."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        choice = instrument.camera_controller.choice
        self._virtual = choice.is_virtual
        shown_tips = ", ".join(number_text_of_field(tip) for tip in TIPS_MM)
        with ui.element("div").classes("stack"):
            self._with = ui.label().classes("muted")
            with ui.element("div").classes("calibrate-terms"):
                self._name = unit_field("Name", "bench", keys="text")
                self._probe = ui.select(list(list_probes()), value=choice.probe, label="Probe").props("dense outlined")
                self._pitch = unit_field("Pitch of the dot board", "2.5", unit="mm")
                self._pitch_sd = unit_field("Its standard uncertainty", "0", unit="mm")
                self._tips = unit_field("Radii of the tips", shown_tips, unit="mm", keys="text")
                self._repeats = unit_field("Loadings of each tip", "1")
                self._gauge_uncertainty = unit_field("Relative uncertainty of the gauge", "0.001")
                self._seed = unit_field("Seed of the virtual rig", str(choice.seed), keys="numeric")
                self._patch = unit_field("Lamps seen past the probe", unit="pixels", keys="text")
                self._patch.props('hint="left, top, right, bottom; empty where they are seen nowhere" ')
            with ui.element("div").classes("row"):
                self._button = ui.button("Begin", icon="play_arrow", on_click=self._begin).props("no-caps unelevated")
        controls.add(self._button)

    def show(self, state: InstrumentState) -> None:
        """Ask for what the present camera needs."""
        self._virtual = state.camera.choice.is_virtual
        self._seed.set_visibility(self._virtual)
        self._patch.set_visibility(not self._virtual)
        if self._virtual:
            self._with.text = "With the virtual rig, which does each step at a click."
        elif state.camera.running:
            self._with.text = f"With {state.camera.name}, at the settings that it has now."
        else:
            self._with.text = "With the camera that is chosen; start it first, for the session remembers its settings."

    async def _begin(self) -> None:
        session = await self._viewer.attempt(self._begun)
        if session is not None:
            ui.navigate.to(f"/calibrate/{quote(session.name)}")

    def _begun(self) -> CalibrationSession:
        with field_messages(LABELS):
            return self._instrument.calibrating.begin(self._terms(), by=self._viewer.identity)

    def _terms(self) -> SessionSetup:
        tips = typed_numbers(LABELS["tips_mm"], self._tips.value)
        repeats = typed_integer("loadings of each tip", self._repeats.value, 1, 20)
        if len(tips) * repeats < LEAST_LOADINGS:
            raise InputError(
                f"a calibration needs at least {LEAST_LOADINGS} loadings, of two tips or of one twice; got {len(tips)} "
                f"tip and {repeats} loading of it (add a tip, or load it twice)"
            )
        seed = typed_integer("seed", self._seed.value, 0, LARGEST_SEED)
        name = (self._name.value or "").strip()
        if not name:
            raise InputError("name must be given: what the calibration will be called; got none")
        return SessionSetup(
            name=name,
            probe=self._probe.value or "",
            camera=bench_name(seed) if self._virtual else self._instrument.camera_controller.name or "camera",
            pitch_mm=typed_number(LABELS["pitch_mm"], self._pitch.value),
            pitch_sd_mm=typed_number(LABELS["pitch_sd_mm"], self._pitch_sd.value),
            gauge_share=typed_number(LABELS["gauge_share"], self._gauge_uncertainty.value),
            patch_px=None if self._virtual else typed_patch(self._patch.value or ""),
            tips_mm=tips,
            repeats=repeats,
        )


def typed_patch(text: str) -> tuple[int, int, int, int] | None:
    """Left, top, right and bottom of a patch; None where nothing was typed.

    Examples
    --------
    >>> typed_patch("4, 4, 36, 36"), typed_patch(" ")
    ((4, 4, 36, 36), None)
    """
    if not text.strip():
        return None
    result = typed_numbers("lamps seen past the probe", text)
    if len(result) != SIDES:
        raise InputError(f"lamps seen past the probe must be left, top, right, bottom in pixels; got {text!r:.60}")
    left, top, right, bottom = (require_integer("lamps seen past the probe", side, 0, 100_000) for side in result)
    return left, top, right, bottom
