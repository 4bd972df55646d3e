"""The calls: instrument, frames, records, estimates, calibration and jobs."""

from __future__ import annotations

import uuid
from dataclasses import asdict, replace
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import APIRouter, Body, Query, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from tsis.calibration.file import calibration_bytes, calibration_sha256, parse_calibration
from tsis.calibration.frames import UsableCalibration
from tsis.console.api import models
from tsis.console.api.models import (
    AboutResponse,
    CalibrationItem,
    CalibrationResponse,
    ControlRequest,
    ControlResponse,
    FilesItem,
    JobResponse,
    OwnerItem,
    SavedPressResponse,
    SequenceOfFrames,
    SequenceOfSeconds,
    SnapshotRequest,
    StoreItem,
)
from tsis.console.api.responses import (
    CALIBRATION_BODY,
    CALIBRATION_FILE,
    CONTROL,
    OF_BODIES,
    OF_COMMANDS,
    OF_CONTROL,
    OF_EDITS,
    OF_JOBS,
    OF_RECORDS,
    Acting,
    Caller,
    JobIdentity,
    PageOfList,
    PressIdentity,
    TargetNumber,
    TheInstrument,
    TheReports,
    estimate_item,
    file,
    find_press,
    find_target,
    job_result,
    picture,
)
from tsis.console.live.hub import display_levels
from tsis.console.services.choice import CameraChoice
from tsis.console.services.instrument import Instrument
from tsis.console.statuses import AbsentError, NoControlError, absent_if_unknown
from tsis.errors import CameraError, InputError
from tsis.files.images import QUICK_PNG, encode_picture
from tsis.instrument.image_files import whole_levels
from tsis.model.require import require_one_of
from tsis.present.lump_map import stored_map_document
from tsis.records.provenance import environment
from tsis.records.recomputation import PRIORS
from tsis.records.values import require_label

if TYPE_CHECKING:
    from tsis.console.services.jobs import Job
    from tsis.instrument.acquisition import ReceivedFrame


state_router = APIRouter(tags=["state"])


@state_router.get("/state", operation_id="get_state")
def get_state(instrument: TheInstrument, caller: Caller = None) -> models.StateResponse:
    """Return the state of camera, target, press, calibration and jobs; with the header a sign of life of the owner."""
    if caller:
        instrument.control.heard_of(caller)
    return state_response(instrument, caller)


@state_router.get("/sight", operation_id="get_sight")
def get_frame_analysis(instrument: TheInstrument) -> models.FrameAnalysisResponse:
    """Return the analysis of the newest frame: contact, force, stillness, flags, grey histogram and exposure."""
    return models.FrameAnalysisResponse(sight=instrument.frame_analysis)


def state_response(instrument: Instrument, caller: str | None) -> models.StateResponse:
    """The whole state; the owner's identity is a secret."""
    state = instrument.state()
    owner = state.owner
    return models.StateResponse(
        camera=state.camera,
        target=state.target,
        role=state.role,
        roles=list(state.roles),
        force_n=0.0 if state.lifted else state.force_n,
        calibration=state.calibration,
        calibration_identity=state.calibration_identity,
        sight=state.frame_analysis,
        holder=None if owner is None else OwnerItem(name=owner.name, yours=owner.identity == caller),
        sequence=state.sequence,
        jobs=state.jobs,
        trouble=list(state.trouble),
        busy=state.busy,
        gauge=state.gauge,
    )


camera_router = APIRouter(prefix="/camera", tags=["camera"])


@camera_router.put("", operation_id="choose_camera", responses={**OF_COMMANDS, **OF_BODIES})
def choose_camera(instrument: TheInstrument, body: models.CameraChoiceRequest, by: Acting) -> models.StateResponse:
    """Choose another camera, not yet started."""
    instrument.choose(CameraChoice(**body.model_dump()), by=by)
    return state_response(instrument, by)


@camera_router.post("/start", operation_id="start_camera", responses=OF_COMMANDS)
def start_camera(instrument: TheInstrument, by: Acting) -> models.StateResponse:
    """Connect and begin to stream; when it runs already, nothing happens."""
    instrument.start(by=by)
    return state_response(instrument, by)


@camera_router.post("/stop", operation_id="stop_camera", responses=OF_COMMANDS)
def stop_camera(instrument: TheInstrument, by: Acting) -> models.StateResponse:
    """End the stream; settings are remembered for the next start."""
    instrument.stop(by=by)
    return state_response(instrument, by)


@camera_router.get("/settings", operation_id="get_settings")
def get_settings(instrument: TheInstrument) -> models.SettingsResponse:
    """Return the adjustable settings with ranges; null for an end that the driver does not report."""
    return _settings(instrument)


@camera_router.patch("/settings", operation_id="change_settings", responses={**OF_COMMANDS, **OF_BODIES})
def change_settings(instrument: TheInstrument, body: models.SettingsRequest, by: Acting) -> models.SettingsResponse:
    """Change settings; none when one of them is unknown or outside its range."""
    present = {setting.name: setting for setting in instrument.camera_controller.settings()}
    if not present:
        raise CameraError("the camera must run to be adjusted; it is stopped or away (start it)")
    for name, value in body.values.items():
        present[require_one_of("setting", name, present)].checked(value)
    for name, value in body.values.items():
        instrument.adjust(name, value, by=by)
    return _settings(instrument)


@camera_router.post("/preset", operation_id="apply_preset", responses={**OF_COMMANDS, **OF_BODIES})
def apply_preset(instrument: TheInstrument, body: models.PresetRequest, by: Acting) -> models.SettingsResponse:
    """Apply all settings of a preset."""
    instrument.preset(body.name, by=by)
    return _settings(instrument)


def _settings(instrument: Instrument) -> models.SettingsResponse:
    return models.SettingsResponse(settings=instrument.camera_controller.settings())


cameras_router = APIRouter(prefix="/cameras", tags=["camera"])


@cameras_router.get("", operation_id="list_cameras")
def list_cameras(instrument: TheInstrument) -> models.CamerasResponse:
    """List the cameras that the last search found; the virtual probe is always there."""
    findings = instrument.search.findings
    if findings is None:
        return models.CamerasResponse(searched=False, found=(), missing={})
    return models.CamerasResponse(searched=True, found=findings.cameras, missing=dict(findings.missing))


@cameras_router.post("/search", operation_id="search_cameras", responses=OF_JOBS, status_code=202)
def search_cameras(instrument: TheInstrument) -> JobResponse:
    """Ask every source for its cameras, which takes seconds; the job's result lists them."""
    return JobResponse(job=instrument.search.begin().state())


control_router = APIRouter(tags=["control"])


@control_router.post("/control", operation_id="take_control", responses={**OF_CONTROL, **OF_BODIES})
async def take_control(instrument: TheInstrument, body: ControlRequest, caller: Caller = None) -> ControlResponse:
    """Take control of the camera; its owner keeps the identity that the header gives.

    It ends after `held_s` seconds without a sign of life: commands, and `GET /v1/state` with the header. Answers 409
    when somebody else has it and `over` is false.
    """
    require_label("name", body.name)
    owner = instrument.control.owner()
    identity = owner.identity if owner is not None and owner.identity == caller else uuid.uuid4().hex
    instrument.control.take(identity, body.name, over=body.over, held_s=body.held_s)
    return ControlResponse(identity=identity, name=body.name, held_s=body.held_s)


@control_router.delete("/control", operation_id="release_control", status_code=204)
async def release_control(instrument: TheInstrument, caller: Caller = None) -> Response:
    """Release the camera; from anybody but the owner it changes nothing."""
    if caller:
        instrument.control.release(caller)
    return Response(status_code=204)


press_router = APIRouter(tags=["press"])


@press_router.put("/target", operation_id="choose_target", responses={**OF_COMMANDS, **OF_BODIES})
def choose_target(instrument: TheInstrument, body: models.TargetChoiceRequest, by: Acting) -> models.StateResponse:
    """Choose the target that snapshots go to; it is entered with its first press."""
    instrument.set_target(body.number, by=by)
    return state_response(instrument, by)


@press_router.put("/press", operation_id="hold_press", responses={**OF_COMMANDS, **OF_BODIES})
def set_press(instrument: TheInstrument, body: models.PressRequest, by: Acting) -> models.StateResponse:
    """Set what is pressed and how hard; the virtual probe moves there."""
    if not body.model_fields_set:
        raise InputError("press must say something: role, force_n or both; got neither")
    forget = "force_n" in body.model_fields_set and body.force_n is None
    instrument.hold(role=body.role, force_n=body.force_n, forget=forget, by=by)
    return state_response(instrument, by)


@press_router.post("/snapshot", operation_id="take_snapshot", responses={**OF_COMMANDS, **OF_BODIES}, status_code=201)
def take_snapshot(
    instrument: TheInstrument, by: Acting, body: Annotated[SnapshotRequest | None, Body()] = None
) -> SavedPressResponse:
    """Save the present press: its files, and the press in the store; both are on the disk with the response."""
    saved = instrument.snapshot(by=by, map_name=(body or SnapshotRequest()).map_name)
    files = {name: str(path.resolve()) for name, path in asdict(saved.files).items()}
    return SavedPressResponse(
        target=saved.target.number,
        press=saved.press,
        files=FilesItem(**files),
        flags=saved.flags,
        notes=list(saved.notes),
    )


@press_router.post("/sequence", operation_id="begin_sequence", responses={**OF_COMMANDS, **OF_BODIES}, status_code=202)
def begin_sequence(instrument: TheInstrument, body: SequenceOfSeconds | SequenceOfFrames, by: Acting) -> JobResponse:
    """Record every frame until so many have come or so much time has passed."""
    job = instrument.begin_sequence(**body.model_dump(), by=by)
    return JobResponse(job=job.state())


@press_router.delete("/sequence", operation_id="end_sequence", responses=OF_COMMANDS)
def end_sequence(instrument: TheInstrument, by: Acting) -> models.StateResponse:
    """End the running sequence; recorded frames stay. Without one nothing happens."""
    instrument.end_sequence(by=by)
    return state_response(instrument, by)


frames_router = APIRouter(tags=["frames"])
Quality = Annotated[int, Query(ge=1, le=100, description="of JPEG")]


@frames_router.get("/frame.png", operation_id="get_frame_png", response_class=Response, responses=picture("image/png"))
def get_frame_png(instrument: TheInstrument) -> Response:
    """Send the newest frame, lossless: grey levels of 8 bits, or 16 where the camera has more.

    It was begun after the last change of a setting or a press. Answers 503 while the camera is stopped or away.
    """
    received = instrument.camera_controller.fresh()
    levels = whole_levels(received.frame.pixels, received.frame.full_scale)
    return _sent(received, encode_picture(levels, level=QUICK_PNG), "image/png")


@frames_router.get("/frame.jpg", operation_id="get_frame_jpg", response_class=Response, responses=picture("image/jpeg"))
def get_frame_jpg(instrument: TheInstrument, quality: Quality = 85) -> Response:
    """Send the newest frame as a small picture of 8 bits."""
    received = instrument.camera_controller.fresh()
    content = encode_picture(display_levels(received), "jpg", quality=quality)
    return _sent(received, content, "image/jpeg")


def _sent(received: ReceivedFrame, content: bytes, kind: str) -> Response:
    headers = {"TSIS-Frame": str(received.frame.sequence), "TSIS-Full-Scale": f"{received.frame.full_scale:g}"}
    return Response(content, media_type=kind, headers=headers)


targets_router = APIRouter(prefix="/targets", tags=["records"])


@targets_router.get("", operation_id="list_targets")
def list_targets(instrument: TheInstrument, page: PageOfList) -> models.TargetsResponse:
    """List the targets of the store by number."""
    summaries = instrument.store.targets()
    part = summaries[page.offset : page.offset + page.limit]
    return models.TargetsResponse(
        total=len(summaries),
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
    """List the estimates and maps of a target, the oldest first."""
    target = find_target(instrument, number)
    record = instrument.store.record(target, limit=0)
    return models.EstimatesResponse(
        target=number,
        in_force=[item.id for item in record.active_results],
        estimates=[estimate_item(estimate, target.truth) for estimate in record.estimates],
        maps=[models.MapItem(**stored_map_document(found)) for found in record.maps],
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
    usable = instrument.calibration
    if usable is None:
        raise AbsentError("a calibration must be active to be sent; there is none")
    return Response(calibration_bytes(usable.calibration), media_type="application/json")


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
    calibration = active.calibration
    item = CalibrationItem(
        name=calibration.name,
        probe=calibration.probe,
        sha256=active.identity,
        made=calibration.made,
        expires=calibration.expires,
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
