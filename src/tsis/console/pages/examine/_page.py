"""The page Examine: live image, press, keys and sequence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

from nicegui import ui
from nicegui.element import Element

from tsis.__about__ import LARGEST_TARGET
from tsis.console.live import FIRST_MAP, Histogram, LiveView, SurfaceView
from tsis.console.pages import components as kit
from tsis.console.pages.examine._estimate import EstimatePanel, TissueRow, WorkOrder
from tsis.console.pages.examine._settings import SettingsPanel
from tsis.console.services import MOST_SEQUENCE_FRAMES
from tsis.model.require import require_integer
from tsis.records.values import ROLE_NAMES

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable

    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.examine._estimate import SavedTarget
    from tsis.console.services import FrameAnalysis, Instrument, InstrumentState, Job, JobState, SavedPress


SOURCES = {"gauge": "from the gauge", "virtual": "(simulated)", "typed": "(typed)"}


class ForceRow:
    """Force and whether the press has settled, on one line."""

    def __init__(self) -> None:
        self._force = ui.label().classes("number")
        self._source = kit.muted()
        ui.element("div").classes("spring")
        self._still = ui.label().classes("chip still")

    def show(self, state: InstrumentState) -> None:
        """Show the newest analysis."""
        analysis = present(state)
        force = None if analysis is None else analysis.force
        self._force.text = "" if force is None else f"{force.value_n:.2f} N"
        self._source.text = kit.force_text(None) if force is None else SOURCES[force.source]
        self._still.text = "" if analysis is None or not analysis.still else analysis.still
        self._still.set_visibility(bool(self._still.text))
        kit.set_class(self._still, "good", analysis is not None and analysis.still == "settled")


class FlagList:
    """Flags of the press, with advice."""

    def __init__(self) -> None:
        self._list = kit.Redrawn(ui.element("ul").classes("flags").props('aria-label="Flags of this press"'))

    def show(self, state: InstrumentState) -> None:
        """Show the flags of the newest analysis; an unchanged list stays, so that screen readers do not repeat it."""
        result = flags(present(state))
        if self._list.changes_to(result):
            with self._list.element:
                for name, advice in result:
                    with ui.element("li"):
                        ui.label(name).classes("flag" if advice else "good")
                        kit.muted(advice)


def present(state: InstrumentState) -> FrameAnalysis | None:
    """The present analysis; None while the camera is stopped or away."""
    return state.frame_analysis if state.camera.running and not state.camera.lost else None


def flags(analysis: FrameAnalysis | None) -> tuple[tuple[str, str], ...]:
    """Names of the flags with their advice; one line without advice when there are none."""
    if analysis is None:
        return ()
    return tuple((flag.name, flag.advice) for flag in analysis.flags) or (("No flags.", ""),)


class Shortcut(NamedTuple):
    """A key as its event names it, what stands on it, what it does, and the event of `Keys` with its value."""

    key: str
    cap: str
    does: str
    event: str
    value: int | None = None


SHORTCUTS = (  # the page's keys and its help are made from these
    Shortcut(" ", "Space", "save a snapshot", "snapshot"),
    Shortcut("ArrowLeft", "←", "previous target", "step", -1),
    Shortcut("ArrowRight", "→", "next target", "step", 1),
    Shortcut("f", "F", "live image alone, and back", "alone"),
)


class Keys(Element, component="keys.js"):
    """Receives keys while the page has the focus outside its fields; F shows ``alone`` over the whole screen."""

    def __init__(
        self, *, snapshot: Callable[[], Awaitable[Any]], step: Callable[[int], Awaitable[Any]], alone: Element
    ) -> None:
        super().__init__()
        self._props["alone"] = alone.html_id
        self._props["keys"] = {item.key: [item.event, item.value] for item in SHORTCUTS}
        self.on("snapshot", lambda: snapshot())
        self.on("step", lambda event: step(1 if event.args == 1 else -1))


MAPS = ("grey", "cividis", "inferno", "viridis")
FULL_RANGE, AUTOMATIC, MANUAL = "full", "automatic", "manual"


class LivePanel:
    """The live image."""

    def __init__(self) -> None:
        self._map = FIRST_MAP
        self._range_ends: str | tuple[float, float] = (0.0, 255.0)
        self._surface: SurfaceView | None = None
        with ui.element("div").classes("panel live-panel") as self.single:
            self._tools()
            with ui.element("div").classes("live-pair") as self._pair:
                self.view = LiveView(map_name=FIRST_MAP)
                self._surface_container = ui.element("div").classes("surface-place")
            self._surface_container.set_visibility(False)
            self._camera = ui.label().classes("muted camera-line")
        with ui.element("div").classes("panel histogram-panel"):
            self.histogram = Histogram()

    def _tools(self) -> None:
        with ui.element("div").classes("row tools"):
            colours = kit.select_field(list(MAPS), value=FIRST_MAP, label="Colours", on_change=self._colour)
            ranges = {name: name for name in (FULL_RANGE, AUTOMATIC, MANUAL)}
            self._range = kit.select_field(ranges, value=FULL_RANGE, label="Range", on_change=self._ranged)
            for select in (colours, self._range):
                select.props("dense outlined").classes("colours")
            ui.switch("Freeze", value=False, on_change=lambda event: self.view.freeze(bool(event.value)))
            ui.switch("Clipping", value=False, on_change=lambda event: self.view.mark_limits(bool(event.value)))
            ui.switch("Contact", value=True, on_change=lambda event: self.view.overlay(bool(event.value)))
            ui.switch("3-D", value=False, on_change=self._three)
            ui.element("div").classes("spring")
            alone = ui.button(icon="fullscreen").props('flat dense round aria-label="Full screen"')
            # What F does too; in the browser, where only a click may fill the screen.
            alone.on("click", js_handler="() => document.dispatchEvent(new CustomEvent('tsis-alone'))")
        self._ends = ui.range(min=0, max=255, step=1, value={"min": 0, "max": 255}, on_change=self._ranged)
        self._ends.props('dense label aria-label="Grey levels of the colour range, of 255"')
        self._ends.set_visibility(False)

    def _ranged(self) -> None:
        by_hand = self._range.value == MANUAL
        self._ends.set_visibility(by_hand)
        low, high = self._ends.value["min"], self._ends.value["max"]
        ends: str | tuple[float, float] = "auto" if self._range.value == AUTOMATIC else (0.0, 255.0)
        if by_hand:
            ends = (low, max(high, low + 1)) if low < 255 else (254.0, 255.0)
        self._range_ends = ends
        self.view.ends(ends)
        if self._surface is not None:
            self._surface.ends(ends)

    def show(self, state: InstrumentState) -> None:
        """Show the camera's state; the frames come over their own connection."""
        self.view.update_state(state)
        self.histogram.update_state(state)
        if self._surface is not None:
            self._surface.update_state(state)
        self._camera.text = kit.camera_line(state)

    def _colour(self, event: ValueChangeEventArguments[str]) -> None:
        self._map = event.value
        self.view.colour(event.value)
        if self._surface is not None:
            self._surface.colour(event.value)

    def _three(self, event: ValueChangeEventArguments[bool | None]) -> None:
        self._surface_container.set_visibility(bool(event.value))
        kit.set_class(self._pair, "two", bool(event.value))
        self._surface_container.clear()
        self._surface = None
        if event.value:
            with self._surface_container:
                self._surface = SurfaceView(map_name=self._map, ends=self._range_ends)


def examine_page(instrument: Instrument, viewer: kit.Viewer) -> None:
    """Build the page."""
    latest: InstrumentState | None = None

    def saved(target: SavedTarget) -> None:
        order.saved(target)
        if latest is not None:
            show(latest)

    controls = kit.OperatorControls(viewer)
    with ui.element("div").classes("stack work-place"):
        order = WorkOrder(instrument, viewer, controls)
    with ui.element("div").classes("split examine"):
        with ui.element("section").classes("stack").props('aria-label="Live image"'):
            live = LivePanel()
        with ui.element("section").classes("stack").props('aria-label="Press, estimate and camera"'):
            with ui.element("div").classes("panel stack tight"):
                press = PressPanel(instrument, viewer, controls)
                with press.force_row:
                    force = ForceRow()
                tissue = TissueRow(instrument, viewer, controls)
                flags = FlagList()
                controls.why()
            with ui.element("div").classes("panel under-tabs"):
                with ui.tabs().props("dense no-caps align=left") as tabs:
                    reported, set_up, recorded = (ui.tab(name) for name in ("Estimate", "Settings", "Sequence"))
                with ui.tab_panels(tabs, value=reported).props("keep-alive").classes("plain-panels"):
                    with ui.tab_panel(reported):
                        estimate = EstimatePanel(instrument, viewer, saved)
                    with ui.tab_panel(set_up):
                        settings = SettingsPanel(instrument, viewer, controls)
                    with ui.tab_panel(recorded):
                        sequence = SequencePanel(instrument, viewer, controls)
    Keys(snapshot=press.snapshot, step=press.step, alone=live.single)

    def show(state: InstrumentState) -> None:
        nonlocal latest
        latest = state
        order.show(state)
        press.show(state, main=order.main)
        estimate.show(state, main=order.main)
        for part in (live, force, tissue, flags, settings, sequence, controls):
            part.show(state)

    viewer.follow(show)


TO_PRESS = ("calibration", "reference", "presses")  # steps for which a snapshot is the next thing


class PressPanel:
    """Controls of a press."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, controls: kit.OperatorControls) -> None:
        self._instrument, self._viewer, self._saving = instrument, viewer, False
        with ui.element("div").classes("row"):
            self._run = kit.RunButton(instrument, viewer)
            self._save = kit.button("Snapshot", self.snapshot, icon="photo_camera", look="unelevated")
            with ui.element("div").classes("stepper"):
                back = self._stepper("remove", "Previous target", -1)
                self._target = kit.NumberField(viewer, "Target", self._set_target)
                on = self._stepper("add", "Next target", 1)
        with ui.element("div").classes("row"):
            choice = ui.toggle({}, value=None).props("unelevated toggle-color=primary").classes("roles")
            choice.props('role=group aria-label="Pressed on"')
            self._role = kit.ChoiceField(viewer, choice, lambda role: instrument.hold(role=role, by=viewer.identity))
        with ui.element("div").classes("row") as self.force_row:
            self._force = kit.NumberField(
                viewer,
                "Force",
                self._hold,
                unit="N",
                emptied=lambda: instrument.forget_force(by=viewer.identity),
            )
        controls.add(self._run.element, self._save, back, on, self._target.element, choice, self._force.element)

    def show(self, state: InstrumentState, *, main: str) -> None:
        """Show the instrument's press; ``main`` as of `WorkOrder`."""
        self._run.show(state.camera, main=main == "camera")
        kit.set_filled(self._save, main in TO_PRESS)
        self._target.show(state.target)
        self._role.show(state.role, {role: ROLE_NAMES[role] for role in state.roles})
        self._force.show(state.force_n)

    async def snapshot(self) -> None:
        """Save the press; a second key during saving does nothing."""
        if self._saving:
            return
        self._saving = True
        try:
            press: SavedPress | None = await self._viewer.attempt(self._instrument.snapshot, by=self._viewer.identity)
        finally:
            self._saving = False
        if press is not None:
            self._viewer.notify(snapshot_text(press))

    async def step(self, by: int) -> None:
        """Go to the previous or the next target."""
        await self._viewer.attempt(self._instrument.step_target, by, by=self._viewer.identity)

    def _set_target(self, number: float) -> None:
        whole = require_integer("target", number, 1, LARGEST_TARGET, hint="number of the target")
        self._instrument.set_target(whole, by=self._viewer.identity)

    def _hold(self, force_n: float) -> None:
        with kit.field_messages(kit.FORCE):
            self._instrument.hold(force_n=force_n, by=self._viewer.identity)

    def _stepper(self, icon: str, label: str, by: int) -> ui.button:
        button = ui.button(icon=icon, on_click=lambda: self.step(by)).props("flat dense round")
        button.props["aria-label"] = label
        return button


def snapshot_text(saved: SavedPress) -> str:
    """Text of a snapshot."""
    press = saved.press
    against = f"; flagged {', '.join(press.flags)}" if press.flags else ""
    notes = "".join(f" {note}." for note in saved.notes)
    role, force = ROLE_NAMES[press.role], kit.force_text(press.force_n)
    return f"Saved for target {saved.target.number}: {role}, {force}{against}." + notes


SECONDS, FRAMES = "seconds", "frames"
FIRST_LENGTH = 10.0


class SequencePanel:
    """Begin and end a sequence."""

    def __init__(self, instrument: Instrument, viewer: kit.Viewer, controls: kit.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        with ui.element("div").classes("row"):
            self._length = kit.unit_field("Length", kit.number_text_of_field(FIRST_LENGTH)).classes("number-field")
            self._unit = ui.toggle({SECONDS: SECONDS, FRAMES: FRAMES}, value=SECONDS).props(
                "unelevated toggle-color=primary"
            )
            self._unit.props('role=group aria-label="Unit of the length"')
            self._begin = kit.button("Record", self._record, icon="fiber_manual_record")
            self._end = kit.button("Stop recording", viewer.command(instrument.end_sequence), icon="stop")
        self._bar = kit.ProgressBar("Progress of the sequence")
        self._message = kit.status("muted wordy")
        kit.muted("Every frame is saved unchanged in the workspace; the recording continues when this page is closed.")
        controls.add(self._length, self._unit, self._begin, self._end)

    def show(self, state: InstrumentState) -> None:
        """Show how far the sequence is."""
        sequence = state.sequence
        running = sequence is not None and sequence.running
        self._begin.set_visibility(not running)
        self._end.set_visibility(running)
        self._bar.show(sequence)
        self._message.text = sequence_text(sequence)

    async def _record(self) -> None:
        def begin() -> Job:
            length = kit.typed_number(str(self._unit.value), self._length.value)
            if self._unit.value == SECONDS:
                return self._instrument.begin_sequence(seconds=length, by=self._viewer.identity)
            frames = require_integer("frames", length, 1, MOST_SEQUENCE_FRAMES)
            return self._instrument.begin_sequence(frames=frames, by=self._viewer.identity)

        await kit.submit(self._viewer, {SECONDS: self._length, FRAMES: self._length}, begin)


def sequence_text(sequence: JobState | None) -> str:
    """How far a sequence is, or what came of it."""
    if sequence is None:
        return ""
    if sequence.running:
        fraction = f": {sequence.fraction:.0%}" if sequence.total else ""
        return f"Recording {sequence.title}" + fraction
    return f"{sequence.title.capitalize()}: {sequence.sentence}"
