"""The fields of a probe and of the question about it."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.catalog.probes import list_probes, load_probe
from tsis.console.pages import components as kit
from tsis.console.pages.design._draft import (
    COMPARED,
    CRITERIA,
    LAYER,
    MOST_LAYERS,
    NEW_LAYER,
    FieldMessages,
    ProbeDraft,
    QuestionDraft,
    draft_message,
    typed_field,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from nicegui.events import ValueChangeEventArguments

    from tsis.console.pages.design._draft import ProbeEditor


class QuestionForm:
    """Presses, comparisons and criterion."""

    def __init__(self, editor: ProbeEditor) -> None:
        self._editor, draft = editor, editor.question
        kit.panel_title("Presses")
        self._presses(draft)
        kit.panel_title("Compare with", level=3).classes("below")
        with ui.element("div").classes("choices"):
            for aspect, text in COMPARED.items():
                ui.checkbox(text, value=aspect in draft.compared, on_change=partial(self._compare, aspect)).props(
                    "dense"
                )
        kit.panel_title("Judge by", level=3).classes("below")
        with ui.element("div").classes("fields"):
            kit.select_field(CRITERIA, value=draft.criterion, label="The expected error of").props(
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
            body = kit.rows_under(HEADINGS, label="Layers, from the tissue up", style="layers")
            messages = FieldMessages()
            with body:
                for at in range(len(layers)):
                    self._row(at, messages)
            if len(layers) < MOST_LAYERS:
                add = partial(self._change, lambda: layers.append(dict(NEW_LAYER)))
                kit.button("Add a layer at the glass", add, icon="add", look="flat dense")

    def _row(self, at: int, messages: FieldMessages) -> None:
        texts, number = self._draft.layers[at], at + 1
        with ui.element("tr"):
            kit.cell(str(number))
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
        kit.panel_title("Probe")
        kit.select_field(
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
            kit.panel_title("Layers, from the tissue up", level=3)
            LayerTable(self._editor.probe, self._changed)
            self._lamps()

    def _face(self) -> None:
        draft = self._editor.probe

        def domed(event: ValueChangeEventArguments[bool | None]) -> None:
            draft.domed = bool(event.value)
            self._fill()
            self._changed()

        kit.panel_title("Face", level=3)
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

        kit.panel_title("Lamps around the side", level=3)
        fields = ui.element("div").classes("fields four")
        messages = FieldMessages()
        with fields:
            lamps = partial(self._set, "lamps")
            typed_field("How many", draft.lamps, lamps, partial(draft.lamp_fault, "lamps"), messages)
            for name, label in LAMP_LABELS.items():
                typed_field(label, draft.lamp[name], partial(lamp, name), partial(draft.lamp_fault, name), messages)
