"""The canonical JSON form and the content hash."""

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

SHA256 = re.compile(r"[0-9a-f]{64}")


def canonical(value: Any) -> str:
    """JSON with sorted names and no spaces; `ValueError` for NaN and infinities.

    A lone surrogate, as in file names that are not UTF-8, is escaped because databases refuse it.

    Examples
    --------
    >>> canonical({"b": 0.1, "a": [1, None]})
    '{"a":[1,null],"b":0.1}'
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return text.encode("utf-8", "backslashreplace").decode()


def parse_canonical(text: str, what: str) -> Any:
    """The value of a text that `canonical` wrote; `RecordsError` for any other text, which ``what`` names."""
    try:
        return json.loads(text)
    except (TypeError, ValueError, RecursionError) as error:
        raise RecordsError(
            f"{what} must hold what this program wrote; got {text!r:.60} (tsis records verify)"
        ) from error


def content_sha256(value: Any) -> str:
    """SHA-256 of a JSON value in its canonical form: equal content has an equal hash on every machine."""
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def digest(values: Mapping[str, Any]) -> str:
    """SHA-256 of named values without None, so that a new column of a later schema changes no digest.

    Examples
    --------
    >>> digest({"number": 3, "note": None}) == digest({"number": 3})
    True
    """
    return content_sha256({name: value for name, value in values.items() if value is not None})


def digest_or_none(values: Mapping[str, Any]) -> str | None:
    """The digest of values of a database; None for bytes, NaN and infinities, which no store contains."""
    try:
        return digest(values)
    except (TypeError, ValueError):
        return None


def json_bytes(document: Any, *, indent: int = 2) -> bytes:
    """Indented JSON in UTF-8 without NaN.

    Arrays become lists, dataclasses and read-only mappings become objects, times and paths become text.
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
