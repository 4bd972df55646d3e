"""What every call answers: errors, models of stored values, and the description of the calls."""

from __future__ import annotations

import math
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Depends, Header, Path, Query
from fastapi.exceptions import RequestValidationError
from fastapi.openapi.utils import get_openapi
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.requests import Request

from tsis import errors
from tsis.__about__ import LARGEST_TARGET
from tsis.calibration.file import CALIBRATION_FORMAT, CALIBRATION_VERSION
from tsis.console.api import models
from tsis.console.api.models import Problem, describe_values
from tsis.console.files import Reports
from tsis.console.services.instrument import Instrument
from tsis.console.statuses import NoControlError, absent_if_unknown, status_of
from tsis.instrument.discovery import CameraListing
from tsis.instrument.recording import RecordingReport
from tsis.present.document import stored_document
from tsis.records.recomputation import Recomputation
from tsis.records.values import StoredEstimate

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from fastapi import FastAPI

    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


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


def estimate_item(stored: StoredEstimate, truth: Mapping[str, float]) -> models.EstimateItem:
    """A stored estimate with the truth beside its parameters, where all of them are known."""
    return models.EstimateItem(**stored_document(stored, truth))


def job_result(result: Any, store: Store) -> models.JobResult | None:
    """What a job returned; None before it is done, and where the pages alone know what it is."""
    match result:
        case StoredEstimate():
            truths = (target.target.truth for target in store.targets() if target.target.id == result.target)
            return models.EstimateResult(estimate=estimate_item(result, next(truths, {})))
        case CameraListing():
            return models.SearchResult(found=result.cameras, missing=dict(result.missing))
        case (Recomputation(), *_):
            return models.RecomputeResult(recomputations=[_recomputation(item) for item in result])
        case {"folder": str(folder), "report": dict(report)}:
            return models.SequenceResult(folder=folder, report=RecordingReport(**report))
        case _:
            return None


def _recomputation(item: Recomputation) -> models.RecomputationItem:
    return models.RecomputationItem(
        kind=item.before.kind,
        same=item.same,
        sentence=item.message,
        causes=list(item.causes),
        notes=list(item.notes),
        shifts=item.shifts,
        flags_gained=list(item.flags_gained),
        flags_lost=list(item.flags_lost),
        before=item.before.id,
        stored_as=item.after.id if item.stored else None,
    )


CONTROL = "TSIS-Control"
MOST_A_PAGE, MOST_OFFSET = 1000, 10**12
TargetNumber = Annotated[int, Path(ge=1, le=LARGEST_TARGET, description="number of a target", examples=[1])]
PressIdentity = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="identity of a press")]
JobIdentity = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="identity of a job")]
NEEDED = "identity that POST /v1/control gave; without it 428"
Caller = Annotated[str | None, Header(alias=CONTROL, description="identity that POST /v1/control gave")]
ActingCaller = Annotated[str | None, Header(alias=CONTROL, description=NEEDED)]


class PageQuery(BaseModel):
    """Which part of a long list."""

    model_config = ConfigDict(extra="forbid")

    limit: int = Field(default=100, ge=1, le=MOST_A_PAGE, description="most that are listed")
    offset: int = Field(default=0, ge=0, le=MOST_OFFSET, description="how many are skipped before")


PageOfList = Annotated[PageQuery, Query()]


async def instrument_of(request: Request) -> Instrument:
    """The instrument of the application."""
    instrument: Any = request.app.state.instrument
    assert isinstance(instrument, Instrument)
    return instrument


async def reports_of(request: Request) -> Reports:
    """Reports of the instrument's store."""
    reports: Any = request.app.state.reports
    assert isinstance(reports, Reports)
    return reports


TheInstrument = Annotated[Instrument, Depends(instrument_of)]
TheReports = Annotated[Reports, Depends(reports_of)]


async def owner(instrument: TheInstrument, identity: ActingCaller = None) -> str:
    """The owner of the camera's control; 428 without the header, 409 for anybody else."""
    if not identity:
        raise NoControlError(f"this call needs the header {CONTROL} with the identity that POST /v1/control gives")
    instrument.control.require(identity)
    return identity


Acting = Annotated[str, Depends(owner)]


def find_target(instrument: Instrument, number: int) -> Target:
    """The target of that number; `AbsentError` when there is none."""
    with absent_if_unknown():
        return instrument.store.target(number)


def find_press(instrument: Instrument, number: int, identity: str) -> tuple[Target, StoredPress]:
    """A press of a target; `AbsentError` when there is none."""
    target = find_target(instrument, number)
    with absent_if_unknown():
        return target, instrument.store.press(target, identity)


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
