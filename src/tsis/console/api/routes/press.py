"""What is pressed, and what is kept of it."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

from fastapi import APIRouter, Body

from tsis.console.api.asking import Acting, TheBench
from tsis.console.api.documented import OF_ACTS, OF_BODIES
from tsis.console.api.models.jobs import JobAnswer, JobTold
from tsis.console.api.models.presses import (
    FilesTold,
    KeptAnswer,
    SequenceOfFrames,
    SequenceOfSeconds,
    SnapshotGiven,
)
from tsis.console.api.models.sight import FlagTold
from tsis.console.api.models.state import PressGiven, StateAnswer, TargetChoiceGiven
from tsis.console.api.routes.state import state_answer
from tsis.console.api.telling import told_press
from tsis.model.errors import InputError

press_router = APIRouter(tags=["press"])


@press_router.put("/target", operation_id="choose_target", responses={**OF_ACTS, **OF_BODIES})
def choose_target(bench: TheBench, given: TargetChoiceGiven, by: Acting) -> StateAnswer:
    """Choose the target that snapshots go to; it is entered with its first press."""
    bench.set_target(given.number, by=by)
    return state_answer(bench, by)


@press_router.put("/press", operation_id="hold_press", responses={**OF_ACTS, **OF_BODIES})
def hold_press(bench: TheBench, given: PressGiven, by: Acting) -> StateAnswer:
    """Say what is pressed and how hard; the virtual probe is moved there."""
    if not given.model_fields_set:
        raise InputError("press must say something: role, force_n or both; got neither")
    forget = "force_n" in given.model_fields_set and given.force_n is None
    bench.hold(role=given.role, force_n=given.force_n, forget=forget, by=by)
    return state_answer(bench, by)


@press_router.post("/snapshot", operation_id="take_snapshot", responses={**OF_ACTS, **OF_BODIES}, status_code=201)
def take_snapshot(bench: TheBench, by: Acting, given: Annotated[SnapshotGiven | None, Body()] = None) -> KeptAnswer:
    """Keep the press as it is seen now: its files, and the press in the store; when this answers, both last."""
    kept = bench.snapshot(by=by, map_name=(given or SnapshotGiven()).map_name)
    files = {name: str(path.resolve()) for name, path in asdict(kept.files).items()}
    return KeptAnswer(
        target=kept.target.number,
        press=told_press(kept.press),
        files=FilesTold(**files),
        flags=[FlagTold.model_validate(flag) for flag in kept.flags],
        notes=list(kept.notes),
    )


@press_router.post("/sequence", operation_id="begin_sequence", responses={**OF_ACTS, **OF_BODIES}, status_code=202)
def begin_sequence(bench: TheBench, given: SequenceOfSeconds | SequenceOfFrames, by: Acting) -> JobAnswer:
    """Record every frame until so many have come or so much time has passed."""
    job = bench.begin_sequence(**given.model_dump(), by=by)
    return JobAnswer(job=JobTold.model_validate(job.state()))


@press_router.delete("/sequence", operation_id="end_sequence", responses=OF_ACTS)
def end_sequence(bench: TheBench, by: Acting) -> StateAnswer:
    """End the sequence under way; what was recorded stays. Without one nothing happens."""
    bench.end_sequence(by=by)
    return state_answer(bench, by)
