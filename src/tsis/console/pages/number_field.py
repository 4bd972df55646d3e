"""A number that people type: done with Enter or on leaving the field, never taken from under their fingers."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from nicegui import ui

from tsis.console.pages.just_done import JustDone
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from tsis.console.pages.viewer import Viewer

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d+)?", re.IGNORECASE | re.ASCII)


def typed_number(name: str, text: str) -> float:
    """The number that somebody typed, infinite where it is too large for one.

    Raises
    ------
    InputError
        When it is none.

    Examples
    --------
    >>> typed_number("force", " 0.5 ")
    0.5
    >>> typed_number("force", "half")
    Traceback (most recent call last):
    tsis.model.errors.InputError: force must be a number, as 2 or 0.5; got 'half'
    """
    if not _NUMBER.fullmatch(text.strip()):
        raise InputError(f"{name} must be a number, as 2 or 0.5; got {text.strip()!r:.40}")
    return float(text)


def shown_number(value: float | None) -> str:
    """A number as a field shows it; nothing where there is none."""
    if value is None:
        return ""
    return str(int(value)) if float(value).is_integer() and abs(value) < 1e9 else f"{value:.5g}"


def unit_field(label: str, value: str = "", *, unit: str = "", keys: str = "decimal") -> ui.input:
    """Place a field that is read when a button is clicked.

    Parameters
    ----------
    label, value
        What it is, and what is in it at first.
    unit
        Shown behind what is typed.
    keys
        Of a telephone: ``"decimal"``, ``"numeric"`` or ``"text"``.
    """
    field = ui.input(label, value=value).props("dense outlined hide-bottom-space autocomplete=off")
    field.props["inputmode"] = keys
    if unit:
        with field.add_slot("append"):
            ui.label(unit).classes("unit")
    return field


class NumberField:
    """A field for one number of the bench.

    What is typed but not yet done stays as it is, whatever the bench says meanwhile; Escape gives it up. What is no
    number, or is refused, is said in a sentence, and the field shows the bench's number again.

    Parameters
    ----------
    viewer
        Who types.
    label
        What it is.
    act
        Done with the number, away from the event loop; its errors are told.
    unit
        Of the number, shown behind it.
    emptied
        Done when the field is left empty; nothing is accepted but a number when None.
    """

    def __init__(
        self,
        viewer: Viewer,
        label: str,
        act: Callable[[float], object],
        *,
        unit: str = "",
        emptied: Callable[[], object] | None = None,
    ) -> None:
        self._viewer, self._label, self._act, self._emptied = viewer, label, act, emptied
        self._value: float | None = None
        self._typing, self._just_done = False, JustDone()
        self.element = unit_field(label, unit=unit).classes("number-field")
        self.element.on("update:model-value", self._typed)
        self.element.on("blur", self._done)
        self.element.on("keydown.enter", self._done)
        self.element.on("keydown.esc", self._give_up)

    def show(self, value: float | None) -> None:
        """Show the bench's number, unless another one is being typed."""
        if self._just_done.is_old(value):
            return
        self._value = value
        self._typing = self._typing and self.element.enabled  # who may not change it any more has not typed it
        if not self._typing:
            self.element.set_value(shown_number(value))

    def _typed(self) -> None:
        self._typing = True

    def _give_up(self) -> None:
        self._typing = False
        self.show(self._value)

    async def _done(self) -> None:
        if not self._typing:
            return
        text = str(self.element.value or "").strip()
        if text == shown_number(self._value):
            self._give_up()
            return
        self._typing = False
        before = self._value
        await self._viewer.attempt(self._taken, text)
        if not self._typing:
            self.element.set_value(shown_number(self._value))
        if self._value != before:
            self._just_done.replaced(before)

    def _taken(self, text: str) -> None:
        if not text and self._emptied is not None:
            self._emptied()
            self._value = None
            return
        value = typed_number(self._label.lower(), text)
        self._act(value)
        self._value = value
