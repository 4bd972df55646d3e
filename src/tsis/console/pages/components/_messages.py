"""The help of the pages, and errors as sentences for people."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from tsis.errors import InputError


@cache
def help_texts() -> dict[str, dict[str, Any]]:
    """Text and terms of each page, by its address, and the meanings of the terms."""
    return tomllib.loads((Path(__file__).parents[1] / "help.toml").read_text(encoding="utf-8"))


def address_of(path: str) -> str:
    """The address in the navigation that a path belongs to: of ``/records/7?x=1`` it is ``/records``."""
    return "/" + urlsplit(path).path.strip("/").partition("/")[0]


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
