"""Errors as sentences with the labels of a page's fields."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

from tsis.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


PLACES = {  # where a page does what a command of the terminal does
    "acquire": "the page Examine",
    "calibrate": "the page Calibrate",
    "console": "the console",
    "depth": "whoever calibrates the sensor",
    "design": "the page Design",
    "examine": "the page My images",
    "hardness": "the page Hardness",
    "map": "the page Map",
    "records": "the page Targets",
    "study": "the page Studies",
}
COMMAND = re.compile(r"\btsis (\w+)((?: (?:--?[\w-]+|[a-z]+(?=[).,;:]| -)|[A-Z][A-Z.]*|\d[\d.,]*|/\S+))*)")
OPTIONS = {"--invert": "the switch 'Light falls where pressed'"}  # of commands, and what a page has for them


def on_pages(text: str) -> str:
    """A message with the page in place of a command of the terminal, and its switch in place of an option.

    Examples
    --------
    >>> on_pages("measure it on soft pads: tsis calibrate --pad-kpa 5 --pad-kpa 10")
    'measure it on soft pads: the page Calibrate'
    >>> on_pages("the store is damaged (tsis records verify)")
    'the store is damaged (the page Targets)'
    >>> on_pages("is --invert right?")
    "is the switch 'Light falls where pressed' right?"
    """
    for option, switch in OPTIONS.items():
        text = text.replace(option, switch)
    return COMMAND.sub(lambda found: PLACES.get(found[1], found[0]), text)


UNITS = {"millimetres": "mm", "newtons": "N", "kilopascals": "kPa", "seconds": "s", "degrees": "°", "pixels": "pixels"}
LONGEST_SIGN = 3  # letters of a unit's sign, as dB
ENTERED = {"": "", "''": "nothing was entered", "none": "nothing was entered", "inf": "what you entered is too large"}


def plain_message(error: Exception | str) -> str:
    """An error as one sentence for people: of its fields where it has some, else its message.

    Examples
    --------
    >>> gain = InputError(name="gain", requirement="must lie in [0, 24]", value="-5", hint="dB", bounds=(0, 24))
    >>> plain_message(gain)
    'Gain must be 0–24 dB (you entered −5).'
    >>> plain_message(InputError(name="target", requirement="must be a number, as 2 or 0.5", value="''"))
    'Target must be a number, as 2 or 0.5 (nothing was entered).'
    >>> plain_message("own.png: no image")
    'own.png: no image.'
    """
    text = str(error)
    if isinstance(error, InputError) and error.requirement:
        entered = ENTERED.get(error.value, f"you entered {_number(error.value)}")
        behind = (f" ({entered})" if entered else "") + (f"; {error.cure}" if error.cure else "")
        if error.bounds is None:
            text = f"{error.name} {error.requirement}{behind}" + (f"; {error.hint}" if error.hint else "")
        else:
            text = f"{error.name} must be {_range(*error.bounds)}{_unit(error.hint)}{behind}"
    text = on_pages(text)
    if re.match(r"[a-z]+[ ,]", text):
        text = text[0].upper() + text[1:]
    return text if text.endswith((".", "!", "?", ":")) else f"{text}."


def _range(low: float, high: float) -> str:
    if high == float("inf"):
        return f"{_number(f'{low:g}')} or more"
    return _number(f"{low:g} to {high:g}" if low < 0 else f"{low:g}–{high:g}")


def _unit(hint: str) -> str:
    """A hint behind a range: its first word is a unit, or it says what the range is."""
    word = re.split(r"\W", hint, maxsplit=1)[0]
    sign = UNITS.get(word, word if word == hint and len(word) <= LONGEST_SIGN else "")
    return f" {sign}{hint[len(word) :]}" if sign else f", {hint}" * bool(hint)


def _number(value: str) -> str:
    return value if value.startswith(("'", '"')) else value.replace("-", "−")


FORCE = {"force_n": "force"}


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
