"""How the bench is, and what its newest frame shows."""

from __future__ import annotations

from dataclasses import asdict

from fastapi import APIRouter

from tsis.console.api.asking import Caller, TheBench
from tsis.console.api.models.camera import CameraTold
from tsis.console.api.models.control import HolderTold
from tsis.console.api.models.jobs import JobTold
from tsis.console.api.models.sight import SightAnswer, SightTold
from tsis.console.api.models.state import StateAnswer
from tsis.console.bench import Bench

state_router = APIRouter(tags=["state"])


@state_router.get("/state", operation_id="get_state")
def get_state(bench: TheBench, caller: Caller = None) -> StateAnswer:
    """Tell how camera, target, press, calibration and jobs are; with the header it keeps the camera held."""
    if caller:
        bench.control.heard_of(caller)
    return state_answer(bench, caller)


@state_router.get("/sight", operation_id="get_sight")
def get_sight(bench: TheBench) -> SightAnswer:
    """Tell what the newest frame shows: contact, force, stillness, flags, grey histogram and exposure."""
    sight = bench.sight
    return SightAnswer(sight=None if sight is None else SightTold.model_validate(sight))


def state_answer(bench: Bench, caller: str | None) -> StateAnswer:
    """The whole state; what identifies the holder is told to nobody."""
    state = bench.state()
    held = state.holder
    return StateAnswer(
        camera=CameraTold.model_validate(state.camera),
        target=state.target,
        role=state.role,
        roles=list(state.roles),
        force_n=0.0 if state.lifted else state.force_n,
        calibration=state.calibration,
        calibration_identity=state.calibration_identity,
        sight=None if state.sight is None else SightTold.model_validate(state.sight),
        holder=None if held is None else HolderTold(name=held.name, yours=held.identity == caller),
        sequence=None if state.sequence is None else JobTold(**asdict(state.sequence)),
        jobs=[JobTold(**asdict(job)) for job in state.jobs],
        trouble=list(state.trouble),
        busy=state.busy,
        gauge=state.gauge,
    )
