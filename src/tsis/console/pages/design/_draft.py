"""Drafts of a probe and of a question about it, validated while they are typed."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.catalog.probes import load_probe
from tsis.console.pages import components as kit
from tsis.errors import InputError
from tsis.inclusion.design import MOST_EVALUATIONS, MOST_FRAMES_PER_PRESS
from tsis.model.probe import Layer, Led, Probe
from tsis.present.design import QUICK_DEGREES, DesignQuestion

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    from tsis.console.services import Job


class FieldMessages:
    """Messages about the fields of a group."""

    def __init__(self) -> None:
        self._messages: dict[str, str] = {}
        self._list = kit.Redrawn(ui.element("div").classes("faults").props('role="status"'))

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
    kit.explain(element, label.rpartition(", ")[2])
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
        self.radius_mm = kit.number_text_of_field(probe.radius_mm)
        self.domed = probe.face_curvature_mm is not None
        self.curvature_mm = kit.number_text_of_field(probe.face_curvature_mm or 40.0)
        self.layers = [
            {name: kit.number_text_of_field(getattr(layer, name)) for name in LAYER} for layer in probe.layers
        ]
        self.lamps = str(len(probe.leds))
        self.lamp = {
            "height_mm": kit.number_text_of_field(probe.led_height_mm(led)),
            "aim_deg": kit.number_text_of_field(led.aim_deg),
            "half_angle_deg": kit.number_text_of_field(led.half_angle_deg),
        }

    def probe(self) -> Probe:
        """The probe of the fields; the catalog's probe when nothing was changed. `InputError` for an invalid field."""
        with kit.field_messages(LABELS):
            created = replace(
                self.start,
                radius_mm=kit.typed_number("radius", self.radius_mm),
                face_curvature_mm=kit.typed_number(DOME, self.curvature_mm) if self.domed else None,
                layers=tuple(
                    Layer(**{name: kit.typed_number(text, texts[name]) for name, text in LAYER.items()})
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
        count = kit.typed_number("lamps", self.lamps)
        if not count.is_integer() or not 1 <= count <= MOST_LAMPS:
            requirement = f"must be a whole number in [1, {MOST_LAMPS}]"
            raise InputError(name="lamps", requirement=requirement, value=self.lamps.strip())
        values = {name: kit.typed_number(text, self.lamp[name]) for name, text in LAMP.items()}
        first = self.start.leds[0]
        return tuple(replace(first, azimuth_deg=360.0 * number / count, **values) for number in range(int(count)))

    def layer_fault(self, texts: Mapping[str, str], name: str) -> str:
        """Error of a field of a layer; empty without one."""
        return draft_message(lambda: Layer(**{**ANY_LAYER, name: kit.typed_number(LAYER[name], texts[name])}))

    def lamp_fault(self, name: str) -> str:
        """Error of a field of the lamps; empty without one."""
        if name == "lamps":
            return draft_message(partial(kit.typed_number, "lamps", self.lamps)) or draft_message(self._leds)
        return draft_message(lambda: Led(**{name: kit.typed_number(LAMP[name], self.lamp[name])}))

    def face_fault(self, name: str) -> str:
        """Error of ``"radius_mm"`` or ``"curvature_mm"``; empty without one."""
        thick = Probe(radius_mm=5.0, layers=(Layer(thickness_mm=200.0, young_kpa=50.0),))  # under any dome
        wrong = draft_message(lambda: replace(thick, radius_mm=kit.typed_number("radius", self.radius_mm)))
        if name == "radius_mm":
            return wrong
        curvature = partial(kit.typed_number, DOME, self.curvature_mm)
        if wrong or not self.domed:
            return draft_message(curvature) if self.domed else ""
        radius = kit.typed_number("radius", self.radius_mm)
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
        return kit.plain_message(kit.labelled(error, LABELS))
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
        with kit.field_messages(kit.FORCE):
            return DesignQuestion(
                probe=probe,
                forces_n=kit.typed_forces(self.forces, most=MOST_FORCES),
                with_reference=self.with_reference,
                frames_per_press=kit.typed_integer("frames", self.frames, 1, MOST_FRAMES_PER_PRESS),
                compared=tuple(aspect for aspect in COMPARED if aspect in self.compared),
                criterion=self.criterion,
                traced=self.traced,
                evaluations=kit.typed_integer("stacks to try", self.evaluations, 1, MOST_EVALUATIONS)
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
