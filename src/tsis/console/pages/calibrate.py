"""Calibrate: sessions of guided steps, and the calibration."""

from __future__ import annotations

import base64
from functools import partial
from typing import TYPE_CHECKING
from urllib.parse import quote

from nicegui import run, ui

from tsis.__about__ import LARGEST_SEED, VALID_DAYS
from tsis.calibration.file import read_calibration
from tsis.calibration.force_line import TIPS_MM
from tsis.calibration.frames import load_calibration
from tsis.calibration.session import SessionSetup
from tsis.catalog.probes import list_probes
from tsis.console import widgets
from tsis.console.files import GREY, thumbnail_png
from tsis.console.live.view import LiveView
from tsis.console.services.jobs import DONE, ENDED, FAILED
from tsis.errors import InputError, TsisError
from tsis.files.json_values import to_json_value
from tsis.model.require import require_integer
from tsis.present.calibration import calibration_page, content_rows
from tsis.present.labels import counted
from tsis.present.page import Table
from tsis.virtual.calibration_bench import bench_name

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Sequence
    from pathlib import Path

    from tsis.calibration.file import ProbeCalibration
    from tsis.calibration.session import CalibrationStep
    from tsis.console.services.calibrating import CalibrationResult, CalibrationSession, SessionSummary, StepState
    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import JobState
    from tsis.console.services.state import InstrumentState
    from tsis.console.viewer import Viewer
    from tsis.present.page import Page


SIZE_PX = 560  # of its longer side


class SavedFrame:
    """The frame in the middle of a step, in loadings near the largest force."""

    def __init__(self, viewer: Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self._shown: str | None = None
        with ui.element("figure").classes("calibrate-frame") as self._figure:
            self._image = ui.element("img")
            with ui.element("figcaption"):
                self._caption = widgets.muted()
        self._figure.set_visibility(False)

    async def show(self, state: StepState | None) -> None:
        """Show a frame of the step if it is done."""
        name = None if state is None or state.status != "done" else state.step.name
        if name == self._shown:
            return
        self._shown = name
        self._figure.set_visibility(False)
        if state is None or name is None:
            return
        result = await self._viewer.attempt(self._read, state.step)
        if result is None or self._shown != name:
            return
        content, caption = result
        self._caption.text = caption
        source = f"data:image/png;base64,{base64.b64encode(content).decode()}"
        widgets.show_drawing(self._image, source, f"Frame of step {name}")
        self._figure.set_visibility(True)

    def _read(self, step: CalibrationStep) -> tuple[bytes, str]:
        shot = self._session.folder.middle_shot(step)
        content = thumbnail_png(shot.image.grey, full_scale=shot.image.full_scale, size=SIZE_PX, name=GREY)
        force = "" if shot.force_n is None else f", at {shot.force_n:.2f} N"
        return content, f"A frame of {step.name}{force}; its mean grey level is {shot.image.grey.mean():.1f}."


class TypedLoading:
    """The field for the next force, and the table of those so far."""

    def __init__(
        self, viewer: Viewer, session: CalibrationSession, controls: widgets.OperatorControls, step: str
    ) -> None:
        self._viewer, self._session, self._step = viewer, session, step
        with ui.element("div").classes("stack"):
            widgets.muted("Start without contact, with the force that the gauge shows, usually 0.")
            with ui.element("div").classes("row"):
                self._force = widgets.unit_field("Force that the gauge shows", unit="N").props("autofocus")
                self._force.on("keydown.enter", self._press)
                take = widgets.button("Take a frame", self._press, icon="photo_camera", look="unelevated")
            self._table = widgets.Redrawn(ui.element("div").classes("calibrate-forces"))
            with ui.element("div").classes("row"):
                save = widgets.button(
                    "Back at 0 N: save the loading", viewer.command(session.save_presses, step), icon="check"
                )
                undo = widgets.button("Remove the last", viewer.command(session.unpress, step), icon="undo")
        controls.add(self._force, take, save, undo)

    def show(self, forces_n: Sequence[float]) -> None:
        """Show the forces so far."""
        if not self._table.changes_to(forces_n):
            return
        with self._table.element:
            widgets.muted(counted(len(forces_n), "frame") if forces_n else "No frame yet.")
            for force in forces_n:
                ui.label(f"{force:g} N").classes("chip")

    async def _press(self) -> None:
        text = str(self._force.value or "")

        def pressed() -> int:
            force = widgets.typed_number("force", text.replace(",", "."))
            return self._session.press(self._step, force, by=self._viewer.identity)

        if await widgets.submit(self._viewer, {"force": self._force}, pressed) is not None:
            self._force.set_value("")


class StepCard:
    """Shows the present step."""

    def __init__(self, viewer: Viewer, session: CalibrationSession, controls: widgets.OperatorControls) -> None:
        self._viewer, self._session, self._controls = viewer, session, controls
        self._container = widgets.Redrawn(ui.element("div").classes("stack"))
        self._bar = widgets.ProgressBar("Frames taken")
        self._text = widgets.status()
        self._typed: TypedLoading | None = None

    def show(self, steps: Sequence[StepState], present: str | None) -> None:
        """Show the step of that name; what to do next when there is none."""
        self._progress()
        number, state = next(
            ((index, step) for index, step in enumerate(steps, 1) if step.step.name == present), (0, None)
        )
        gauge = self._session.rig.has_gauge
        now = (present, None if state is None else state.status, gauge, len(steps))
        if self._container.changes_to(now):
            self._typed = None
            with self._container.element:
                self._build(state, number, len(steps))
        if self._typed is not None and state is not None:
            self._typed.show(state.forces_n)

    def _build(self, state: StepState | None, number: int, total: int) -> None:
        if state is None:
            widgets.panel_title("Every step is done or skipped.")
            widgets.muted("Make the calibration below, or choose a step to repeat it.")
            return
        step, session, command = state.step, self._session, self._viewer.command
        widgets.panel_title(f"Step {number} of {total}: {step.name}")
        ui.label(f"{step.instruction}.").classes("calibrate-instruction")
        if session.rig.by_itself and state.status != "done":
            widgets.muted("Instructions for an operator; the virtual rig does this step.")
        with ui.element("div").classes("row"):
            if state.status == "under way":
                self._under_way(state)
            elif state.status == "done":
                ui.label(f"Done: {state.frames} frames are saved.").classes("good")
                self._button("Repeat this step", "replay", lambda: self._repeat(step.name), look="outline")
            elif step.is_loading and not session.rig.has_gauge:
                self._typed = TypedLoading(self._viewer, session, self._controls, step.name)
            else:
                text = "Begin the loading" if step.is_loading else f"Take {step.frames} frames"
                self._button(text, "photo_camera", command(session.take, step.name))
            if step.optional and state.status == "open":
                self._button("Skip this step", "skip_next", command(session.leave_out, step.name), look="outline")

    def _under_way(self, state: StepState) -> None:
        session, command = self._session, self._viewer.command
        if state.step.is_loading and not session.rig.by_itself:
            ui.label("Load now, slowly, and back to 0.").classes("strong")
            self._button("Back at 0 N: save the loading", "check", command(session.end_loading))
        self._button("Cancel", "stop", command(session.end_step), look="outline")

    def _button(self, text: str, icon: str, act: Callable[[], Awaitable[object]], look: str = "unelevated") -> None:
        self._controls.add(widgets.button(text, act, icon=icon, look=look))

    def _progress(self) -> None:
        """How far the frames of a step are, and what became of the last step."""
        job = self._session.job
        state = None if job is None else job.state()
        self._bar.show(state)
        self._text.text = "" if state is None else frames_text(state)
        widgets.set_class(self._text, "doubtful", state is not None and state.status == FAILED)

    async def _repeat(self, name: str) -> None:
        question = f"Remove the frames of step {name!r} and take it again?"
        if await widgets.is_confirmed(
            question, yes="Remove and repeat", why="A calibration computed from them is set aside."
        ):
            await self._viewer.command(self._session.repeat, name)()


def frames_text(job: JobState) -> str:
    """Progress of a step's frames, or why they are not saved."""
    if job.running:
        counted = f"{job.done} of {job.total} frames"
        return counted if job.total else f"{job.done} frames"
    return "" if job.status == DONE else job.sentence


class CalibrationResultPanel:
    """Shows the calibration, also one from before the program's start; ``identity`` is empty without one."""

    def __init__(self, viewer: Viewer, session: CalibrationSession) -> None:
        self._viewer, self._session = viewer, session
        self.identity = ""
        panel = ui.element("section").classes("panel stack").props('aria-label="What was measured"')
        self._panel = widgets.Redrawn(panel.set_visibility(False))

    async def refresh(self, file: Path | None) -> None:
        """Show changes; ``file`` is the calibration's, None before it exists."""
        result = self._session.result
        if not self._panel.changes_to(file if result is None else result.identity):
            return
        self.identity = ""
        if result is not None:
            await self._show_result(result)
        elif file is not None:
            loaded = await self._viewer.attempt(load_calibration, file)
            if loaded is not None:
                self.identity = loaded.identity
                with self._panel.element:
                    calibration_content(loaded.calibration)
        self._panel.element.set_visibility(bool(self.identity))

    async def _show_result(self, result: CalibrationResult) -> None:
        provenance = {"session": str(self._session.folder.path), "terms": to_json_value(self._session.terms)}
        page = calibration_page(result.measured, result.findings, provenance=provenance, saved=result.saved)
        sources = await self._viewer.attempt(widgets.drawings, page)
        if sources is not None:
            self.identity = result.identity
            with self._panel.element:
                result_content(page, sources)


def result_content(page: Page, sources: Sequence[str]) -> None:
    """Cards, figures beside each other, notes, and tables beside each other."""
    widgets.cards(page.cards)
    with ui.element("div").classes("calibrate-figures"):
        ordered = sorted(zip(page.pictures, sources, strict=True), key=lambda item: item[0].wide)
        for picture, source in ordered:
            widgets.figure(picture, source)
    widgets.message_list(page.notes)
    with ui.element("div").classes("calibrate-tables"):
        for item in page.tables:
            widgets.table(item)


def calibration_content(calibration: ProbeCalibration) -> None:
    """Contents of the file of an earlier calibration."""
    widgets.muted("It was computed before. Compute it again from the same frames to see the residuals of its fits.")
    widgets.table(
        Table(title="Measured", columns=("quantity", "value", "95 % interval"), values=content_rows(calibration))
    )


class MakePanel:
    """Buttons that compute the calibration, activate it and download it."""

    def __init__(
        self, instrument: Instrument, viewer: Viewer, session: CalibrationSession, controls: widgets.OperatorControls
    ) -> None:
        self._instrument, self._viewer, self._session = instrument, viewer, session
        self._identity = ""
        with ui.element("section").classes("panel stack").props('aria-label="Calibration"'):
            with widgets.title_row("Calibration"):
                self._days = widgets.unit_field("Good for", str(VALID_DAYS), unit="days").classes("calibrate-days")
                self._make = widgets.button("Make the calibration", self._begin, icon="calculate", look="unelevated")
            self._bar = widgets.ProgressBar("Progress of the calibration")
            self._text = widgets.status()
            with ui.element("div").classes("row") as self._commands:
                self._use = controls.add(widgets.button("Activate", self._activate, icon="verified", look="unelevated"))
                self._active = ui.label("It is active.").classes("good")
                widgets.button("Download the file", self._download, icon="download")
                self._cited = widgets.muted()
        self._commands.set_visibility(False)

    def show(self, state: InstrumentState) -> None:
        """Say whether it is active."""
        active = bool(self._identity) and state.calibration_identity == self._identity
        self._active.set_visibility(active)
        self._use.set_visibility(not active)

    def refresh(self, steps: Sequence[StepState]) -> None:
        """Show what is missing, or how far it is."""
        lacking = [state.step.name for state in steps if state.status != "done" and not state.step.optional]
        self._make.set_enabled(not lacking and not self._session.busy)
        self._days.set_visibility(not lacking and self._session.terms.began is not None)
        job = None if self._session.making is None else self._session.making.state()
        self._bar.show(job)
        failed = job is not None and job.status in (FAILED, ENDED) and not lacking
        text = f"It needs these steps: {', '.join(lacking)}." if lacking else ""
        if job is not None and job.running:
            text = "Reading the frames and fitting."
        elif job is not None and failed:
            text = job.sentence
        self._text.text = text
        self._text.set_visibility(bool(text))
        widgets.set_class(self._text, "doubtful", failed)

    def cites(self, identity: str) -> None:
        """Set the identity of the calibration; empty without one."""
        self._identity = identity
        self._cited.text = f"cited as {identity[:12]}"
        self._commands.set_visibility(bool(identity))

    async def _begin(self) -> None:
        fields = {"days": self._days}
        await widgets.submit(
            self._viewer, fields, lambda: self._session.make(days=widgets.typed_number("days", self._days.value))
        )

    async def _activate(self) -> None:
        def activated() -> str:
            usable = load_calibration(self._file())
            self._instrument.use_calibration(usable, by=self._viewer.identity)
            return usable.calibration.name

        name = await self._viewer.attempt(activated)
        if name is not None:
            self._viewer.notify(f"Calibration {name} is active.")

    async def _download(self) -> None:
        def content() -> bytes:
            read_calibration(self._file())  # refuses one that was changed
            return self._file().read_bytes()

        document = await self._viewer.attempt(content)
        if document is not None:
            ui.download.content(document, f"calibration-{self._session.name}.json", "application/json")

    def _file(self) -> Path:
        file = self._session.file
        assert file is not None  # the buttons are there with it
        return file


LIST_EVERY_S, SESSION_EVERY_S = 2.0, 0.3  # between two readings


def calibrate_page(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page."""
    controls = widgets.OperatorControls(viewer)
    with ui.element("div").classes("split calibrate-choosing") as columns:
        with widgets.panel("Sessions", style="panel"):
            listed = widgets.Redrawn(ui.element("div").classes("stack"))
        with widgets.panel("Begin a calibration"):
            form = TermsForm(instrument, viewer, controls)
            controls.why()

    async def refresh() -> None:
        sessions = await run.io_bound(instrument.calibrating.listed)
        if sessions is not None and listed.changes_to(sessions):
            widgets.set_class(columns, "empty-first", not sessions)
            with listed.element:
                session_list(sessions)

    def show(state: InstrumentState) -> None:
        form.show(state)
        controls.show(state)

    viewer.every(LIST_EVERY_S, refresh)
    viewer.follow(show)


def session_list(sessions: Sequence[SessionSummary]) -> None:
    """Links to all sessions with their progress."""
    if not sessions:
        widgets.muted(
            "None yet. A calibration converts grey levels to newtons and pixels to millimetres. Begin one to be "
            "guided through its steps; it can be interrupted and resumed at any time."
        )
        return
    with ui.element("ul").classes("calibrate-sessions"):
        for item in sessions:
            with ui.element("li"), ui.element("div").classes("row"):
                if item.trouble:
                    ui.label(item.name).classes("strong")
                    ui.label(item.trouble).classes("doubtful")
                    continue
                ui.link(item.title or item.name, f"/calibrate/{quote(item.name)}").classes("strong").mark(
                    f"session {item.name}"
                )
                widgets.muted(f"{item.probe}, {item.camera}")
                ui.element("div").classes("spring")
                if item.made:
                    ui.label("calibration made").classes("good")
                else:
                    widgets.muted(f"{item.done} of {item.total} steps")


ICONS = {"open": "radio_button_unchecked", "under way": "hourglass_top", "done": "check_circle", "left out": "remove"}


class StepList:
    """Choice of a step, and a button that takes all steps of the virtual rig."""

    def __init__(
        self,
        viewer: Viewer,
        session: CalibrationSession,
        controls: widgets.OperatorControls,
        choose: Callable[[str], Awaitable[None]],
    ) -> None:
        self._choose = choose
        self._title = widgets.panel_title("Steps")
        self._list = widgets.Redrawn(ui.element("ol").classes("calibrate-steps"))
        take_all = widgets.button("Do all open steps", viewer.command(session.take_all), icon="fast_forward")
        self._all = controls.add(take_all.classes("calibrate-all"))
        self._automatic = session.rig.by_itself
        self._all.set_visibility(self._automatic)

    def show(self, steps: Sequence[StepState], present: str | None) -> None:
        """Show the progress of each step and mark the present one."""
        now = (present, *((state.step.name, state.status, status_text(state)) for state in steps))
        if not self._list.changes_to(now):
            return
        done = sum(state.status == "done" for state in steps)
        self._title.text = f"Steps: {done} of {len(steps)} done"
        self._all.set_visibility(self._automatic and any(state.status in ("open", "left out") for state in steps))
        with self._list.element:
            for state in steps:
                self._item(state, here=state.step.name == present)

    def _item(self, state: StepState, *, here: bool) -> None:
        name = state.step.name
        with ui.element("li"):
            label = f"Step {name}: {status_text(state)}"
            button = widgets.button("", partial(self._choose, name), look="flat", label=label)
            button.props("align=left").classes("calibrate-step here" if here else "calibrate-step")
            if here:
                button.props('aria-current="step"')
            with button:
                ui.icon(ICONS[state.status]).classes(state.status.replace(" ", "-"))
                ui.label(name).classes("calibrate-step-name")
                widgets.muted(status_text(state))


def status_text(state: StepState) -> str:
    """How far a step is."""
    if state.status == "done":
        return f"{state.frames} frames"
    if state.forces_n:
        return f"{len(state.forces_n)} forces, not saved"
    if state.status == "open" and state.step.optional:
        return "open, optional"
    return state.status


async def session_page(instrument: Instrument, viewer: Viewer, name: str) -> None:
    """Build the page of the session of that name."""
    place = ui.element("div").classes("stack")
    try:
        session: CalibrationSession | None = await run.io_bound(instrument.calibrating.open, name)
    except TsisError as error:
        with place, ui.element("section").classes("panel"):
            ui.label(str(error)).classes("doubtful")
            ui.link("All sessions", "/calibrate")
        return
    if session is None:  # the console is shutting down
        return
    with place:
        _Guide(instrument, viewer, session)


class _Guide:
    """The parts of a session's page, and the present step."""

    def __init__(self, instrument: Instrument, viewer: Viewer, session: CalibrationSession) -> None:
        self._session = session
        self._controls = widgets.OperatorControls(viewer)
        self._chosen: str | None = None
        self._steps: tuple[StepState, ...] = ()
        self._view: LiveView | None = None
        self._state: InstrumentState | None = None
        with ui.element("div").classes("row calibrate-head"):
            ui.link("Sessions", "/calibrate")
            widgets.panel_title(session.terms.name)
            widgets.muted(setup_text(session))
        with ui.element("div").classes("calibrate-guide"):
            with ui.element("section").classes("panel").props('aria-label="Steps"'):
                self._list = StepList(viewer, session, self._controls, self._choose)
            with ui.element("div").classes("stack"):
                with ui.element("section").classes("panel stack").props('aria-label="Present step"'):
                    self._card = StepCard(viewer, session, self._controls)
                    self._controls.why()
                    with ui.element("div").classes("calibrate-images"):
                        if not session.rig.by_itself:
                            with ui.element("div").classes("calibrate-live"):
                                self._view = LiveView(map_name="grey")
                        self._frame = SavedFrame(viewer, session)
                self._making = MakePanel(instrument, viewer, session, self._controls)
        self._result = CalibrationResultPanel(viewer, session)
        viewer.every(SESSION_EVERY_S, self._refresh)
        viewer.follow(self._show)

    def _show(self, state: InstrumentState) -> None:
        self._state = state
        self._controls.show(state)
        self._making.show(state)
        if self._view is not None:
            self._view.update_state(state)

    async def _refresh(self) -> None:
        session = self._session
        result = await run.io_bound(lambda: (session.steps(), session.file))
        if result is None:
            return
        self._steps, file = result
        await self._show_step()
        self._making.refresh(self._steps)
        if self._state is not None:
            self._controls.show(self._state)  # of controls that are newer than the state
        await self._result.refresh(file)
        self._making.cites(self._result.identity)

    async def _choose(self, name: str) -> None:
        self._chosen = name
        await self._show_step()

    async def _show_step(self) -> None:
        present = self._present()
        self._list.show(self._steps, present)
        self._card.show(self._steps, present)
        await self._frame.show(next((state for state in self._steps if state.step.name == present), None))

    def _present(self) -> str | None:
        """The step to show: the running one, else the chosen one, else the first open one."""
        under_way = next((state.step.name for state in self._steps if state.status == "under way"), None)
        if under_way is not None:
            self._chosen = None
            return under_way
        if self._chosen is not None:
            return self._chosen
        return next((state.step.name for state in self._steps if state.status == "open"), None)


def setup_text(session: CalibrationSession) -> str:
    """The terms in one line."""
    terms = session.terms
    tips = ", ".join(f"{tip:g}" for tip in terms.tips_mm)
    times = "" if terms.repeats == 1 else f", each {terms.repeats} times"
    return (
        f"{terms.probe}, {terms.camera}; dots every {terms.pitch_mm:g} mm, tips of {tips} mm{times}, "
        f"gauge to {100 * terms.gauge_share:g} %"
    )


LEAST_LOADINGS = 2  # of a force line: the lamps' drift hides in the slope of a single one
SIDES = 4  # of a patch: left, top, right, bottom
PROBE_TIPS_MM, PROBE_PADS_KPA = (
    (6.0, 10.0, 14.0),
    (5.0, 10.0),
)  # for the soft virtual probe, which sharper tips sink into


class TermsForm:
    """Asks for the terms and begins the session."""

    def __init__(self, instrument: Instrument, viewer: Viewer, controls: widgets.OperatorControls) -> None:
        self._instrument, self._viewer = instrument, viewer
        choice = instrument.camera_controller.choice
        self._virtual = choice.is_virtual
        tips, pads = (PROBE_TIPS_MM, PROBE_PADS_KPA) if self._virtual else (TIPS_MM, ())
        with ui.element("div").classes("stack"):
            self._with = widgets.muted()
            with ui.element("div").classes("calibrate-terms"):
                self._name = widgets.unit_field("Name", "bench", keys="text")
                self._probe = widgets.select_field(list(list_probes()), value=choice.probe, label="Probe")
                self._pitch = widgets.unit_field("Pitch of the dot board", "2.5", unit="mm")
                self._pitch_sd = widgets.unit_field("Its standard uncertainty", "0", unit="mm")
                self._tips = widgets.unit_field("Radii of the tips", _listed(tips), unit="mm", keys="text")
                self._pads = widgets.unit_field("Moduli of the soft pads", _listed(pads), unit="kPa", keys="text")
                self._pads.props('hint="they measure the light on dents; without pads estimates on tissue are wide"')
                self._repeats = widgets.unit_field("Loadings of each tip", "1")
                self._gauge_uncertainty = widgets.unit_field("Relative uncertainty of the gauge", "0.001")
                self._seed = widgets.unit_field("Seed of the virtual rig", str(choice.seed), keys="numeric")
                self._patch = widgets.unit_field("Lamps seen past the probe", unit="pixels", keys="text")
                self._patch.props('hint="left, top, right, bottom; empty where they are seen nowhere" ')
            self._fields = {
                "name": self._name,
                "pitch_mm": self._pitch,
                "pitch_sd_mm": self._pitch_sd,
                "tips_mm": self._tips,
                "tip_radius_mm": self._tips,
                "pads_kpa": self._pads,
                "pad_kpa": self._pads,
                "loadings of each tip": self._repeats,
                "gauge_share": self._gauge_uncertainty,
                "seed": self._seed,
                "lamps seen past the probe": self._patch,
                "patch_px": self._patch,
            }
            with ui.element("div").classes("row"):
                self._button = widgets.button("Begin", self._begin, icon="play_arrow", look="unelevated")
        controls.add(self._button)

    def show(self, state: InstrumentState) -> None:
        """Ask for what the present camera needs."""
        self._virtual = state.camera.choice.is_virtual
        self._seed.set_visibility(self._virtual)
        self._patch.set_visibility(not self._virtual)
        if self._virtual:
            self._with.text = "With the virtual rig, one click per step. It calibrates the virtual probe of this seed."
        elif state.camera.running:
            self._with.text = f"With {state.camera.name}, at its present settings."
        else:
            self._with.text = "With the chosen camera. Start it first: the session stores its settings."

    async def _begin(self) -> None:
        session = await widgets.submit(self._viewer, self._fields, self._begun)
        if session is not None:
            ui.navigate.to(f"/calibrate/{quote(session.name)}")

    def _begun(self) -> CalibrationSession:
        return self._instrument.calibrating.begin(self._terms(), by=self._viewer.identity)

    def _terms(self) -> SessionSetup:
        tips = widgets.typed_numbers("tips_mm", self._tips.value)
        repeats = widgets.typed_integer("loadings of each tip", self._repeats.value, 1, 20)
        if len(tips) * repeats < LEAST_LOADINGS:
            raise InputError(
                f"a calibration needs at least {LEAST_LOADINGS} loadings, of two tips or of one twice; got {len(tips)} "
                f"tip and {repeats} loading of it (add a tip, or load it twice)",
                name="tips_mm",
            )
        seed = widgets.typed_integer("seed", self._seed.value, 0, LARGEST_SEED)
        name = (self._name.value or "").strip()
        if not name:
            requirement = "must be given: what the calibration will be called"
            raise InputError(name="name", requirement=requirement, value="none")
        return SessionSetup(
            name=name,
            probe=self._probe.value or "",
            camera=bench_name(seed) if self._virtual else self._instrument.camera_controller.name or "camera",
            pitch_mm=widgets.typed_number("pitch_mm", self._pitch.value),
            pitch_sd_mm=widgets.typed_number("pitch_sd_mm", self._pitch_sd.value),
            gauge_share=widgets.typed_number("gauge_share", self._gauge_uncertainty.value),
            patch_px=None if self._virtual else typed_patch(self._patch.value or ""),
            tips_mm=tips,
            repeats=repeats,
            pads_kpa=widgets.typed_numbers("pads_kpa", self._pads.value),
        )


def _listed(numbers: Sequence[float]) -> str:
    return ", ".join(widgets.number_text_of_field(number) for number in numbers)


def typed_patch(text: str) -> tuple[int, int, int, int] | None:
    """Left, top, right and bottom of a patch; None where nothing was typed.

    Examples
    --------
    >>> typed_patch("4, 4, 36, 36"), typed_patch(" ")
    ((4, 4, 36, 36), None)
    """
    if not text.strip():
        return None
    sides = widgets.typed_numbers("lamps seen past the probe", text)
    if len(sides) != SIDES:
        requirement = "must be left, top, right, bottom in pixels"
        raise InputError(name="lamps seen past the probe", requirement=requirement, value=f"{text!r:.60}")
    left, top, right, bottom = (require_integer("lamps seen past the probe", side, 0, 100_000) for side in sides)
    return left, top, right, bottom
