"""The calibration in force."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from tsis.calibration import ProbeCalibration
from tsis.calibration.cited import UsableCalibration
from tsis.calibration.file import calibration_bytes, calibration_sha256, parse_calibration
from tsis.console.api.asking import Acting, TheBench
from tsis.console.api.documented import CALIBRATION_BODY, CALIBRATION_FILE, OF_ACTS, OF_BODIES, OF_RECORDS
from tsis.console.api.errors import AbsentError
from tsis.console.api.models.about import CalibrationAnswer, CalibrationTold

if TYPE_CHECKING:
    from tsis.console.bench import Bench

calibration_router = APIRouter(prefix="/calibration", tags=["calibration"])
LARGEST_UPLOAD = 32 * 2**20  # bytes


@calibration_router.get("", operation_id="get_calibration")
def get_calibration(bench: TheBench) -> CalibrationAnswer:
    """Tell which calibration is in force."""
    return _answer(bench)


@calibration_router.get(
    "/file", operation_id="get_calibration_file", response_class=Response, responses={**CALIBRATION_FILE, **OF_RECORDS}
)
def get_calibration_file(bench: TheBench) -> Response:
    """Send the calibration in force as its file, which `PUT /v1/calibration` takes again."""
    known = bench.calibration
    if known is None:
        raise AbsentError("a calibration must be in force to be sent; there is none")
    return Response(calibration_bytes(known.known), media_type="application/json")


@calibration_router.put(
    "", operation_id="use_calibration", responses={**OF_ACTS, **OF_BODIES}, openapi_extra=CALIBRATION_BODY
)
async def use_calibration(request: Request, bench: TheBench, by: Acting) -> CalibrationAnswer:
    """Put a calibration in force: the body is a calibration file of at most 32 MiB.

    Answers 422 when it was changed, is expired, or is of another camera or other settings than those that run.
    """
    content = await _uploaded(request)
    await run_in_threadpool(_use, bench, content, by)
    return _answer(bench)


@calibration_router.delete("", operation_id="forget_calibration", responses=OF_ACTS)
def forget_calibration(bench: TheBench, by: Acting) -> CalibrationAnswer:
    """Go back to the virtual probe's own calibration, or to none."""
    bench.use_calibration(None, by=by)
    return _answer(bench)


async def _uploaded(request: Request) -> bytes:
    if request.headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
        raise HTTPException(415, "a calibration file must be sent as application/json")
    content = bytearray()
    try:
        async for piece in request.stream():
            content += piece
            if len(content) > LARGEST_UPLOAD:
                raise HTTPException(413, f"a calibration file must take at most {LARGEST_UPLOAD} bytes; got more")
    except ClientDisconnect as error:
        raise HTTPException(400, "the calibration file must come whole; the connection ended before") from error
    return bytes(content)


def _use(bench: Bench, content: bytes, by: str) -> None:
    known = parse_calibration(content, "the calibration")
    known.require_usable(datetime.now(UTC))
    bench.use_calibration(UsableCalibration(known=known, identity=calibration_sha256(known)), by=by)


def _answer(bench: Bench) -> CalibrationAnswer:
    cited = bench.calibration
    return CalibrationAnswer(calibration=None if cited is None else _told(cited.known, cited.identity))


def _told(known: ProbeCalibration, sha256: str) -> CalibrationTold:
    return CalibrationTold(name=known.name, probe=known.probe, sha256=sha256, made=known.made, expires=known.expires)
