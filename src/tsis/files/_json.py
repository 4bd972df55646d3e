"""One spelling of plain values, so that equal content has equal bytes on every machine and in every database."""

from __future__ import annotations

import hashlib
import json
import re
from typing import TYPE_CHECKING, Any

from tsis.errors import RecordsError

if TYPE_CHECKING:
    from collections.abc import Mapping


SHA256 = re.compile(r"[0-9a-f]{64}")  # as it is spelt


def canonical(value: Any) -> str:
    """JSON with sorted names and no spaces; NaN and infinities are refused, with ValueError.

    What is half of a letter, as in names of files that are no UTF-8, is escaped, for no database holds it as it is.

    Examples
    --------
    >>> canonical({"b": 0.1, "a": [1, None]})
    '{"a":[1,null],"b":0.1}'
    """
    spelt = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False, ensure_ascii=False)
    return spelt.encode("utf-8", "backslashreplace").decode()  # a lone surrogate becomes JSON's own escape of it


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


def digest(values: Mapping[str, Any]) -> str:
    """SHA-256 of named values, whatever holds nothing left out, so that a later schema's new column changes no digest.

    Examples
    --------
    >>> digest({"number": 3, "note": None}) == digest({"number": 3})
    True
    """
    by_name = {name: value for name, value in values.items() if value is not None}
    return hashlib.sha256(canonical(by_name).encode()).hexdigest()


def digest_of_any(values: Mapping[str, Any]) -> str | None:
    """The same of what a database gives; None for what no store holds: bytes, NaN and infinities."""
    try:
        return digest(values)
    except (TypeError, ValueError):
        return None
