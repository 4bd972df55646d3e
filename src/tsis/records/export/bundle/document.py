"""JSON of a bundle: one spelling when it is written, bounds on what it may become in memory when it is read."""

from __future__ import annotations

import hashlib
import json
from typing import Any, NoReturn

from tsis.model.errors import FileInputError

MOST_VALUES = 500_000  # a byte of JSON can become forty of memory
SEALED = "sha256"


def document_bytes(content: Any) -> bytes:
    """The one spelling of plain values in a bundle."""
    return (json.dumps(content, indent=1, allow_nan=False) + "\n").encode()


def sealed_bytes(content: dict[str, Any]) -> bytes:
    """The same, with the SHA-256 of everything else in it."""
    seal = hashlib.sha256(document_bytes(content)).hexdigest()
    return document_bytes(content | {SEALED: seal})


def parse(content: bytes, name: str) -> Any:
    """The plain values of a file; ``name`` is its own.

    Raises
    ------
    FileInputError
        When it is no JSON, holds a name twice or a number that JSON has not, is nested without end or has too many
        values.
    """
    values = sum(content.count(sign) for sign in (b",", b"[", b"{"))
    if values > MOST_VALUES:
        raise FileInputError(f"{name} must hold at most {MOST_VALUES} values; got {values}")
    try:
        return json.loads(content.decode(), object_pairs_hook=_once_each, parse_constant=_refuse_number)
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{name} must be a readable JSON file; got: {str(error)[:200]}") from error


def parse_sealed(content: bytes, name: str) -> dict[str, Any]:
    """The plain values of a file that `sealed_bytes` wrote, every byte of it as it was.

    Raises
    ------
    FileInputError
        As `parse`, and when a byte was changed.
    """
    found = parse(content, name)
    if not isinstance(found, dict):
        raise FileInputError(f"{name} must hold a JSON object; got a {type(found).__name__}")
    try:
        wanted = sealed_bytes({key: value for key, value in found.items() if key != SEALED})
    except (ValueError, RecursionError) as error:
        raise FileInputError(f"{name} must be as it was written; got: {str(error)[:200]}") from error
    if wanted != content:
        raise FileInputError(f"{name} must be as it was written; it does not match its own hash, so it was changed")
    return found


def _once_each(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) != len(pairs):
        raise ValueError("a name twice in one object")
    return found


def _refuse_number(word: str) -> NoReturn:
    raise ValueError(f"{word}, which is no number of JSON")
