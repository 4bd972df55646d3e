"""The description of the calls, as OpenAPI: what generated clients and tests read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi.openapi.utils import get_openapi

from tsis.calibration.file import CALIBRATION_FORMAT, CALIBRATION_VERSION
from tsis.console.api._models import Problem
from tsis.console.api._responses import CONTROL, NEEDED
from tsis.console.api._value_schemas import describe_values

if TYPE_CHECKING:
    from fastapi import FastAPI


def description(application: FastAPI) -> dict[str, Any]:
    """The description of an application's calls; built once.

    FastAPI takes the header of commands for optional, since a request without it gets our own message.
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
        describe_values(schema["components"]["schemas"])
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


Responses = dict[int | str, dict[str, Any]]


def _binary(kind: str) -> dict[str, Any]:
    return {kind: {"schema": {"type": "string", "format": "binary"}}}


def picture(kind: str) -> Responses:
    """A response that is a picture of the newest frame."""
    headers = {
        "TSIS-Frame": {"description": "number of the frame since the start", "schema": {"type": "integer"}},
        "TSIS-Full-Scale": {"description": "grey level at which the camera clips", "schema": {"type": "number"}},
    }
    return {200: {"description": "the picture", "content": _binary(kind), "headers": headers}}


def file(kind: str, text: str) -> Responses:
    """A response that is a file."""
    return {200: {"description": text, "content": _binary(kind)}}


CALIBRATION_FILE: Responses = {
    200: {"description": "the file", "content": {"application/json": {"schema": {"type": "object"}}}}
}
CALIBRATION_BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {
            "application/json": {
                "schema": {
                    "title": "CalibrationFile",
                    "type": "object",
                    "required": ["format", "version", "sha256", "calibration"],
                    "properties": {
                        "format": {"const": CALIBRATION_FORMAT},
                        "version": {"const": CALIBRATION_VERSION},
                        "sha256": {"type": "string", "description": "SHA-256 of the content"},
                        "calibration": {"type": "object"},
                    },
                }
            }
        },
    }
}

_TEXT = {"text/plain": {"schema": {"type": "string"}}}


def _problem(text: str) -> dict[str, Any]:
    return {"model": Problem, "description": text}


OF_CALLS: Responses = {  # 400, 401, 403, 413 and 421 also by the authentication before all calls, as plain text
    400: {**_problem("malformed, or no readable JSON"), "content": _TEXT},
    401: {"description": "no key: send Authorization: Bearer with the token of the printed address", "content": _TEXT},
    403: {"description": "sent by a page of another site", "content": _TEXT},
    413: {**_problem("too large"), "content": _TEXT},
    421: {"description": "the console is not called by that name", "content": _TEXT},
    422: _problem("a value outside what the call accepts"),
    503: _problem("the camera is stopped or away, or a stored file is damaged or cannot be read or written"),
}
OF_BODIES: Responses = {415: _problem("not sent as JSON")}
OF_COMMANDS: Responses = {
    409: _problem("somebody else owns the camera, or it cannot be done at this moment"),
    428: _problem("the header TSIS-Control is missing"),
    501: _problem("a library is not installed that this camera needs"),
    507: _problem("the disk is full"),
}
OF_CONTROL: Responses = {409: _problem("somebody else owns the camera")}
OF_RECORDS: Responses = {404: _problem("the address names nothing that exists")}
OF_JOBS: Responses = {409: _problem("too many jobs wait already")}
OF_EDITS: Responses = {
    409: _problem("somebody has changed the record since it was read"),
    507: _problem("the disk is full"),
}
