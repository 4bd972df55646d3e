"""Calls of the instrument: state, control, camera, press and frames."""

from __future__ import annotations

import uuid
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

from fastapi import APIRouter, Body, Query, Response

from tsis.console.api import _models_camera as models
from tsis.console.api._documented import OF_BODIES, OF_COMMANDS, OF_CONTROL, OF_JOBS, picture
from tsis.console.api._models import ControlRequest, ControlResponse, OwnerItem
from tsis.console.api._models_records import (
    FilesItem,
    JobResponse,
    SavedPressResponse,
    SequenceOfFrames,
    SequenceOfSeconds,
    SnapshotRequest,
)
from tsis.console.api._responses import Acting, Caller, TheInstrument
from tsis.console.live import display_levels
from tsis.console.services import CameraChoice, Instrument
from tsis.errors import CameraError, InputError
from tsis.files.images import QUICK_PNG, encode_picture
from tsis.instrument import whole_levels
from tsis.model.require import require_one_of
from tsis.records.values import require_label

if TYPE_CHECKING:
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
    result = instrument.search.findings
    if result is None:
        return models.CamerasResponse(searched=False, found=(), missing={})
    return models.CamerasResponse(searched=True, found=result.cameras, missing=dict(result.missing))


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
