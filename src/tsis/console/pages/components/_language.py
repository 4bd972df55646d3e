"""The help of the pages, and a library's errors in the words of people."""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit


@cache
def help_texts() -> dict[str, dict[str, Any]]:
    """Text and terms of each page, by its address, and the meanings of the terms."""
    return tomllib.loads((Path(__file__).parents[1] / "help.toml").read_text(encoding="utf-8"))


def address_of(path: str) -> str:
    """The address in the navigation that a path belongs to: of ``/records/7?x=1`` it is ``/records``."""
    return "/" + urlsplit(path).path.strip("/").partition("/")[0]


UNITS = {"millimetres": "mm", "newtons": "N", "kilopascals": "kPa", "seconds": "s", "degrees": "°", "pixels": "pixels"}
LONGEST_SIGN = 3  # letters of a unit's sign, as dB
_RANGE = re.compile(r"must lie in \[(\S+), (\S+)\]; got (\S+)(?: \((.+?)\))?(?=; that would|$)")
_ENTERED = re.compile(r"; got ('.*'|\".*\"|[-+.\de]+|inf|none)(?: \((.+)\))?$")


def plain_message(message: str) -> str:
    """A library's error as one sentence for people.

    Examples
    --------
    >>> plain_message("gain must lie in [0, 24]; got -5 (dB)")
    'Gain must be 0–24 dB (you entered −5).'
    >>> plain_message("length must lie in [-1, 50]; got 1e+99 (millimetres of travel)")
    'Length must be −1 to 50 mm of travel (you entered 1e+99).'
    >>> plain_message("target must be a number, as 2 or 0.5; got ''")
    'Target must be a number, as 2 or 0.5 (nothing was entered).'
    >>> plain_message("depth must lie in [1, 2]; got 3 (the surrogate's box)")
    "Depth must be 1–2, the surrogate's box (you entered 3)."
    >>> plain_message("own.png: no image")
    'own.png: no image.'
    """
    text = _ENTERED.sub(lambda found: _entered(found[1], found[2]), _RANGE.sub(_range, message.rstrip()))
    if re.match(r"[a-z]+[ ,]", text):
        text = text[0].upper() + text[1:]
    return text if text.endswith((".", "!", "?", ":")) else f"{text}."


def _range(found: re.Match[str]) -> str:
    low, high, entered, hint = found.groups()
    unit = re.split(r"\W", hint or "", maxsplit=1)[0]
    sign = UNITS.get(unit, unit if unit == hint and len(unit) <= LONGEST_SIGN else "")
    behind = f" {sign}{hint[len(unit) :]}" if sign else f", {hint}" * bool(hint)
    between = f"{low} to {high}" if low.startswith("-") else f"{low}–{high}"
    reach = f"{low} or more" if high == "inf" else between
    return f"must be {reach.replace('-', '−')}{behind}" + _entered(entered, None)


def _entered(typed: str, hint: str | None) -> str:
    if typed in ("''", "none"):
        typed = "nothing was entered"
    elif typed == "inf":
        typed = "what you entered is too large"
    else:
        number = re.match(r"[-+.\de]+$", typed)
        typed = f"you entered {typed.replace('-', '−') if number else typed}"
    return f" ({typed})" if hint is None else f" ({typed}); {hint}"
