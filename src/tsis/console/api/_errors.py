"""Error responses: one message, the kind of the error, and its status."""

from __future__ import annotations

import math
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from tsis import errors
from tsis.console._statuses import status_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fastapi import FastAPI
    from starlette.requests import Request


LONGEST = 1000  # letters of a message


MESSAGES = {
    HTTPStatus.NOT_FOUND: "there is nothing at this address; /api/openapi.json lists the calls",
    HTTPStatus.METHOD_NOT_ALLOWED: "this address does not take that method; the header Allow names those that it takes",
    HTTPStatus.BAD_REQUEST: "the body must be JSON in UTF-8 that is not nested too deep and holds no endless number",
}


def install_error_handlers(application: FastAPI) -> None:
    """Have errors of an application's own routes answered as ``{"error": message, "kind": class}``."""
    application.add_exception_handler(errors.TsisError, _of_tsis)
    application.add_exception_handler(RequestValidationError, _of_request)
    application.add_exception_handler(HTTPException, _of_http)
    application.add_exception_handler(Exception, _of_program)


def problem(status: int, message: str, kind: str, headers: Any = None) -> JSONResponse:
    """The response."""
    # A message may quote what was received, control characters and halves of letters included.
    text = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in message)
    shown = text if len(text) <= LONGEST else f"{text[: LONGEST - 1]}…"
    return JSONResponse({"error": shown, "kind": kind}, status, headers=headers)


def kind_of(error: errors.TsisError) -> str:
    """The name of its class, one of `tsis.errors`."""
    return next(item.__name__ for item in type(error).__mro__ if item.__module__ == errors.__name__)


def message_of(faults: Sequence[Any]) -> str:
    """What is wrong with a request, from the first thing that pydantic found: name, requirement, value received."""
    first = faults[0]
    where, *names = (str(item) for item in first["loc"])
    name = ".".join(names) if names and first["type"] != "json_invalid" else f"the {where}"
    requirement = str(first["msg"]).removeprefix("Value error, ")
    more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
    if first["type"] == "json_invalid":
        return f"{name} must be JSON: {first.get('ctx', {}).get('error', requirement)}{more}"
    if first["type"] == "missing":
        return f"{name} must be given{more}"
    return f"{name}: {requirement[:1].lower()}{requirement[1:]}; got {_shown(first.get('input'))}{more}"


def _of_tsis(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, errors.TsisError)
    return problem(status_of(error), str(error), kind_of(error))


def _of_request(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    if isinstance(error.errors()[0].get("input"), bytes):  # FastAPI has not read it as JSON
        return problem(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
            "the body must be sent with the header Content-Type: application/json",
            HTTPException.__name__,
        )
    return problem(HTTPStatus.UNPROCESSABLE_ENTITY, message_of(error.errors()), RequestValidationError.__name__)


def _of_http(_: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, HTTPException)
    message = MESSAGES.get(HTTPStatus(error.status_code), str(error.detail))
    return problem(error.status_code, message, HTTPException.__name__, error.headers)


def _of_program(_: Request, error: Exception) -> JSONResponse:
    return problem(
        HTTPStatus.INTERNAL_SERVER_ERROR, f"the console failed at this: {type(error).__name__}", "ProgramError"
    )


def _shown(value: Any) -> str:
    """A value in a few letters; of long lists and mappings only what they are."""
    if isinstance(value, str):
        return repr(value[:80])
    if isinstance(value, int) and not isinstance(value, bool) and value.bit_length() > 64:
        return f"a number of about {value.bit_length() * math.log10(2):.0f} digits"
    if value is None or isinstance(value, (bool, int, float)):
        return repr(value)
    return {"dict": "an object", "list": "a list", "bytes": "bytes"}.get(type(value).__name__, type(value).__name__)
