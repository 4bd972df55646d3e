"""Estimates of stored targets, and what they look like on paper."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from fastapi import APIRouter, Body, Response

from tsis.console.api.asking import TargetNumber, TheBench, TheReports, known_target
from tsis.console.api.documented import OF_BODIES, OF_JOBS, OF_RECORDS, file
from tsis.console.api.models.estimates import EstimateGiven, EstimatesAnswer, RecomputeGiven
from tsis.console.api.models.jobs import JobAnswer, JobTold
from tsis.console.api.telling import told_estimate
from tsis.records.estimation import PRIORS
from tsis.records.recompute import recompute

estimates_router = APIRouter(prefix="/targets/{number}", tags=["records"])


@estimates_router.get("/estimates", operation_id="list_estimates", responses=OF_RECORDS)
def list_estimates(bench: TheBench, number: TargetNumber) -> EstimatesAnswer:
    """List the estimates of a target in the order in which they were made."""
    target = known_target(bench, number)
    dossier = bench.store.dossier(target, limit=0)
    return EstimatesAnswer(
        target=number,
        in_force=[each.id for each in dossier.in_force],
        estimates=[told_estimate(each, target.truth) for each in dossier.estimates],
        damaged=list(dossier.damaged),
    )


@estimates_router.post(
    "/estimate", operation_id="estimate_target", responses={**OF_RECORDS, **OF_JOBS, **OF_BODIES}, status_code=202
)
def estimate_target(bench: TheBench, number: TargetNumber, given: Annotated[EstimateGiven, Body()]) -> JobAnswer:
    """Estimate a target from its presses and store what was found; the job's result tells it."""
    known_target(bench, number)
    job = bench.estimate(number, kind=given.kind, presses=given.presses, options=_options(given))
    return JobAnswer(job=JobTold.model_validate(job.state()))


@estimates_router.post(
    "/recompute", operation_id="recompute_target", responses={**OF_RECORDS, **OF_JOBS, **OF_BODIES}, status_code=202
)
def recompute_target(
    bench: TheBench, number: TargetNumber, given: Annotated[RecomputeGiven | None, Body()] = None
) -> JobAnswer:
    """Make the estimates in force again with the code of today, and store those that came out otherwise."""
    target, dry_run = known_target(bench, number), given is not None and given.dry_run
    job = bench.jobs.begin(
        f"recomputation of target {number}",
        lambda job: recompute(bench.store, target, dry_run=dry_run, progress=job.advance),
    )
    return JobAnswer(job=JobTold.model_validate(job.state()))


@estimates_router.get(
    "/report.html",
    operation_id="get_report_html",
    response_class=Response,
    responses={**file("text/html", "one page, self-contained"), **OF_RECORDS},
)
def get_report_html(bench: TheBench, reports: TheReports, number: TargetNumber) -> Response:
    """Send the report of a target as a page."""
    return Response(reports.content(known_target(bench, number), "html"), media_type="text/html")


@estimates_router.get(
    "/report.pdf",
    operation_id="get_report_pdf",
    response_class=Response,
    responses={**file("application/pdf", "the same on paper"), **OF_RECORDS},
)
def get_report_pdf(bench: TheBench, reports: TheReports, number: TargetNumber) -> Response:
    """Send the report of a target as a PDF."""
    return Response(reports.content(known_target(bench, number), "pdf"), media_type="application/pdf")


def _options(given: EstimateGiven) -> dict[str, Any]:
    """Options as a stored estimate keeps them: a prior whole, so that a later release knows what was believed."""
    asked = given.model_dump(exclude={"kind", "presses"}, exclude_none=True)
    if "prior" in asked:
        prior = PRIORS[given.kind](**{name: _pair(value) for name, value in asked["prior"].items()})
        asked["prior"] = asdict(prior)
    return asked


def _pair(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
