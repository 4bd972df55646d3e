"""Design: what a probe and its presses would tell, before they are built."""

from __future__ import annotations

import asyncio
import re
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, TypeVar

from nicegui import background_tasks, ui

from tsis.catalog.probes import list_probes, load_probe, probe_toml
from tsis.console import widgets
from tsis.console.messages import FORCE, field_messages, labelled, plain_message
from tsis.console.services.jobs import DONE, JobCancelled
from tsis.errors import InputError
from tsis.files.canonical_json import json_bytes
from tsis.inclusion.design.protocol import MOST_FRAMES_PER_PRESS
from tsis.inclusion.design.search import MOST_EVALUATIONS
from tsis.model.probe import Layer, Led, Probe
from tsis.present.design import design_document, design_page
from tsis.present.figures import probe_section
from tsis.present.page import Picture, address
from tsis.virtual.planned_probe import QUICK_DEGREES, DesignQuestion, analyse_designs, compared_designs, searched_design

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from matplotlib.figure import Figure
    from nicegui.events import ValueChangeEventArguments

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import Job
    from tsis.console.viewer import Viewer
    from tsis.present.page import Page
    from tsis.virtual.planned_probe import DesignAnalysis


class FieldMessages:
    """Messages about the fields of a group."""

    def __init__(self) -> None:
        self._messages: dict[str, str] = {}
        self._list = widgets.Redrawn(ui.element("div").classes("faults").props('role="status"'))

    def say(self, field: str, message: str) -> None:
        """Set the message of a field; an empty one removes it."""
        self._messages[field] = message
        messages = dict.fromkeys(filter(None, self._messages.values()))
        if self._list.changes_to(tuple(messages)):
            with self._list.element:
                for item in messages:
                    ui.label(item)


def typed_field(
    label: str,
    text: str,
    take: Callable[[str], None],
    fault: Callable[[], str],
    messages: FieldMessages,
    *,
    shown: bool = True,
    empty: str = "",
) -> None:
    """A field for a number.

    ``take`` receives the typed text, and ``fault`` then returns its error, which ``messages`` shows; ``empty`` is the
    value of an empty field. A label that is not ``shown`` is for screen readers only.
    """

    def validate(typed: str | None) -> str | None:
        take(typed or "")
        wrong = fault()
        messages.say(label, wrong)
        element.props["aria-invalid"] = "true" if wrong else "false"
        return wrong or None

    element = ui.input(label if shown else None, value=text, validation=validate)
    element.props("dense outlined hide-bottom-space inputmode=decimal no-error-icon autocomplete=off debounce=150")
    if empty:
        element.props("stack-label").props["placeholder"] = empty
    if not shown:
        element.props["aria-label"] = label
    widgets.explain(element, label.rpartition(", ")[2])
    element.validate()  # a draft that came back with the tab may be wrong


LAYER = {"thickness_mm": "thickness", "young_kpa": "modulus", "poisson": "Poisson's ratio", "refractive_index": "index"}
LAMP = {"height_mm": "height", "aim_deg": "aim", "half_angle_deg": "half-angle"}
DOME = "radius of the dome"
LABELS = {**LAYER, **LAMP, "radius_mm": "radius", "face_curvature_mm": DOME}
MOST_LAYERS, MOST_LAMPS = 12, 36
ANY_LAYER = {"thickness_mm": 1.0, "young_kpa": 1.0, "poisson": 0.4, "refractive_index": 1.4}
NEW_LAYER = {"thickness_mm": "2", "young_kpa": "50", "poisson": "0.49", "refractive_index": "1.41"}


@dataclass(slots=True)
class ProbeDraft:
    """Contents of the probe's fields, filled from the probe ``start`` of the catalog."""

    start: Probe
    radius_mm: str = ""
    domed: bool = False
    curvature_mm: str = ""
    layers: list[dict[str, str]] = field(default_factory=list)
    lamps: str = ""
    lamp: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        probe, led = self.start, self.start.leds[0]
        self.radius_mm = widgets.number_text_of_field(probe.radius_mm)
        self.domed = probe.face_curvature_mm is not None
        self.curvature_mm = widgets.number_text_of_field(probe.face_curvature_mm or 40.0)
        self.layers = [
            {name: widgets.number_text_of_field(getattr(layer, name)) for name in LAYER} for layer in probe.layers
        ]
        self.lamps = str(len(probe.leds))
        self.lamp = {
            "height_mm": widgets.number_text_of_field(probe.led_height_mm(led)),
            "aim_deg": widgets.number_text_of_field(led.aim_deg),
            "half_angle_deg": widgets.number_text_of_field(led.half_angle_deg),
        }

    def probe(self) -> Probe:
        """The probe of the fields; the catalog's probe when nothing was changed. `InputError` for an invalid field."""
        with field_messages(LABELS):
            created = replace(
                self.start,
                radius_mm=widgets.typed_number("radius", self.radius_mm),
                face_curvature_mm=widgets.typed_number(DOME, self.curvature_mm) if self.domed else None,
                layers=tuple(
                    Layer(**{name: widgets.typed_number(text, texts[name]) for name, text in LAYER.items()})
                    for texts in self.layers
                ),
                leds=self._leds(),
            )
        return self.start if created == self.start else replace(created, name=f"{self.start.name} (changed)")

    def _leds(self) -> tuple[Led, ...]:
        """The lamps as typed, at equal angles; those of the start when nothing was changed."""
        before = ProbeDraft(self.start)
        if (self.lamps, self.lamp) == (before.lamps, before.lamp):
            return self.start.leds
        count = widgets.typed_number("lamps", self.lamps)
        if not count.is_integer() or not 1 <= count <= MOST_LAMPS:
            requirement = f"must be a whole number in [1, {MOST_LAMPS}]"
            raise InputError(name="lamps", requirement=requirement, value=self.lamps.strip())
        values = {name: widgets.typed_number(text, self.lamp[name]) for name, text in LAMP.items()}
        first = self.start.leds[0]
        return tuple(replace(first, azimuth_deg=360.0 * number / count, **values) for number in range(int(count)))

    def layer_fault(self, texts: Mapping[str, str], name: str) -> str:
        """Error of a field of a layer; empty without one."""
        return draft_message(lambda: Layer(**{**ANY_LAYER, name: widgets.typed_number(LAYER[name], texts[name])}))

    def lamp_fault(self, name: str) -> str:
        """Error of a field of the lamps; empty without one."""
        if name == "lamps":
            return draft_message(partial(widgets.typed_number, "lamps", self.lamps)) or draft_message(self._leds)
        return draft_message(lambda: Led(**{name: widgets.typed_number(LAMP[name], self.lamp[name])}))

    def face_fault(self, name: str) -> str:
        """Error of ``"radius_mm"`` or ``"curvature_mm"``; empty without one."""
        thick = Probe(radius_mm=5.0, layers=(Layer(thickness_mm=200.0, young_kpa=50.0),))  # under any dome
        wrong = draft_message(lambda: replace(thick, radius_mm=widgets.typed_number("radius", self.radius_mm)))
        if name == "radius_mm":
            return wrong
        curvature = partial(widgets.typed_number, DOME, self.curvature_mm)
        if wrong or not self.domed:
            return draft_message(curvature) if self.domed else ""
        radius = widgets.typed_number("radius", self.radius_mm)
        return draft_message(lambda: replace(thick, radius_mm=radius, face_curvature_mm=curvature()))

    def field_faults(self) -> Iterator[str]:
        """Errors of the single fields; empty without one."""
        yield from (self.layer_fault(texts, name) for texts in self.layers for name in LAYER)
        yield from (self.lamp_fault(name) for name in ("lamps", *LAMP))
        yield from (self.face_fault(name) for name in ("radius_mm", "curvature_mm"))

    def fault(self) -> str:
        """Error of the whole probe; empty without one."""
        return draft_message(self.probe)


def draft_message(make: Callable[[], object]) -> str:
    """Error of a construction with the page's labels; empty without one."""
    try:
        make()
    except InputError as error:
        return plain_message(labelled(error, LABELS))
    return ""


COMPARED = {
    "softness": "softer and stiffer layers",
    "layers": "one modulus; layers in reverse",
    "dome": "flat face, other domes",
    "forces": "other forces",
    "frames": "more frames of each press",
    "reference": "with and without a reference",
}
CRITERIA = {"all": "all three together", "diameter_mm": "diameter", "depth_mm": "depth", "young_kpa": "modulus"}
MOST_FORCES = 8


@dataclass(slots=True)
class QuestionDraft:
    """Contents of the fields of presses and question."""

    forces: str = ""
    frames: str = "1"
    with_reference: bool = True
    compared: set[str] = field(default_factory=lambda: set(QUICK_DEGREES))
    criterion: str = "all"
    traced: bool = False
    search: bool = False
    evaluations: str = str(MOST_EVALUATIONS)

    def question(self, probe: Probe) -> DesignQuestion:
        """The question about a probe; `InputError` for an invalid field."""
        with field_messages(FORCE):
            return DesignQuestion(
                probe=probe,
                forces_n=widgets.typed_forces(self.forces, most=MOST_FORCES),
                with_reference=self.with_reference,
                frames_per_press=widgets.typed_integer("frames", self.frames, 1, MOST_FRAMES_PER_PRESS),
                compared=tuple(aspect for aspect in COMPARED if aspect in self.compared),
                criterion=self.criterion,
                traced=self.traced,
                evaluations=widgets.typed_integer("stacks to try", self.evaluations, 1, MOST_EVALUATIONS)
                if self.search
                else None,
            )


FIRST = "tsis-domed"


@dataclass(slots=True)
class ProbeEditor:
    """Drafts, and the newest job that analyses them."""

    probe: ProbeDraft = field(default_factory=lambda: ProbeDraft(load_probe(FIRST)))
    question: QuestionDraft = field(default_factory=QuestionDraft)
    job: Job | None = None


class QuestionForm:
    """Presses, comparisons and criterion."""

    def __init__(self, editor: ProbeEditor) -> None:
        self._editor, draft = editor, editor.question
        widgets.panel_title("Presses")
        self._presses(draft)
        widgets.panel_title("Compare with", level=3).classes("below")
        with ui.element("div").classes("choices"):
            for aspect, text in COMPARED.items():
                ui.checkbox(text, value=aspect in draft.compared, on_change=partial(self._compare, aspect)).props(
                    "dense"
                )
        widgets.panel_title("Judge by", level=3).classes("below")
        with ui.element("div").classes("fields"):
            widgets.select_field(CRITERIA, value=draft.criterion, label="The expected error of").props(
                "options-dense"
            ).bind_value_to(draft, "criterion")
            ui.switch("Ray-trace the light of the lamps", value=draft.traced).props("dense").bind_value_to(
                draft, "traced"
            )
        with ui.element("div").classes("fields"):
            search = ui.switch("Search for better layers and forces (takes minutes)", value=draft.search).props("dense")
            search.bind_value_to(draft, "search")
            tries = ui.element("div")
        messages = FieldMessages()
        with tries:
            typed_field(
                "Stacks to try",
                draft.evaluations,
                partial(setattr, draft, "evaluations"),
                lambda: self._fault(QuestionDraft(evaluations=draft.evaluations, search=True)),
                messages,
            )
        tries.bind_visibility_from(draft, "search")

    def _presses(self, draft: QuestionDraft) -> None:
        fields = ui.element("div").classes("fields")
        messages = FieldMessages()
        with fields:
            typed_field(
                "Forces / N",
                draft.forces,
                partial(setattr, draft, "forces"),
                lambda: self._fault(QuestionDraft(forces=draft.forces)),
                messages,
                empty="1; on a dome 0.5, 1",
            )
            typed_field(
                "Frames of each",
                draft.frames,
                partial(setattr, draft, "frames"),
                lambda: self._fault(QuestionDraft(frames=draft.frames)),
                messages,
            )
            ui.switch("Include reference presses", value=draft.with_reference).props("dense").bind_value_to(
                draft, "with_reference"
            )

    def _fault(self, candidate: QuestionDraft) -> str:
        """Error of one field, with defaults for the others."""
        return draft_message(lambda: candidate.question(self._editor.probe.start))

    def _compare(self, aspect: str, event: ValueChangeEventArguments[bool]) -> None:
        if event.value:
            self._editor.question.compared.add(aspect)
        else:
            self._editor.question.compared.discard(aspect)


HEADINGS = ("Layer", "Thickness / mm", "Modulus / kPa", "Poisson", "Index", "Order")


class LayerTable:
    """One row per layer, with buttons that move, remove and add layers."""

    def __init__(self, draft: ProbeDraft, changed: Callable[[], object]) -> None:
        self._draft, self._changed = draft, changed
        self._container = ui.element("div").classes("stack")
        self._fill()

    def _fill(self) -> None:
        self._container.clear()
        layers = self._draft.layers
        with self._container:
            body = widgets.rows_under(HEADINGS, label="Layers, from the tissue up", style="layers")
            messages = FieldMessages()
            with body:
                for at in range(len(layers)):
                    self._row(at, messages)
            if len(layers) < MOST_LAYERS:
                add = partial(self._change, lambda: layers.append(dict(NEW_LAYER)))
                widgets.button("Add a layer at the glass", add, icon="add", look="flat dense")

    def _row(self, at: int, messages: FieldMessages) -> None:
        texts, number = self._draft.layers[at], at + 1
        with ui.element("tr"):
            widgets.cell(str(number))
            for name, text in LAYER.items():
                with ui.element("td"):
                    typed_field(
                        f"Layer {number}, {text}",
                        texts[name],
                        partial(self._typed, texts, name),
                        partial(self._fault, number, texts, name),
                        messages,
                        shown=False,
                    )
            with ui.element("td").classes("order"):
                last = len(self._draft.layers) - 1
                up, down = partial(self._move, at, -1), partial(self._move, at, 1)
                self._button("arrow_upward", f"Move layer {number} to the tissue", at > 0, up)
                self._button("arrow_downward", f"Move layer {number} to the glass", at < last, down)
                self._button("delete", f"Take layer {number} out", last > 0, partial(self._draft.layers.pop, at))

    def _button(self, icon: str, label: str, useful: bool, change: Callable[[], object]) -> None:
        button = ui.button(icon=icon, on_click=lambda: self._change(change)).props("dense flat round size=sm")
        button.props["aria-label"] = label
        button.set_enabled(useful)

    def _fault(self, number: int, texts: dict[str, str], name: str) -> str:
        wrong = self._draft.layer_fault(texts, name)
        return wrong and f"Layer {number}: {wrong}"

    def _typed(self, texts: dict[str, str], name: str, text: str) -> None:
        texts[name] = text
        self._changed()

    def _move(self, at: int, by: int) -> None:
        layers = self._draft.layers
        layers[at], layers[at + by] = layers[at + by], layers[at]

    def _change(self, change: Callable[[], object]) -> None:
        change()
        self._fill()
        self._changed()


LAMP_LABELS = {"height_mm": "Height / mm", "aim_deg": "Aim / °", "half_angle_deg": "Half-angle / °"}


class ProbeForm:
    """All fields of the probe, filled from a probe of the catalog."""

    def __init__(self, editor: ProbeEditor, changed: Callable[[], object]) -> None:
        self._editor, self._changed = editor, changed
        widgets.panel_title("Probe")
        widgets.select_field(
            list(list_probes()), value=editor.probe.start.name, label="Start from", on_change=self._start
        ).props("options-dense").classes("start")
        self._container = ui.element("div").classes("stack")
        self._fill()

    def _start(self, event: ValueChangeEventArguments[str]) -> None:
        self._editor.probe = ProbeDraft(load_probe(event.value))
        self._fill()
        self._changed()

    def _fill(self) -> None:
        self._container.clear()
        with self._container:
            self._face()
            widgets.panel_title("Layers, from the tissue up", level=3)
            LayerTable(self._editor.probe, self._changed)
            self._lamps()

    def _face(self) -> None:
        draft = self._editor.probe

        def domed(event: ValueChangeEventArguments[bool | None]) -> None:
            draft.domed = bool(event.value)
            self._fill()
            self._changed()

        widgets.panel_title("Face", level=3)
        fields = ui.element("div").classes("fields")
        messages = FieldMessages()
        with fields:
            radius = partial(self._set, "radius_mm")
            typed_field("Radius / mm", draft.radius_mm, radius, partial(draft.face_fault, "radius_mm"), messages)
            ui.switch("Domed", value=draft.domed, on_change=domed).props("dense")
            if draft.domed:
                curvature, fault = partial(self._set, "curvature_mm"), partial(draft.face_fault, "curvature_mm")
                typed_field("Radius of the dome / mm", draft.curvature_mm, curvature, fault, messages)

    def _set(self, name: str, text: str) -> None:
        setattr(self._editor.probe, name, text)
        self._changed()

    def _lamps(self) -> None:
        draft = self._editor.probe

        def lamp(name: str, text: str) -> None:
            draft.lamp[name] = text
            self._changed()

        widgets.panel_title("Lamps around the side", level=3)
        fields = ui.element("div").classes("fields four")
        messages = FieldMessages()
        with fields:
            lamps = partial(self._set, "lamps")
            typed_field("How many", draft.lamps, lamps, partial(draft.lamp_fault, "lamps"), messages)
            for name, label in LAMP_LABELS.items():
                typed_field(label, draft.lamp[name], partial(lamp, name), partial(draft.lamp_fault, name), messages)


EMPTY = "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 24 12'/%3E"
WIDE_IN, LABELS_IN = 6.0, 0.65  # of the picture; of the labels beside and below its axes
LEAST_IN, MOST_IN = 1.8, 4.5  # of its height


class Section:
    """The probe from the side; with a wrong field its message and the last valid probe."""

    def __init__(self, editor: ProbeEditor, viewer: Viewer) -> None:
        self._editor, self._viewer = editor, viewer
        self._requested = 0
        widgets.panel_title("Side view")
        with ui.element("div").classes("section"):
            self._picture = widgets.drawing()
            widgets.show_drawing(self._picture, EMPTY, "the probe, not yet drawn")
        self._fault = ui.label().classes("doubtful").props('role="status"')

    async def draw(self) -> None:
        """Draw the probe as it is now; of several changes at once the last one is drawn."""
        self._requested += 1
        turn = self._requested
        await asyncio.sleep(0)
        if turn != self._requested:  # each field of a page that opens asks for it
            return
        try:
            probe = self._editor.probe.probe()
        except InputError as error:
            beside = any(self._editor.probe.field_faults())  # which has its own message
            self._fault.text = "Not drawn while a field is invalid." if beside else f"Not drawn: {plain_message(error)}"
            return
        self._fault.text = ""
        source = await self._viewer.attempt(address, picture_of(probe))
        gone = self._picture.is_deleted or turn != self._requested  # what was typed meanwhile is drawn by who typed it
        if source is not None and not gone:
            widgets.show_drawing(self._picture, source, described(probe))


def picture_of(probe: Probe) -> Picture:
    """The probe's section as a picture."""
    span, up = 2 * probe.radius_mm + 4.8, probe.thickness_mm + probe.glass.thickness_mm + 2  # as they are drawn
    height = min(max((WIDE_IN - LABELS_IN) * up / span + LABELS_IN, LEAST_IN), MOST_IN)
    return Picture(title="", draw=partial(_draw, probe), size=(WIDE_IN, height), alt=described(probe))


def described(probe: Probe) -> str:
    """The probe as text."""
    layers = ", ".join(f"{layer.thickness_mm:g} mm of {layer.young_kpa:g} kPa" for layer in probe.layers)
    face = "flat" if probe.face_curvature_mm is None else f"domed by {probe.face_curvature_mm:g} mm"
    return (
        f"Section of the probe: face of {2 * probe.radius_mm:g} mm, {face}; from the tissue up {layers}, glass; "
        f"{len(probe.leds)} lamps"
    )


def _draw(probe: Probe, figure: Figure) -> None:
    probe_section(probe, figure.subplots())


EVERY_S = 0.4  # between two readings of the job
Draft = TypeVar("Draft")
FIRST_PRESS = "The first press of a new probe takes a while."
SCROLL = 'getHtmlElement({}).scrollIntoView({{behavior: "smooth", block: "start"}})'


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class DesignResult:
    """An analysis, and its page with drawn pictures."""

    analysis: DesignAnalysis
    page: Page
    pictures: tuple[str, ...]


def analysis_of(question: DesignQuestion) -> Callable[[Job], DesignResult]:
    """The work of a job that answers a question; a cancelled search leaves the comparisons before it."""

    def work(job: Job) -> DesignResult:
        result = compared_designs(question, progress=job.advance)
        job.report(0, question.evaluations or 0)
        try:
            optimum = searched_design(question, progress=job.advance)
        except JobCancelled:
            optimum = None
            job.say("The search was cancelled; these designs were compared before it.")
        analysis = analyse_designs(question, result, optimum)
        page = design_page(analysis)
        return DesignResult(analysis=analysis, page=page, pictures=widgets.drawings(page))

    return work


class DesignResultPanel:
    """Button, progress and result."""

    def __init__(self, instrument: Instrument, viewer: Viewer, editor: ProbeEditor) -> None:
        self._instrument, self._viewer, self._editor = instrument, viewer, editor
        self._shown: Job | None = None
        self._begun_here = False
        with ui.element("div").classes("row below"):
            self._start = widgets.button("Predict performance", self._started, look="unelevated")
            ui.element("div").classes("spring")
            widgets.button("Save the probe", self._save_probe, look="flat dense")
        self._job = widgets.JobLine("Progress of the designs", self._ended)

    def result_container(self) -> None:
        """Place the result here."""
        self._result = ui.element("section").classes("panel stack design-answer").props('aria-label="Answer"')
        self._result.set_visibility(False)
        ui.timer(EVERY_S, self._refresh)

    def _started(self) -> None:
        if self._editor.job is not None and self._editor.job.state().running:
            return
        if (question := self._valid(lambda: self._editor.question.question(self._editor.probe.probe()))) is None:
            return
        self._editor.job = self._instrument.jobs.begin(
            f"performance of {question.planned.described}", analysis_of(question)
        )
        self._refresh()

    def _ended(self) -> None:
        if self._editor.job is not None:
            self._editor.job.end()

    def _refresh(self) -> None:
        job = self._editor.job
        state = None if job is None else job.state()
        solved = f"{state.done} of {state.total} solved" if state is not None and state.done else FIRST_PRESS
        running = self._job.show(state, solved)
        self._start.set_enabled(not running)
        self._begun_here = self._begun_here or running
        if job is not None and state is not None and not running and job is not self._shown:
            self._shown = job
            if state.status == DONE:
                self._show(job.result)
                if self._begun_here:
                    self._result.client.run_javascript(SCROLL.format(self._result.id))

    def _show(self, result: DesignResult) -> None:
        self._result.clear()
        self._result.set_visibility(True)
        with self._result:
            with widgets.title_row(f"{result.page.title}: {result.page.subtitle}"):
                widgets.button("Save the result", lambda: self._save(result.analysis), look="flat dense")
            widgets.report_parts(result.page, result.pictures)

    def _save(self, analysis: DesignAnalysis) -> None:
        ui.download.content(json_bytes(design_document(analysis)), "design.json", "application/json")

    def _save_probe(self) -> None:
        if (probe := self._valid(self._editor.probe.probe)) is not None:
            ui.download.content(probe_toml(probe).encode(), f"{file_name(probe.name)}.toml", "application/toml")

    def _valid(self, read: Callable[[], Draft]) -> Draft | None:
        """What the fields say; None, and a message, when one is wrong."""
        try:
            return read()
        except InputError as error:
            self._viewer.complain(plain_message(error))
            return None


def file_name(name: str) -> str:
    """A name of a probe as one of a file.

    Examples
    --------
    >>> file_name("tsis-2011 (changed)")
    'tsis-2011-changed'
    """
    return re.sub(r"[^A-Za-z0-9_]+", "-", name).strip("-") or "probe"


WHAT = "No camera is needed: the model predicts how well diameter, depth and modulus of inclusions could be estimated."


async def design_tab(instrument: Instrument, viewer: Viewer) -> None:
    """Build the page with this tab's draft."""
    await ui.context.client.connected()
    editor = viewer.saved(ProbeEditor)
    with ui.element("div").classes("design"):
        probe_panel = ui.element("section").classes("panel")
        with ui.element("div").classes("stack"):
            with ui.element("section").classes("panel"):
                section = Section(editor, viewer)
            with ui.element("section").classes("panel"):
                QuestionForm(editor)
                reporting = DesignResultPanel(instrument, viewer, editor)
        with probe_panel:
            ProbeForm(editor, lambda: background_tasks.create(section.draw(), name="section of the probe"))
            ui.label(WHAT).classes("muted below")
    reporting.result_container()
    ui.timer(0.0, section.draw, once=True)  # the page does not wait for its picture
