"""Who holds the camera: one acts, everybody else watches."""

from __future__ import annotations

import uuid

from fastapi import APIRouter, Response

from tsis.console.api.asking import Caller, TheBench
from tsis.console.api.documented import OF_BODIES, OF_CONTROL
from tsis.console.api.models.control import ControlAnswer, ControlGiven
from tsis.records.values import require_label

control_router = APIRouter(tags=["control"])


@control_router.post("/control", operation_id="take_control", responses={**OF_CONTROL, **OF_BODIES})
async def take_control(bench: TheBench, given: ControlGiven, caller: Caller = None) -> ControlAnswer:
    """Hold the camera; who holds it already, and says so by the header, keeps the identity.

    It is held until nothing was heard of the holder for `held_s` seconds: acts and `GET /v1/state` with the header
    count. Answers 409 when somebody else holds it and `over` is false.
    """
    require_label("name", given.name)
    held = bench.control.holder()
    identity = held.identity if held is not None and held.identity == caller else uuid.uuid4().hex
    bench.control.take(identity, given.name, over=given.over, held_s=given.held_s)
    return ControlAnswer(identity=identity, name=given.name, held_s=given.held_s)


@control_router.delete("/control", operation_id="release_control", status_code=204)
async def release_control(bench: TheBench, caller: Caller = None) -> Response:
    """Give the camera back; from anybody but the holder it changes nothing."""
    if caller:
        bench.control.release(caller)
    return Response(status_code=204)
