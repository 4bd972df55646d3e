"""One canonical JSON form, one hash of content, and the JSON of files that people read."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime
from pathlib import PurePath
from typing import Any

import numpy as np

from tsis.errors import RecordsError

SHA256 = re.compile(r"[0-9a-f]{64}")  # as it is written


def canonical(value: Any) -> str:
    """JSON with sorted names and no spaces; NaN and infinities are refused, with ValueError.

    A lone surrogate, as in file names that are no UTF-8, is escaped, since no database takes it as it is.

    Examples
    --------
    >>> canonical({"b": 0.1, "a": [1, None]})
    '{"a":[1,null],"b":0.1}'
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return text.encode("utf-8", "backslashreplace").decode()


def parsed(text: str, what: str) -> Any:
    """The value of a text that `canonical` wrote; ``what`` names it in errors.

    Raises
    ------
    RecordsError
        When it is not such a text.
    """
    try:
        return json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise RecordsError(
            f"{what} must hold what this program wrote; got {text!r:.60} (tsis records verify)"
        ) from error


def content_sha256(value: Any, *, spaced: bool = False, escaped: bool = False) -> str:
    """SHA-256 of a JSON value in its canonical form: equal content has an equal hash on every machine.

    Parameters
    ----------
    value
        JSON values.
    spaced, escaped
        Whether there is a space after each separator, and whether letters beyond ASCII are escaped. Formats from
        before the canonical form have such hashes in their files; no new format needs them.
    """
    if not spaced and not escaped:
        return hashlib.sha256(canonical(value).encode()).hexdigest()
    separators = (", ", ": ") if spaced else (",", ":")
    text = json.dumps(value, sort_keys=True, separators=separators, allow_nan=False, ensure_ascii=escaped)
    return hashlib.sha256(text.encode()).hexdigest()


def digest(values: Mapping[str, Any]) -> str:
    """SHA-256 of named values without those that are None, so that a later schema's new column changes no digest.

    Examples
    --------
    >>> digest({"number": 3, "note": None}) == digest({"number": 3})
    True
    """
    return content_sha256({name: value for name, value in values.items() if value is not None})


def digest_of_any(values: Mapping[str, Any]) -> str | None:
    """The same of what a database gives; None for what no store contains: bytes, NaN and infinities."""
    try:
        return digest(values)
    except (TypeError, ValueError):
        return None


def json_bytes(document: Any, *, indent: int = 2) -> bytes:
    """Content of a JSON file that people can read and any parser takes: UTF-8 without NaN.

    Arrays become lists, dataclass values and read-only mappings objects, times and paths text.
    """
    return (json.dumps(document, indent=indent, allow_nan=False, default=_json_value) + "\n").encode()


def _json_value(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if hasattr(value, "__dataclass_fields__"):
        return asdict(value)
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, (datetime, PurePath)):
        return str(value)
    raise TypeError(f"a JSON value must be a number, text, or lists and mappings of them; got a {type(value).__name__}")
