"""The camera: found, chosen, started, stopped, adjusted."""

from __future__ import annotations

from fastapi import APIRouter

from tsis.console.api.asking import Acting, TheBench
from tsis.console.api.documented import OF_ACTS, OF_BODIES
from tsis.console.api.models.camera import (
    CameraChoiceGiven,
    PresetGiven,
    SettingsAnswer,
    SettingsGiven,
    SettingTold,
)
from tsis.console.api.models.state import StateAnswer
from tsis.console.api.routes.state import state_answer
from tsis.console.bench import Bench, CameraChoice
from tsis.model.check import require_one_of
from tsis.model.errors import CameraError

camera_router = APIRouter(prefix="/camera", tags=["camera"])


@camera_router.put("", operation_id="choose_camera", responses={**OF_ACTS, **OF_BODIES})
def choose_camera(bench: TheBench, given: CameraChoiceGiven, by: Acting) -> StateAnswer:
    """Take another camera, not yet started."""
    bench.choose(CameraChoice(**given.model_dump()), by=by)
    return state_answer(bench, by)


@camera_router.post("/start", operation_id="start_camera", responses=OF_ACTS)
def start_camera(bench: TheBench, by: Acting) -> StateAnswer:
    """Connect and begin to stream; when it runs already, nothing happens."""
    bench.start(by=by)
    return state_answer(bench, by)


@camera_router.post("/stop", operation_id="stop_camera", responses=OF_ACTS)
def stop_camera(bench: TheBench, by: Acting) -> StateAnswer:
    """End the stream; settings are remembered for the next start."""
    bench.stop(by=by)
    return state_answer(bench, by)


@camera_router.get("/settings", operation_id="get_settings")
def get_settings(bench: TheBench) -> SettingsAnswer:
    """Tell what can be adjusted now, with ranges; null for an end that the driver does not tell."""
    return _settings(bench)


@camera_router.patch("/settings", operation_id="change_settings", responses={**OF_ACTS, **OF_BODIES})
def change_settings(bench: TheBench, given: SettingsGiven, by: Acting) -> SettingsAnswer:
    """Change settings; none when one of them is unknown or outside its range."""
    present = {each.name: each for each in bench.desk.settings()}
    if not present:
        raise CameraError("the camera must run to be adjusted; it is stopped or away (start it)")
    for name, value in given.values.items():
        present[require_one_of("setting", name, present)].checked(value)
    for name, value in given.values.items():
        bench.adjust(name, value, by=by)
    return _settings(bench)


@camera_router.post("/preset", operation_id="apply_preset", responses={**OF_ACTS, **OF_BODIES})
def apply_preset(bench: TheBench, given: PresetGiven, by: Acting) -> SettingsAnswer:
    """Make all settings of a preset."""
    bench.preset(given.name, by=by)
    return _settings(bench)


def _settings(bench: Bench) -> SettingsAnswer:
    return SettingsAnswer(settings=[SettingTold.model_validate(each) for each in bench.desk.settings()])
