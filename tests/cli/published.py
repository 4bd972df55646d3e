"""The published schema of the JSON results, and the check that a printed result is all described by it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

PUBLISHED = Path(__file__).parents[2] / "docs" / "reference" / "results.schema.json"


@cache
def published() -> dict[str, Any]:
    document: dict[str, Any] = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    return document


def without_more(schema: Any) -> Any:
    """The schema that forbids every name which it does not describe."""
    if isinstance(schema, list):
        return [without_more(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    strict = {name: without_more(item) for name, item in schema.items()}
    return {"additionalProperties": False, **strict} if "properties" in strict and "$defs" not in strict else strict


@cache
def _validator(name: str) -> Draft202012Validator:
    return Draft202012Validator({**without_more(published()), "$ref": f"#/$defs/{name}"})


def faults(document: dict[str, Any]) -> list[str]:
    """Where a printed result departs from the published schema, or has a name that nobody described."""
    errors = _validator(document["schema"]["name"]).iter_errors(document)
    return [f"{error.json_path}: {error.message:.200}" for error in errors]
