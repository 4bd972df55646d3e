"""Fields that are judged as they are typed, each group with the sentences about it below."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nicegui import ui

if TYPE_CHECKING:
    from collections.abc import Callable


class Sentences:
    """What is wrong with the fields of a group; nothing is shown while all are right."""

    def __init__(self) -> None:
        self._said: dict[str, str] = {}
        self._place = ui.element("div").classes("faults").props('role="status"')

    def say(self, field: str, sentence: str) -> None:
        """Say what is wrong with a field; an empty sentence takes back what was said."""
        if self._said.get(field, "") == sentence:
            return
        self._said[field] = sentence
        self._place.clear()
        with self._place:
            for each in dict.fromkeys(filter(None, self._said.values())):
                ui.label(each)


def typed_field(
    label: str,
    text: str,
    take: Callable[[str], None],
    fault: Callable[[], str],
    sentences: Sentences,
    *,
    shown: bool = True,
    empty: str = "",
) -> None:
    """A field for a number.

    Parameters
    ----------
    label
        What it is; its name for readers of the screen where it is not shown.
    text
        What is in it.
    take
        Told what was typed.
    fault
        Says then what is wrong with it; empty when nothing is.
    sentences
        Where that is said.
    shown
        Whether the label is shown in the field.
    empty
        What holds when nothing is typed.
    """

    def judge(typed: str | None) -> str | None:
        take(typed or "")
        wrong = fault()
        sentences.say(label, wrong)
        element.props["aria-invalid"] = "true" if wrong else "false"
        return wrong or None

    element = ui.input(label if shown else None, value=text, validation=judge)
    element.props("dense outlined hide-bottom-space inputmode=decimal no-error-icon autocomplete=off debounce=150")
    if empty:
        element.props("stack-label").props["placeholder"] = empty
    if not shown:
        element.props["aria-label"] = label
