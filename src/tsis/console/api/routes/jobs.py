"""Work under way and done."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fastapi import APIRouter

from tsis.console.api.asking import CONTROL, Caller, JobIdentity, TheBench
from tsis.console.api.documented import OF_ACTS, OF_RECORDS
from tsis.console.api.errors import AbsentError, NoControlError
from tsis.console.api.models.jobs import JobAnswer, JobsAnswer, JobTold
from tsis.console.api.telling import told_result
from tsis.model.errors import InputError

if TYPE_CHECKING:
    from tsis.console.bench import Bench, Job

jobs_router = APIRouter(prefix="/jobs", tags=["jobs"])


@jobs_router.get("", operation_id="list_jobs")
def list_jobs(bench: TheBench) -> JobsAnswer:
    """List the last jobs of this console, the newest last."""
    return JobsAnswer(jobs=[JobTold.model_validate(state) for state in bench.jobs.states()])


@jobs_router.get("/{identity}", operation_id="get_job", responses=OF_RECORDS)
def get_job(bench: TheBench, identity: JobIdentity) -> JobAnswer:
    """Tell how far a job is, and what it returned."""
    return _job_response(bench, _known(bench, identity))


@jobs_router.delete("/{identity}", operation_id="end_job", responses={**OF_RECORDS, **OF_ACTS})
def end_job(bench: TheBench, identity: JobIdentity, caller: Caller = None) -> JobAnswer:
    """Ask a job to end, which it does at its next step; one that follows the camera only for who holds it."""
    job = _known(bench, identity)
    if job.follows_camera and not caller:
        raise NoControlError(f"to end what follows the camera needs the header {CONTROL}, which POST /v1/control gives")
    bench.end_job(identity, by=caller or "")
    return _job_response(bench, job)


def _known(bench: Bench, identity: str) -> Job:
    try:
        return bench.jobs.get(identity)
    except InputError as error:
        raise AbsentError(str(error)) from error


def _job_response(bench: Bench, job: Job) -> JobAnswer:
    state = job.state()
    return JobAnswer(job=JobTold.model_validate(state), result=told_result(job.result, bench.store))
