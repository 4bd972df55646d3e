"""Which cameras there are."""

from __future__ import annotations

from fastapi import APIRouter

from tsis.console.api.asking import TheBench
from tsis.console.api.documented import OF_JOBS
from tsis.console.api.models.camera import CamerasAnswer
from tsis.console.api.models.jobs import JobAnswer, JobTold
from tsis.console.api.telling import told_cameras

cameras_router = APIRouter(prefix="/cameras", tags=["camera"])


@cameras_router.get("", operation_id="list_cameras")
def list_cameras(bench: TheBench) -> CamerasAnswer:
    """List the cameras that the last search found; the virtual probe is always there."""
    found = bench.search.findings
    if found is None:
        return CamerasAnswer(searched=False, found=[], missing={})
    return CamerasAnswer(searched=True, found=told_cameras(found.found), missing=dict(found.missing))


@cameras_router.post("/search", operation_id="search_cameras", responses=OF_JOBS, status_code=202)
def search_cameras(bench: TheBench) -> JobAnswer:
    """Ask every source for its cameras, which takes seconds; the job's result tells them."""
    return JobAnswer(job=JobTold.model_validate(bench.search.begin().state()))
