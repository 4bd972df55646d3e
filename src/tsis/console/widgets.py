"""What several pages share: help, buttons, fields, tables."""

from __future__ import annotations

import asyncio
import json
import re
import tempfile
import tomllib
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar
from urllib.parse import urlsplit

from nicegui import ui
from nicegui.elements.upload import Upload

from tsis.console.messages import labelled, on_pages, plain_message
from tsis.console.services.jobs import estimate_title
from tsis.errors import InputError
from tsis.model.require import require_integer
from tsis.present.page import address
from tsis.present.target import time_text
from tsis.records.values import ROLE_NAMES, StoredPress

if TYPE_CHECKING:
    from collections.abc import Awaitable, Callable, Iterable, Iterator, Mapping, Sequence
    from datetime import datetime
    from typing import Self

    from nicegui.client import Client
    from nicegui.element import Element
    from nicegui.elements.choice_element import ChoiceElement
    from nicegui.elements.label import Label
    from nicegui.elements.mixins.disableable_element import DisableableElement
    from nicegui.elements.mixins.validation_element import ValidationElement
    from nicegui.events import UploadEventArguments, ValueChangeEventArguments

    from tsis.console.services.instrument import Instrument
    from tsis.console.services.jobs import JobState
    from tsis.console.services.state import CameraState, InstrumentState
    from tsis.console.viewer import Viewer
    from tsis.present.page import Card, Page, Picture, Table


@cache
def help_texts() -> dict[str, dict[str, Any]]:
    """Text and terms of each page, by its address, and the meanings of the terms."""
    return tomllib.loads((Path(__file__).parent / "pages" / "help.toml").read_text(encoding="utf-8"))


def address_of(path: str) -> str:
    """The address in the navigation that a path belongs to: of ``/records/7?x=1`` it is ``/records``."""
    return "/" + urlsplit(path).path.strip("/").partition("/")[0]


@contextmanager
def loading(button: ui.button) -> Iterator[None]:
    """Show a button as busy until the block ends."""
    button.props(add="loading")
    try:
        yield
    finally:
        button.props(remove="loading")


Control = TypeVar("Control", bound="DisableableElement")


class OperatorControls:
    """The controls of one page, enabled for the camera's owner."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer = viewer
        self._controls: list[DisableableElement] = []
        self._shown = False  # before the first state the controls do not show the instrument's

    def add(self, control: Control, *others: DisableableElement) -> Control:
        """Disable controls for everybody but the owner; returns the first."""
        controls: tuple[DisableableElement, ...] = (control, *others)
        self._controls += controls
        for item in controls:
            item.set_enabled(self._shown and self._viewer.commands)
        return control

    def why(self) -> None:
        """Place the message why controls are disabled."""
        self._message = ui.label().classes("muted watching").props("role=status")

    def show(self, _: InstrumentState) -> None:
        """Enable the controls for the camera's owner."""
        commands, self._shown = self._viewer.commands, True
        self._controls = [control for control in self._controls if not control.is_deleted]
        for control in self._controls:
            control.set_enabled(commands)
        self._message.set_visibility(not commands)
        self._message.text = "You are watching. Take the camera (top of the page) to use the disabled controls."


class ProgressBar:
    """Progress bar of a running job, with a label for screen readers."""

    def __init__(self, label: str) -> None:
        self._bar = ui.linear_progress(0.0, show_value=False, size="6px").props("instant-feedback")
        self._bar.props["aria-label"] = label

    def show(self, job: JobState | None) -> None:
        """Show the progress of the job; None without one."""
        self._bar.set_visibility(job is not None and job.running)
        if job is not None and job.running:
            self._bar.value = job.fraction
            self._bar.props(remove="indeterminate") if job.fraction else self._bar.props(add="indeterminate")


class JobLine:
    """How far a job is, in words and on a bar, with the button that cancels it by ``end``; unseen without a job."""

    def __init__(self, label: str, end: Callable[[], object]) -> None:
        with ui.element("div").classes("stack tight") as self._place:
            with ui.element("div").classes("row"):
                self._message = status("wordy")
                self._end = button("Cancel", end, look="outline dense")
            self._bar = ProgressBar(label)
        self._place.set_visibility(False)

    def show(self, job: JobState | None, running: str) -> bool:
        """Show the job, with a text while it is running; gives whether it is."""
        self._place.set_visibility(job is not None)
        if job is None:
            return False
        self._message.text = running if job.running else job.sentence
        self._end.set_visibility(job.running)
        self._bar.show(job)
        return job.running


def set_filled(button: ui.button, filled: bool) -> None:
    """Fill the button of the next step; others have an outline."""
    button.props(add="unelevated", remove="outline") if filled else button.props(add="outline", remove="unelevated")


class RunButton:
    """Start or Stop of the camera."""

    def __init__(self, instrument: Instrument, viewer: Viewer) -> None:
        self._instrument, self._viewer = instrument, viewer
        self._runs: bool | None = None  # as the button says; None before anything is known
        self.element = ui.button("Start", on_click=self.click).props("outline").classes("run")

    def show(self, camera: CameraState, *, main: bool = True) -> None:
        """Say what a click would do; filled when starting is the ``main`` thing to do."""
        self._runs = camera.running
        self.element.text = "Stop" if self._runs else "Start"
        self.element.set_icon("stop" if self._runs else "play_arrow")
        set_filled(self.element, main and not self._runs)

    async def click(self) -> None:
        """Start the camera, or stop it."""
        if self._runs is None:
            return
        with loading(self.element):  # a second click on Start starts nothing more
            await self._viewer.command(self._instrument.stop if self._runs else self._instrument.start)()


def estimate_job(state: InstrumentState) -> JobState | None:
    """The newest estimate of the present target, under way or over; None when there was none."""
    title = estimate_title(state.target)
    return next((job for job in reversed(state.jobs) if job.title == title), None)


Result = TypeVar("Result")


async def submit(
    viewer: Viewer, fields: Mapping[str, ValidationElement[Any]], act: Callable[..., Result], *given: object
) -> Result | None:
    """As `Viewer.attempt`; an error about one of the ``fields``, by their names in errors, is shown under it.

    The field's label replaces the name of a parameter. The error goes when something else is typed.
    """
    results: list[Result] = []
    refusal = await viewer.refusal(lambda: results.append(act(*given)))
    about = refusal.name.removeprefix("each ") if isinstance(refusal, InputError) else ""
    name = next((name for name in fields if re.match(rf"{re.escape(name)}\b", about)), "")  # truth['depth_mm']
    if isinstance(refusal, InputError) and name:
        field = fields[name]
        field.error = plain_message(labelled(refusal, {name: label_of(field)} if "_" in name else {}))
        field.run_method("focus")
    elif refusal is not None:
        viewer.complain(plain_message(refusal))
    return results[0] if results else None


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
    field = ui.input(label or None, value=value).props("dense outlined hide-bottom-space autocomplete=off")
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
        self._typing, self._sent, self._sending = False, 0, asyncio.Lock()
        self._refused: str | None = None  # the text that was refused last
        self.element = unit_field(label, unit=unit, about=about).classes("number-field")
        self.element.on("update:model-value", self._typed)
        self.element.on("blur", self._done)
        self.element.on("keydown.enter", self._done)
        self.element.on("keydown.esc", self._give_up)

    def show(self, value: float | None) -> None:
        """Show the instrument's number, unless another one is being typed."""
        if value != self._value and self._refused is not None:
            self._accepted()
        self._value = value
        self._typing = self._typing and self.element.enabled  # who may not change it any more has not typed it
        if not self._typing and not self._sent:  # what was sent may be refused, and stays then
            self.element.set_value(number_text_of_field(value))

    def _text(self) -> str:
        return str(self.element.value or "").strip()

    def _typed(self) -> None:
        self._typing = True

    def _give_up(self) -> None:
        self._accepted()
        self.show(self._value)

    def refuse(self, message: str, text: str | None = None) -> None:
        """Show under the field why a text, by default its own, was refused."""
        self._refused, self._typing = self._text() if text is None else text, True
        self.element.error = message

    def _accepted(self) -> None:
        self._refused, self._typing, self.element.error = None, False, None

    async def taken(self) -> None:
        """Wait until what was typed has reached the instrument."""
        await self._done()
        async with self._sending:
            pass

    async def _done(self) -> None:
        text = self._text()
        if not self._typing or text == self._refused:  # the field is left, or Enter is pressed again
            return
        if not self._sent and text == number_text_of_field(self._value):
            self._give_up()
            return
        self._typing, self._sent = False, self._sent + 1
        try:
            async with self._sending:  # numbers reach the instrument in the order in which they were typed
                refusal = await self._viewer.refusal(partial(self._accept, text))
        finally:
            self._sent -= 1
        if self._sent:  # a later number is on its way, and its answer counts
            return
        if not self._typing:
            self._accepted()
        if refusal is not None:
            self.refuse(plain_message(refusal), text)
        if not self._typing:
            self.element.set_value(number_text_of_field(self._value))

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
        self._under_way = False
        element.on_value_change(self._chosen)

    def show(self, value: str | None, options: Mapping[str, str] | None = None) -> None:
        """Show the instrument's choice and the options, unless another choice is being made."""
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


def uploaded_name(event: UploadEventArguments) -> str:
    """The name of an uploaded file, without any folder."""
    return PurePosixPath(event.file.name.replace("\\", "/")).name or "unnamed"


def file_field(viewer: Viewer, label: str, *, accept: str, act: Callable[..., object]) -> FileField:
    """A field that hands an uploaded file to ``act`` as a path, ``by`` this client; the copy is then removed."""
    field = one_file(viewer, label, accept=accept, refused="The file is too large or has an unsupported format.")

    async def uploaded(event: UploadEventArguments) -> None:
        with tempfile.TemporaryDirectory(prefix="tsis-upload-") as folder:
            file = Path(folder) / uploaded_name(event)
            await event.file.save(file)
            field.reset()
            await viewer.attempt(act, file, by=viewer.identity)

    field.on_upload(uploaded)
    return field


class FilesField:
    """Files that are dropped or chosen, of which ``folder`` keeps copies, beside a path on the console's computer.

    ``opened`` is called with the place of each, and whether it is a copy; only the camera's owner may open a path.
    """

    def __init__(
        self,
        viewer: Viewer,
        name: str,
        path_label: str,
        *,
        accept: Iterable[str],
        folder: Callable[[], Path],
        opened: Callable[[Path, bool], Awaitable[None]],
    ) -> None:
        self._viewer, self._folder, self._opened = viewer, folder, opened
        too_large = f"A file is larger than {LARGEST_MIB} MiB or has an unsupported format."
        self.element = FileField(
            label="Drop files here, or choose them",
            multiple=True,
            auto_upload=True,
            max_file_size=LARGEST_MIB * 2**20,
            on_upload=self.uploaded,
            on_rejected=lambda: viewer.complain(too_large),
        ).props("flat bordered")
        self.element.props["accept"] = ",".join(accept)
        self.element.name_parts(name)
        explain(self.element, name)
        with ui.element("div").classes("row") as self.row:
            self._path = unit_field(path_label, keys="text").classes("path")
            button("Open", self._open, icon="folder_open")

    async def uploaded(self, event: UploadEventArguments) -> None:
        """Open an uploaded file, which keeps its name without any folder."""
        file = self._folder() / uploaded_name(event)
        try:
            await event.file.save(file)
        except OSError as error:
            self._viewer.complain(f"There is no space for a copy of {file.name}: {error.strerror or error}")
            return
        await self._opened(file, True)

    async def _open(self) -> None:
        if not self._viewer.commands:
            self._viewer.complain(
                "Only the user who controls the camera may open paths on its computer: drop the files here."
            )
        elif self._path.value:
            await self._opened(Path(self._path.value).expanduser(), False)


def set_class(element: Element, name: str, present: bool) -> None:
    """Add a class to an element, or remove it."""
    element.classes(add=name) if present else element.classes(remove=name)


def panel_title(text: str, *, level: int = 2) -> Label:
    """The title of a panel."""
    title = ui.label(text).classes("panel-title").props("role=heading")
    title.props["aria-level"] = level
    return title


@contextmanager
def panel(title: str, *, style: str = "panel stack") -> Iterator[Element]:
    """A panel under its title."""
    with ui.element("section").classes(style) as place:
        panel_title(title)
        yield place


@contextmanager
def title_row(title: str, *, level: int = 2) -> Iterator[None]:
    """A line with a title at its left; what is made in it stands at its right."""
    with ui.element("div").classes("row"):
        panel_title(title, level=level)
        ui.element("div").classes("spring")
        yield


def muted(text: str = "") -> Label:
    """A label that says less than others."""
    return ui.label(text).classes("muted")


def status(style: str = "muted") -> Label:
    """A label whose changes readers of the screen say."""
    return ui.label().classes(style).props("role=status")


def button(
    text: str,
    act: Callable[..., object] | None = None,
    *,
    icon: str | None = None,
    look: str = "outline",
    label: str = "",
) -> ui.button:
    """A button; its look is ``"unelevated"`` for the next step; ``label`` is what readers of the screen say."""
    made = ui.button(text, icon=icon, on_click=act)
    for word in look.split():
        made.props[word] = True
    if label:
        made.props["aria-label"] = label
    return made


@contextmanager
def titled_dialog(title: str, *, style: str = "dialog-card", opened: bool = False) -> Iterator[ui.dialog]:
    """A dialog that screen readers know by its title."""
    with ui.dialog(value=opened) as dialog, ui.card().classes(style):
        dialog.props["aria-label"] = title
        panel_title(title)
        yield dialog


@contextmanager
def open_dialog(place: Element, title: str, *, style: str = "dialog-card") -> Iterator[ui.dialog]:
    """Open a dialog in a place of the page; it is deleted when it is closed."""
    with place, titled_dialog(title, style=style, opened=True) as dialog:
        yield dialog
    dialog.on("hide", dialog.delete)


def dialog_buttons(dialog: ui.dialog, text: str, act: Callable[[], object], *, leave: str = "Cancel") -> ui.button:
    """Place the button of a dialog, which is returned, and the one that closes it."""
    with ui.element("div").classes("row"):
        made = button(text, act, look="unelevated dense")
        button(leave, dialog.close, look="flat dense")
    return made


async def is_confirmed(question: str, *, yes: str, why: str) -> bool:
    """Ask for confirmation; False without a response."""
    with titled_dialog(question, style="question") as dialog:
        ui.label(why).classes("muted")
        with ui.element("div").classes("row"):
            ui.element("div").classes("spring")
            button("Cancel", lambda: dialog.submit(False), look="flat")
            button(yes, lambda: dialog.submit(True), look="unelevated")
    confirmed = bool(await dialog)
    dialog.delete()
    return confirmed


class Redrawn:
    """A part of a page that is drawn anew when its content changes; it replaces whatever is in the element."""

    def __init__(self, element: Element) -> None:
        self.element = element
        self.content: object = None

    def changes_to(self, content: object) -> bool:
        """Whether the content is a new one; the element is emptied then."""
        if content == self.content:
            return False
        self.content = content
        self.element.clear()
        return True


class FactList:
    """A list of terms with their values; empty at first."""

    def __init__(self) -> None:
        self._list = Redrawn(ui.element("dl").classes("facts"))

    def show(self, facts: Iterable[tuple[str, str]]) -> None:
        """Show these facts in place of those before."""
        facts = tuple(facts)
        if not self._list.changes_to(facts):
            return
        with self._list.element:
            for term, value in facts:
                with ui.element("dt"):
                    ui.label(term)
                with ui.element("dd"):
                    ui.label(value)


def message_list(messages: Iterable[str] = ()) -> Element:
    """Place a list with these messages; others can be `list_message` in it."""
    with ui.element("ul").classes("sentences") as position:
        for message in messages:
            list_message(message)
    return position


def list_message(message: str, style: str = "") -> None:
    """Place a message in a list."""
    with ui.element("li"):
        ui.label(on_pages(message)).classes(style)


def scrolling(label: str) -> Element:
    """A place that scrolls sideways where a table is too wide, also by keys; ``label`` is what readers say."""
    place = ui.element("div").classes("scroll").props("role=region tabindex=0")
    place.props["aria-label"] = label
    return place


def rows_under(headings: Iterable[str], *, caption: str = "", label: str = "", style: str = "table") -> Element:
    """Place a table, its ``label`` unseen; what is made in what this gives becomes its rows."""
    with ui.element("table").classes(style) as table:
        if label:
            table.props["aria-label"] = label
        if caption:
            with ui.element("caption"):
                ui.label(caption)
        with ui.element("thead"), ui.element("tr"):
            for heading in headings:
                with ui.element("th").props("scope=col") if heading else ui.element("td"):
                    ui.label(heading)
        return ui.element("tbody")


def row(cells: Iterable[str]) -> None:
    """Place a row of text."""
    with ui.element("tr"):
        for text in cells:
            cell(text)


COUNTED = {"press": ("1 press", "{count} presses"), "target": ("1 target", "{count} targets")}


def count_text(number: int, what: str) -> str:
    """So many presses or targets.

    Examples
    --------
    >>> count_text(1, "press"), count_text(2, "target")
    ('1 press', '2 targets')
    """
    return COUNTED[what][number != 1].format(count=number)


def cell(text: str) -> ui.label:
    """Place a cell with a text."""
    with ui.element("td"):
        return ui.label(text)


def drawings(page: Page) -> tuple[str, ...]:
    """The figures of a page as data addresses, in their order; drawing takes a while, so not in the event loop."""
    return tuple(address(picture) for picture in page.pictures)


def report_parts(page: Page, sources: Iterable[str]) -> None:
    """Show a whole report: cards, what to know, pictures as `drawings` made them ready, tables."""
    cards(page.cards)
    for note in page.notes:
        ui.label(note).classes("muted")
    with ui.element("div").classes("grid"):
        for picture, source in zip(page.pictures, sources, strict=True):
            figure(picture, source)
    for item in page.tables:
        table(item)


def cards(items: Iterable[Card]) -> None:
    """The main numbers of a report."""
    with ui.element("div").classes("cards"):
        for card in items:
            with ui.element("div").classes("card doubtful" if card.doubtful else "card"):
                ui.label(card.title).classes("muted")
                ui.label(card.value).classes("number")
                ui.label(card.detail).classes("muted")


def figure(picture: Picture, source: str) -> None:
    """A drawn figure with its caption, and a text for screen readers."""
    with ui.element("figure").classes("plot wide" if picture.wide else "plot"):
        panel_title(picture.title, level=3)
        show_drawing(drawing(), source, picture.alt)
        if picture.caption:
            with ui.element("figcaption").classes("muted"):
                ui.label(picture.caption)


def drawing() -> Element:
    """A place for drawings: inside the page, the names of a drawing's parts would be those of every other's."""
    return ui.element("img").classes("drawing")


def show_drawing(image: Element, source: str, alt: str) -> None:
    """Show a drawing, of this data address, in a place for drawings."""
    image.props["src"], image.props["alt"] = source, alt


def table(content: Table) -> None:
    """Rows of text under headings."""
    with ui.element("section"):
        panel_title(content.title, level=3)
        with scrolling(content.title), rows_under(content.headings):
            for item in content.rows:
                row(item)


def sheets_of_targets(table: ui.table, sizes: Sequence[int], pages: Callable[[], dict[str, Any]]) -> None:
    """Have a table show one sheet of many targets: ``pages`` is its pagination, whatever a slow browser has sent."""

    def restore() -> None:
        if table.pagination != pages():
            table.pagination = pages()

    table.props("flat dense wrap-cells").classes("targets")
    table.props["rows-per-page-label"], table.props["rows-per-page-options"] = "Targets on a sheet", list(sizes)
    table.on_pagination_change(restore)


def force_text(force_n: float | None) -> str:
    """A force, also an unknown one.

    Examples
    --------
    >>> force_text(0.7), force_text(None)
    ('0.7 N', 'no force gauge')
    """
    return "no force gauge" if force_n is None else f"{force_n:.3g} N"


def time_label(when: datetime) -> str:
    """A time where nothing else says that it is in UTC."""
    return f"{time_text(when)} UTC"


def press_label(press: StoredPress) -> str:
    """A press: what was pressed, how hard, when."""
    return f"{ROLE_NAMES[press.role]}, {force_text(press.force_n)}, {time_label(press.taken)}"


def camera_line(state: InstrumentState) -> str:
    """What is done to the camera now, else the name, rate, losses and size of its frames."""
    camera = state.camera
    if state.busy:
        return f"{state.busy.capitalize()} …"
    if not camera.running:
        return "The camera is stopped."
    size = f", {camera.columns} x {camera.rows} pixels" if camera.columns else ""
    times = "once" if camera.interruptions == 1 else f"{camera.interruptions} times"
    breaks = f", interrupted {times}" if camera.interruptions else ""
    return f"{camera.name}: {camera.frames_per_s:.0f} frames/s, {camera.missed} dropped{breaks}{size}"
