"""Stored targets and their presses."""

from __future__ import annotations

from dataclasses import replace

import cv2
from fastapi import APIRouter, Response

from tsis.console.api.asking import PageAsked, PressIdentity, TargetNumber, TheBench, known_press, known_target
from tsis.console.api.documented import OF_BODIES, OF_EDITS, OF_RECORDS, file
from tsis.console.api.models.presses import PressesAnswer
from tsis.console.api.models.targets import SummaryTold, TargetAnswer, TargetGiven, TargetsAnswer
from tsis.console.api.telling import told_press, told_target
from tsis.instrument.png import QUICK
from tsis.model.errors import InputError

targets_router = APIRouter(prefix="/targets", tags=["records"])


@targets_router.get("", operation_id="list_targets")
def list_targets(bench: TheBench, page: PageAsked) -> TargetsAnswer:
    """List the targets of the store by number."""
    found = bench.store.targets()
    part = found[page.offset : page.offset + page.limit]
    return TargetsAnswer(
        total=len(found),
        offset=page.offset,
        targets=[
            SummaryTold(target=told_target(each.target), presses=each.presses, estimates=each.estimates, last=each.last)
            for each in part
        ],
    )


@targets_router.get("/{number}", operation_id="get_target", responses=OF_RECORDS)
def get_target(bench: TheBench, number: TargetNumber) -> TargetAnswer:
    """Tell what is stored of a target."""
    target = known_target(bench, number)
    return TargetAnswer(target=told_target(target), presses=bench.store.press_count(target))


@targets_router.patch("/{number}", operation_id="edit_target", responses={**OF_RECORDS, **OF_EDITS, **OF_BODIES})
def edit_target(bench: TheBench, number: TargetNumber, given: TargetGiven) -> TargetAnswer:
    """Change name, note or truth of a target as it was read; 409 when somebody has changed it since.

    The audit of the store keeps that it was changed, and when.
    """
    target = known_target(bench, number)
    changes = given.model_dump(exclude={"version"}, exclude_none=True)
    if not changes:
        raise InputError("an edit must change something: name, note or truth; got none of them")
    edited = bench.store.edit_target(replace(target, version=given.version), **changes)
    return TargetAnswer(target=told_target(edited), presses=bench.store.press_count(edited))


@targets_router.get("/{number}/presses", operation_id="list_presses", responses=OF_RECORDS)
def list_presses(bench: TheBench, number: TargetNumber, page: PageAsked) -> PressesAnswer:
    """List presses of a target in the order in which they were taken."""
    target = known_target(bench, number)
    return PressesAnswer(
        target=number,
        total=bench.store.press_count(target),
        offset=page.offset,
        presses=[told_press(each) for each in bench.store.presses(target, limit=page.limit, offset=page.offset)],
    )


@targets_router.get(
    "/{number}/presses/{identity}/frame.png",
    operation_id="get_press_frame",
    response_class=Response,
    responses={**file("image/png", "the frame, lossless: grey levels of 8 or 16 bits"), **OF_RECORDS},
)
def get_press_frame(bench: TheBench, number: TargetNumber, identity: PressIdentity) -> Response:
    """Send the stored frame of a press, after its hash was found right; 503 when it is damaged."""
    _, press = known_press(bench, number, identity)
    content = cv2.imencode(".png", bench.store.levels(press.frame), QUICK)[1].tobytes()
    return Response(content, media_type="image/png", headers={"TSIS-Full-Scale": f"{press.full_scale:g}"})
