"""The description of the calls, as OpenAPI: what generated clients and tests read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi.openapi.utils import get_openapi

from tsis.console.api.asking import CONTROL, NEEDED

if TYPE_CHECKING:
    from fastapi import FastAPI


def description(application: FastAPI) -> dict[str, Any]:
    """The description of an application's calls; made once.

    FastAPI takes the header of acts for optional, for who leaves it out is to read a sentence of ours.
    """
    if application.openapi_schema is None:
        schema = get_openapi(
            title=application.title,
            version=application.version,
            description=application.description,
            routes=application.routes,
            servers=application.servers,
        )
        for operation in operations(schema):
            _require_control(operation)
        application.openapi_schema = schema
    return application.openapi_schema


def operations(schema: dict[str, Any]) -> list[dict[str, Any]]:
    """Every call of a description."""
    return [operation for path in schema["paths"].values() for operation in path.values()]


def _require_control(operation: dict[str, Any]) -> None:
    for parameter in operation.get("parameters", []):
        if parameter.get("description") == NEEDED:
            parameter["required"] = True
            parameter["schema"] = {"type": "string", "minLength": 1, "title": CONTROL}
