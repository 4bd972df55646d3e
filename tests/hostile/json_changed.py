"""Changes to the values of a JSON document, and nothing else: what a text editor or a forger does."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

_RAW = "@raw "
VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    0,
    -1,
    1,
    2**31,
    2**63,
    10**30,
    0.1,
    -0.0,
    1e308,
    -1e308,
    5e-324,
    float("nan"),
    float("inf"),
    float("-inf"),
    _RAW + "1e999",
    _RAW + "9" * 5000,
    _RAW + "-" + "9" * 400,
    "",
    "infinity",
    "a\x00b",
    "\x1b[31mred",
    "two\nlines",
    "\ud800",
    "\u202etxt",
    "x" * 5000,
    "../../../etc/passwd",
    "part-000000.parquet",
    "2026-01-01T00:00:00+00:00",
    "0001-01-01T00:00:00+23:59",
    [],
    {},
    [[]],
    [1, "a", None],
    [1.0] * 100,
    {"a": {"b": []}},
    {"shape": [1000, 1000], "kind": "double", "sha256": "", "zlib": ""},
    {"shape": [4000, 4000], "kind": "single", "sha256": "0" * 64, "zlib": "eJxjYGAYBaNgFAAAAAUAAQ=="},
    {"shape": [10**9, 10**9], "kind": "bool", "sha256": None, "zlib": None},
    {"shape": "12", "kind": [], "sha256": 1, "zlib": 2},
    _RAW + "[" * 400 + "]" * 400,
    _RAW + "[" * 5000 + "]" * 5000,
    _RAW + '{"a":' * 700 + "1" + "}" * 700,
)
SCALES = (1e-6, 1e-3, 0.1, 10.0, 25.4, 1e3, 1e6, -1.0)


def changed_document(content: bytes, rng: np.random.Generator) -> dict[str, Any]:
    """The document with one to three values changed, left out, added, nested or in another unit."""
    document: dict[str, Any] = json.loads(content)
    for _ in range(int(rng.choice([1, 1, 2, 3]))):
        _change(document, rng)
    return document


def text_of(document: Any, rng: np.random.Generator) -> bytes:
    """The document as JSON; some have a key twice, for which the last one counts."""
    text = json.dumps(document, indent=1 if rng.random() < 0.5 else None)
    for value in VALUES:  # what no Python value stands for
        if isinstance(value, str) and value.startswith(_RAW):
            text = text.replace(json.dumps(value), value[len(_RAW) :])
    if rng.random() < 0.05 and isinstance(document, dict) and document:
        name = list(document)[int(rng.integers(len(document)))]
        text = text.replace("{", "{" + json.dumps(name) + ": 0, ", 1)
    return text.encode("utf-8", errors="surrogatepass")


def _change(document: Any, rng: np.random.Generator) -> None:
    place, step = document, None
    for _ in range(12):
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        if not keys:
            break
        step = keys[int(rng.integers(len(keys)))]
        if not isinstance(place[step], (dict, list)) or not place[step] or rng.random() < 0.15:
            break
        place = place[step]
    if step is None or (isinstance(place, dict) and step not in place) or (isinstance(place, list) and not place):
        return
    kind = int(rng.integers(6))
    if kind == 0:
        del place[step]
    elif kind == 1 and isinstance(place, dict):
        place["unheard of"] = VALUES[int(rng.integers(len(VALUES)))]
    elif kind == 2 and isinstance(place[step], (int, float)):
        place[step] = place[step] * SCALES[int(rng.integers(len(SCALES)))]
    elif kind == 3 and isinstance(place, list):
        place.append(json.loads(json.dumps(place[step])))
    else:
        value = VALUES[int(rng.integers(len(VALUES)))]
        place[step] = json.loads(json.dumps(value)) if isinstance(value, (dict, list)) else value
