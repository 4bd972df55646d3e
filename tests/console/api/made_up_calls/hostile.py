"""Bodies and addresses that no description tells of: numbers without end, halves of letters, nesting without floor."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

if TYPE_CHECKING:
    import random

PLACE = "\u0001here\u0001"
VALUES = (  # as JSON texts, put in the place of a value
    "NaN",
    "Infinity",
    "-Infinity",
    "1e999",
    "-1e999",
    "9" * 400,
    "-" + "9" * 5000,
    "1e-400",
    "-0.0",
    '"\\ud800"',
    '"\\u0000"',
    '"' + "A" * 20_000 + '"',
    '"\\u202e\\ufeff"',
    "null",
    "true",
    "[]",
    "{}",
    "[" * 5000 + "]" * 5000,
    '{"a":' * 3000 + "1" + "}" * 3000,
    '{"$number": "nan"}',
)
BODIES = (  # whole bodies
    b"",
    b"nul",
    b"NaN",
    b"\xff\xfe{",
    b"\xef\xbb\xbf{}",
    b'{"a": 1',
    b"{}{}",
    b"[" * 100_000,
    b'{"\\ud800": 1}',
    b'{"a": 1, "a": NaN}',
    b"\x00",
    '{"name": "ü"}'.encode("utf-16"),
    b"--x\r\nContent-Disposition: form-data; name=a\r\n\r\n1\r\n--x--",
)
KINDS = (
    "application/json",
    "application/json",
    "application/json",
    "text/plain",
    "application/xml",
    "",
    "multipart/form-data; boundary=x",
)
TEXTS = (
    "NaN",
    "Infinity",
    "-1",
    "1e309",
    "0x10",
    " 1",
    "1_0",
    "٣",
    "9" * 5000,
    "\x00",
    "\ud800",
    "../..",
    "%2e%2e%2f",
    "%",
    "",
    "1.0",
    "+1",
    "true",
)


def hostile_body(given: Any, rng: random.Random) -> tuple[bytes, str]:
    """A body made of a sound one, and the type that it claims to have."""
    if not isinstance(given, (dict, list)) or not given or rng.random() < 0.3:
        return rng.choice(BODIES), rng.choice(KINDS)
    text = json.dumps(_with_place(given, rng)).replace(json.dumps(PLACE), rng.choice(VALUES))
    return text.encode("utf-8", "surrogatepass"), "application/json"


def hostile_text(rng: random.Random) -> str:
    """A part of an address, escaped so that it travels."""
    return quote(rng.choice(TEXTS).encode("utf-8", "surrogatepass"), safe="%")


def _with_place(value: Any, rng: random.Random) -> Any:
    """The value with one of its parts marked."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        name = rng.choice(list(value))
        return {**value, name: _with_place(value[name], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        at = rng.randrange(len(value))
        return [*value[:at], _with_place(value[at], rng), *value[at + 1 :]]
    return PLACE
