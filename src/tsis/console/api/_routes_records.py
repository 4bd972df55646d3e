"""Calls of stored targets, estimates, the calibration and jobs."""

from __future__ import annotations

from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Body, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from tsis.calibration import UsableCalibration
from tsis.calibration.file import calibration_bytes, calibration_sha256, parse_calibration
from tsis.console._statuses import AbsentError, NoControlError, absent_if_unknown
from tsis.console.api import _models_records as models
from tsis.console.api._documented import (
    CALIBRATION_BODY,
    CALIBRATION_FILE,
    OF_BODIES,
    OF_COMMANDS,
    OF_EDITS,
    OF_JOBS,
    OF_RECORDS,
    file,
)
from tsis.console.api._models import AboutResponse, CalibrationItem, CalibrationResponse, StoreItem
from tsis.console.api._responses import (
    CONTROL,
    Acting,
    Caller,
    JobIdentity,
    PageOfList,
    PressIdentity,
    TargetNumber,
    TheInstrument,
    TheReports,
    estimate_item,
    find_press,
    find_target,
    job_result,
)
from tsis.errors import InputError
from tsis.files.images import QUICK_PNG, encode_picture
from tsis.records.provenance import environment
from tsis.records.recomputation import PRIORS

if TYPE_CHECKING:
    from tsis.console.services import Instrument, Job


targets_router = APIRouter(prefix="/targets", tags=["records"])


@targets_router.get("", operation_id="list_targets")
def list_targets(instrument: TheInstrument, page: PageOfList) -> models.TargetsResponse:
    """List the targets of the store by number."""
    result = instrument.store.targets()
    part = result[page.offset : page.offset + page.limit]
    return models.TargetsResponse(
        total=len(result),
        offset=page.offset,
        targets=[models.TargetSummaryItem.model_validate(item) for item in part],
    )


@targets_router.get("/{number}", operation_id="get_target", responses=OF_RECORDS)
def get_target(instrument: TheInstrument, number: TargetNumber) -> models.TargetResponse:
    """Return what is stored of a target."""
    target = find_target(instrument, number)
    return models.TargetResponse(target=target, presses=instrument.store.press_count(target))


@targets_router.patch("/{number}", operation_id="edit_target", responses={**OF_RECORDS, **OF_EDITS, **OF_BODIES})
def edit_target(instrument: TheInstrument, number: TargetNumber, body: models.TargetRequest) -> models.TargetResponse:
    """Change name, note or truth of a target as it was read; 409 when somebody has changed it since.

    The audit of the store records the change and its time.
    """
    target = find_target(instrument, number)
    changes = body.model_dump(exclude={"version"}, exclude_none=True)
    if not changes:
        raise InputError("an edit must change something: name, note or truth; got none of them")
    edited = instrument.store.edit_target(replace(target, version=body.version), **changes)
    return models.TargetResponse(target=edited, presses=instrument.store.press_count(edited))


@targets_router.get("/{number}/presses", operation_id="list_presses", responses=OF_RECORDS)
def list_presses(instrument: TheInstrument, number: TargetNumber, page: PageOfList) -> models.PressesResponse:
    """List presses of a target in the order in which they were taken."""
    target = find_target(instrument, number)
    return models.PressesResponse(
        target=number,
        total=instrument.store.press_count(target),
        offset=page.offset,
        presses=list(instrument.store.presses(target, limit=page.limit, offset=page.offset)),
    )


@targets_router.get(
    "/{number}/presses/{identity}/frame.png",
    operation_id="get_press_frame",
    response_class=Response,
    responses={**file("image/png", "the frame, lossless: grey levels of 8 or 16 bits"), **OF_RECORDS},
)
def get_press_frame(instrument: TheInstrument, number: TargetNumber, identity: PressIdentity) -> Response:
    """Send the stored frame of a press, after a check of its hash; 503 when it is damaged."""
    _, press = find_press(instrument, number, identity)
    content = encode_picture(instrument.store.levels(press.frame), level=QUICK_PNG)
    return Response(content, media_type="image/png", headers={"TSIS-Full-Scale": f"{press.full_scale:g}"})


estimates_router = APIRouter(prefix="/targets/{number}", tags=["records"])


@estimates_router.get("/estimates", operation_id="list_estimates", responses=OF_RECORDS)
def list_estimates(instrument: TheInstrument, number: TargetNumber) -> models.EstimatesResponse:
    """List the estimates of a target, the oldest first."""
    target = find_target(instrument, number)
    record = instrument.store.record(target, limit=0)
    return models.EstimatesResponse(
        target=number,
        in_force=[item.id for item in record.active_estimates],
        estimates=[estimate_item(estimate, target.truth) for estimate in record.estimates],
        damaged=list(record.damaged),
    )


@estimates_router.post(
    "/estimate", operation_id="estimate_target", responses={**OF_RECORDS, **OF_JOBS, **OF_BODIES}, status_code=202
)
def estimate_target(
    instrument: TheInstrument, number: TargetNumber, body: Annotated[models.EstimateRequest, Body()]
) -> models.JobResponse:
    """Estimate a target from its presses and store the estimate, which is the job's result."""
    find_target(instrument, number)
    job = instrument.estimate(number, kind=body.kind, presses=body.presses, options=_options(body))
    return models.JobResponse(job=job.state())


@estimates_router.post(
    "/recompute", operation_id="recompute_target", responses={**OF_RECORDS, **OF_JOBS, **OF_BODIES}, status_code=202
)
def recompute_target(
    instrument: TheInstrument, number: TargetNumber, body: Annotated[models.RecomputeRequest | None, Body()] = None
) -> models.JobResponse:
    """Recompute the current estimates with the present code, and store those that differ."""
    dry_run = body is not None and body.dry_run
    return models.JobResponse(job=instrument.recompute(find_target(instrument, number), dry_run=dry_run).state())


@estimates_router.get(
    "/report.html",
    operation_id="get_report_html",
    response_class=Response,
    responses={**file("text/html", "one page, self-contained"), **OF_RECORDS},
)
def get_report_html(instrument: TheInstrument, reports: TheReports, number: TargetNumber) -> Response:
    """Send the report of a target as a page."""
    return Response(reports.content(find_target(instrument, number), "html"), media_type="text/html")


@estimates_router.get(
    "/report.pdf",
    operation_id="get_report_pdf",
    response_class=Response,
    responses={**file("application/pdf", "the same on paper"), **OF_RECORDS},
)
def get_report_pdf(instrument: TheInstrument, reports: TheReports, number: TargetNumber) -> Response:
    """Send the report of a target as a PDF."""
    return Response(reports.content(find_target(instrument, number), "pdf"), media_type="application/pdf")


def _options(body: models.EstimateRequest) -> dict[str, Any]:
    """Options of a stored estimate: with the whole prior, so that later releases with other defaults have it."""
    options = body.model_dump(exclude={"kind", "presses"}, exclude_none=True)
    if "prior" in options:
        values: dict[str, Any] = {
            name: tuple(item) if isinstance(item, list) else item for name, item in options["prior"].items()
        }
        options["prior"] = asdict(PRIORS[body.kind](**values))
    return options


calibration_router = APIRouter(prefix="/calibration", tags=["calibration"])
LARGEST_UPLOAD = 32 * 2**20  # bytes


@calibration_router.get("", operation_id="get_calibration")
def get_calibration(instrument: TheInstrument) -> CalibrationResponse:
    """Return the active calibration."""
    return _active(instrument)


@calibration_router.get(
    "/file", operation_id="get_calibration_file", response_class=Response, responses={**CALIBRATION_FILE, **OF_RECORDS}
)
def get_calibration_file(instrument: TheInstrument) -> Response:
    """Send the active calibration as its file, which `PUT /v1/calibration` accepts."""
    given = instrument.calibration
    if given is None:
        raise AbsentError("a calibration must be active to be sent; there is none")
    return Response(calibration_bytes(given.calibration), media_type="application/json")


@calibration_router.put(
    "", operation_id="use_calibration", responses={**OF_COMMANDS, **OF_BODIES}, openapi_extra=CALIBRATION_BODY
)
async def use_calibration(request: Request, instrument: TheInstrument, by: Acting) -> CalibrationResponse:
    """Activate a calibration: the body is a calibration file of at most 32 MiB.

    Answers 422 when it was changed, is expired, or is of another camera or other settings than those that run.
    """
    content = await _uploaded(request)
    await run_in_threadpool(_use, instrument, content, by)
    return _active(instrument)


@calibration_router.delete("", operation_id="forget_calibration", responses=OF_COMMANDS)
def forget_calibration(instrument: TheInstrument, by: Acting) -> CalibrationResponse:
    """Go back to the virtual probe's own calibration, or to none."""
    instrument.use_calibration(None, by=by)
    return _active(instrument)


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


def _use(instrument: Instrument, content: bytes, by: str) -> None:
    calibration = parse_calibration(content, "the calibration")
    calibration.require_usable(datetime.now(UTC))
    instrument.use_calibration(
        UsableCalibration(calibration=calibration, identity=calibration_sha256(calibration)), by=by
    )


def _active(instrument: Instrument) -> CalibrationResponse:
    active = instrument.calibration
    if active is None:
        return CalibrationResponse(calibration=None)
    given = active.calibration
    item = CalibrationItem(
        name=given.name, probe=given.probe, sha256=active.identity, made=given.made, expires=given.expires
    )
    return CalibrationResponse(calibration=item)


jobs_router = APIRouter(prefix="/jobs", tags=["jobs"])


@jobs_router.get("", operation_id="list_jobs")
def list_jobs(instrument: TheInstrument) -> models.JobsResponse:
    """List the last jobs of this console, the newest last."""
    return models.JobsResponse(jobs=instrument.jobs.states())


@jobs_router.get("/{identity}", operation_id="get_job", responses=OF_RECORDS)
def get_job(instrument: TheInstrument, identity: JobIdentity) -> models.JobResponse:
    """Return the state of a job, and its result."""
    return _job_response(instrument, _job(instrument, identity))


@jobs_router.delete("/{identity}", operation_id="end_job", responses={**OF_RECORDS, **OF_COMMANDS})
def end_job(instrument: TheInstrument, identity: JobIdentity, caller: Caller = None) -> models.JobResponse:
    """Cancel a job, which ends at its next step; a job of the camera only for its owner."""
    job = _job(instrument, identity)
    if job.follows_camera and not caller:
        raise NoControlError(f"cancelling a job of the camera needs the header {CONTROL}, which POST /v1/control gives")
    instrument.end_job(identity, by=caller or "")
    return _job_response(instrument, job)


def _job(instrument: Instrument, identity: str) -> Job:
    with absent_if_unknown():
        return instrument.jobs.get(identity)


def _job_response(instrument: Instrument, job: Job) -> models.JobResponse:
    return models.JobResponse(job=job.state(), result=job_result(job.result, instrument.store))


about_router = APIRouter(tags=["about"])


@about_router.get("/about", operation_id="get_about")
def get_about(instrument: TheInstrument) -> AboutResponse:
    """Return versions, and where records and files are stored."""
    store = instrument.store
    return AboutResponse(
        environment=environment(),
        store=StoreItem(folder=str(store.folder.resolve()), kind=store.kind, identity=store.identity),
        workspace=str(instrument.terms.workspace.resolve()),
    )
