"""Fields of numbers, choices and files; errors are shown with the labels of the page."""

from __future__ import annotations

import json
import re
import tempfile
from contextlib import contextmanager
from functools import partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

from nicegui import ui
from nicegui.elements.upload import Upload

from tsis.console.pages.components._actions import UndoMemory
from tsis.console.pages.components._messages import address_of, help_texts, plain_message
from tsis.errors import InputError
from tsis.model.require import require_integer

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from typing import Self

    from nicegui.client import Client
    from nicegui.element import Element
    from nicegui.elements.choice_element import ChoiceElement
    from nicegui.elements.mixins.validation_element import ValidationElement
    from nicegui.events import UploadEventArguments, ValueChangeEventArguments

    from tsis.console.pages.components._viewer import Viewer


FORCE = {"force_n": "force"}
Result = TypeVar("Result")


def with_field_labels(message: str, labels: Mapping[str, str]) -> str:
    """A message with the page's labels for its parameters.

    Examples
    --------
    >>> with_field_labels("radius_mm must lie in [1, 50]; got 0 (millimetres)", {"radius_mm": "radius of the object"})
    'radius of the object must lie in [1, 50]; got 0 (millimetres)'
    """
    return re.sub(r"\w+", lambda result: labels.get(result[0], result[0]), message)


def labelled(error: InputError, labels: Mapping[str, str]) -> InputError:
    """An error with the page's labels for its parameters, in its message and in its fields."""
    message, name, requirement, hint = (
        with_field_labels(text, labels) for text in (str(error), error.name, error.requirement, error.hint)
    )
    return InputError(
        message,
        name=name,
        requirement=requirement,
        value=error.value,
        hint=hint,
        cure=error.cure,
        bounds=error.bounds,
    )


@contextmanager
def field_messages(labels: Mapping[str, str]) -> Iterator[None]:
    """Show an `InputError` about these parameters with these labels."""
    try:
        yield
    except InputError as error:
        raise labelled(error, labels) from error


async def submit(
    viewer: Viewer, fields: Mapping[str, ValidationElement[Any]], act: Callable[..., Result], *given: object
) -> Result | None:
    """As `Viewer.attempt`; an error about one of the ``fields``, by their names in errors, is shown under it.

    The field's label replaces the name of a parameter. The error goes when something else is typed.
    """
    result: list[Result] = []
    refusal = await viewer.refusal(lambda: result.append(act(*given)))
    name = refusal.name.removeprefix("each ") if isinstance(refusal, InputError) else ""
    if isinstance(refusal, InputError) and name in fields:
        field = fields[name]
        field.error = plain_message(labelled(refusal, {name: label_of(field)} if "_" in name else {}))
        field.run_method("focus")
    elif refusal is not None:
        viewer.complain(plain_message(refusal))
    return result[0] if result else None


def label_of(field: Element) -> str:
    """The label of a field."""
    return str(field.props.get("aria-label") or field.props.get("label") or "")


_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)


def typed_number(name: str, typed: str | None) -> float:
    """The typed number, infinite where it is too large; `InputError` for other text.

    Examples
    --------
    >>> typed_number("force", " 0.5 ")
    0.5
    >>> typed_number("force", "half")
    Traceback (most recent call last):
    tsis.errors.InputError: force must be a number, as 2 or 0.5; got 'half'
    """
    text = (typed or "").strip()
    if not _NUMBER.fullmatch(text):
        raise InputError(name=name, requirement="must be a number, as 2 or 0.5", value=f"{text!r:.40}")
    return float(text)


def typed_integer(name: str, typed: str | None, low: int, high: int, *, hint: str = "") -> int:
    """The typed whole number in [low, high]; `InputError` for other text."""
    return require_integer(name, typed_number(name, typed), low, high, hint=hint)


def typed_numbers(name: str, typed: str | None) -> tuple[float, ...]:
    """Numbers with commas, semicolons or spaces between them; `InputError` for other text.

    Examples
    --------
    >>> typed_numbers("tips", "2, 10; 14"), typed_numbers("tips", " ")
    ((2.0, 10.0, 14.0), ())
    """
    return tuple(typed_number(name, part) for part in re.split(r"[,;\s]+", typed or "") if part)


def number_text_of_field(value: float | None) -> str:
    """A number as a field shows it; nothing where there is none."""
    if value is None:
        return ""
    return str(int(value)) if float(value).is_integer() and abs(value) < 1e9 else f"{value:.5g}"


ABOUT = "aria-description"  # the property of a field that says what is typed there, also for readers of the screen
Arguments = ParamSpec("Arguments")
Field = TypeVar("Field", bound="Element")


def explain(field: Field, label: str = "", about: str = "") -> Field:
    """Give a field the sentence, with unit and range, that its tooltip, screen readers and the page's help say.

    It is ``about``, or what the help has of the field's ``label``, on its page first.
    """
    label = label or label_of(field)
    texts = help_texts()
    here = texts.get(address_of(field.client.sub_pages_router.current_path), {}).get("fields", {})
    about = about or here.get(label) or texts["fields"].get(label, "")
    if about:
        field.props[ABOUT] = about
        field.tooltip(about)
    return field


def explained_fields(client: Client) -> list[tuple[str, str]]:
    """Names of the fields of an open page with their sentences, each once."""
    fields = [item for item in client.layout.descendants() if ABOUT in item.props and item.visible]
    return list({label_of(item): item.props[ABOUT] for item in fields}.items())


def explaining(kind: Callable[Arguments, Field]) -> Callable[Arguments, Field]:
    """Fields of a kind of the pages' library, outlined, and explained by the help."""

    def placed(*given: Arguments.args, **named: Arguments.kwargs) -> Field:
        field = kind(*given, **named).props("dense outlined")
        return explain(field, str(field.props.get("label") or ""))

    return placed


select_field, text_field, text_area = explaining(ui.select), explaining(ui.input), explaining(ui.textarea)


def unit_field(label: str, value: str = "", *, about: str = "", unit: str = "", keys: str = "decimal") -> ui.input:
    """Place a field that is read when a button is clicked; ``about`` as of `explain`.

    ``keys`` are those of a telephone: ``"decimal"``, ``"numeric"`` or ``"text"``.
    """
    field = ui.input(label, value=value).props("dense outlined hide-bottom-space autocomplete=off")
    field.props["inputmode"] = keys
    if unit:
        with field.add_slot("append"):
            ui.label(unit).classes("unit")
    return explain(field, label, about)


def typed_forces(typed: str | None, *, most: int) -> tuple[float, ...]:
    """Typed forces, at most so many; `InputError` for other text."""
    forces = typed_numbers("force", typed)
    if len(forces) > most:
        raise InputError(name="forces", requirement=f"must be at most {most}", value=str(len(forces)))
    return forces


class NumberField:
    """A field for one number of the instrument.

    A number that is being typed stays, whatever the instrument's state; Escape restores the field. ``act`` is called
    with the number, outside the event loop. What it refuses stays in the field, with the reason under it, until it is
    corrected, Escape is pressed or the instrument's number changes. ``emptied`` is called when the field is left empty;
    without it only numbers are accepted.
    """

    def __init__(
        self,
        viewer: Viewer,
        label: str,
        act: Callable[[float], object],
        *,
        about: str = "",
        unit: str = "",
        emptied: Callable[[], object] | None = None,
    ) -> None:
        self._viewer, self._label, self._act, self._emptied = viewer, label, act, emptied
        self._value: float | None = None
        self._typing, self._sent, self._just_done = False, False, UndoMemory()
        self._refused: str | None = None  # the text that was refused last
        self.element = unit_field(label, unit=unit, about=about).classes("number-field")
        self.element.on("update:model-value", self._typed)
        self.element.on("blur", self._done)
        self.element.on("keydown.enter", self._done)
        self.element.on("keydown.esc", self._give_up)

    def show(self, value: float | None) -> None:
        """Show the instrument's number, unless another one is being typed."""
        if self._just_done.is_old(value):
            return
        if value != self._value and self._refused is not None:
            self._accepted()
        self._value = value
        self._typing = self._typing and self.element.enabled  # who may not change it any more has not typed it
        if not self._typing and not self._sent:  # what was sent may be refused, and stays then
            self.element.set_value(number_text_of_field(value))

    def _typed(self) -> None:
        self._typing = True

    def _give_up(self) -> None:
        self._accepted()
        self.show(self._value)

    def refuse(self, message: str) -> None:
        """Show under the field why its text was refused."""
        self._refused, self._typing = str(self.element.value or "").strip(), True
        self.element.error = message

    def _accepted(self) -> None:
        self._refused, self._typing, self.element.error = None, False, None

    async def _done(self) -> None:
        if not self._typing:
            return
        text = str(self.element.value or "").strip()
        if text == number_text_of_field(self._value):
            self._give_up()
            return
        if text == self._refused:  # the field is left, or Enter is pressed again
            return
        self._typing, self._sent = False, True
        before = self._value
        refusal = await self._viewer.refusal(partial(self._accept, text))
        self._sent = False
        if not self._typing:
            self._accepted()
        if refusal is not None:
            self.refuse(plain_message(refusal))
        if not self._typing:
            self.element.set_value(number_text_of_field(self._value))
        if self._value != before:
            self._just_done.replaced(before)

    def _accept(self, text: str) -> None:
        if not text and self._emptied is not None:
            self._emptied()
            self._value = None
            return
        value = typed_number(self._label.lower(), text)
        self._act(value)
        self._value = value


class ChoiceField:
    """Synchronises a select or a toggle with the instrument.

    ``act`` is called with the choice, outside the event loop; after an error the instrument's choice is shown again.
    """

    def __init__(self, viewer: Viewer, element: ChoiceElement, act: Callable[[str], object]) -> None:
        self._viewer, self.element, self._act = viewer, element, act
        self._shown: str | None = element.value
        self._under_way, self._just_done = False, UndoMemory()
        element.on_value_change(self._chosen)

    def show(self, value: str | None, options: Mapping[str, str] | None = None) -> None:
        """Show the instrument's choice and the options, unless another choice is being made."""
        if self._just_done.is_old(value):
            return
        if options is not None and self.element.options != dict(options):
            self._shown = value
            self.element.set_options(dict(options), value=value)
        if not self._under_way:
            self._shown = value
            self.element.set_value(value)

    async def _chosen(self, event: ValueChangeEventArguments[str]) -> None:
        before = self._shown
        if event.value == before or self._under_way:
            return
        self._under_way = True
        try:
            done = await self._viewer.attempt(lambda: (self._act(event.value), True)[1])
        finally:
            self._under_way = False
        self.show(event.value if done else before)
        if done:
            self._just_done.replaced(before)


_NAME = """
(function wait(left) {
  const field = getHtmlElement(%d);
  const name = () => {
    const parts = field.querySelectorAll("a.q-btn, input[type=file]");
    parts.forEach((part) => part.setAttribute("aria-label", %s));
    parts.forEach((part) => part.toggleAttribute("inert", part.matches("input"))); // the button opens it
  };
  if (field) {
    name();
    new MutationObserver(name).observe(field, { childList: true, subtree: true }); // its parts come and go
  } else if (left) setTimeout(() => wait(left - 1), 100);
})(50);
"""  # the field may come a moment after this


LARGEST_MIB = 31  # limit of the authentication for a request, less the parts around the file


class FileField(Upload):
    """As `nicegui.ui.upload`, but it releases its callbacks when it is deleted.

    FastAPI remembers the last few thousand functions that ever answered an address; through the callbacks of a deleted
    field they would keep the whole page of its browser tab in memory.
    """

    _named = ""

    def name_parts(self, name: str) -> None:
        """Name the field's button and input for screen readers: its library gives them icons alone."""
        self._named = name
        self.client.run_javascript(_NAME % (self.id, json.dumps(name)))

    def reset(self) -> Self:
        """Forget the files; the library makes the button anew."""
        super().reset()
        self.name_parts(self._named)
        return self

    def _handle_delete(self) -> None:
        super()._handle_delete()
        for handlers in (self._begin_upload_handlers, self._upload_handlers, self._multi_upload_handlers):
            handlers.clear()


def one_file(
    viewer: Viewer, label: str, *, accept: str, refused: str, most_bytes: int = LARGEST_MIB * 2**20
) -> FileField:
    """A field that uploads one file as soon as it is chosen.

    ``accept`` are endings that the browser offers, as ``".csv,text/csv"``; ``refused`` is said of other files.
    """
    field = FileField(
        label=label,
        auto_upload=True,
        max_files=1,
        max_file_size=most_bytes,
        on_rejected=lambda: viewer.complain(refused),
    ).props("flat bordered")
    field.props["accept"] = accept
    field.name_parts(f"Choose: {label}")
    return explain(field, label)


def file_field(viewer: Viewer, label: str, *, accept: str, act: Callable[..., object]) -> FileField:
    """A field that hands an uploaded file to ``act`` as a path, ``by`` this client; the copy is then removed."""
    field = one_file(viewer, label, accept=accept, refused="The file is too large or has an unsupported format.")

    async def uploaded(event: UploadEventArguments) -> None:
        with tempfile.TemporaryDirectory(prefix="tsis-upload-") as folder:
            file = Path(folder) / (PurePosixPath(event.file.name.replace("\\", "/")).name or "unnamed")
            await event.file.save(file)
            field.reset()
            await viewer.attempt(act, file, by=viewer.identity)

    field.on_upload(uploaded)
    return field
