"""Response models of stored values, and what calls depend on: the instrument, its owner, a named record."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Depends, Header, Path, Query
from pydantic import BaseModel, ConfigDict, Field
from starlette.requests import Request

from tsis.__about__ import LARGEST_TARGET
from tsis.console._statuses import NoControlError, absent_if_unknown
from tsis.console.api import _models_records as models
from tsis.console.files import Reports
from tsis.console.services import Instrument
from tsis.instrument import CameraListing
from tsis.instrument.recording import RecordingReport
from tsis.present.document import estimate_document
from tsis.records.recomputation import Recomputation
from tsis.records.values import StoredEstimate, estimate_to_json

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.records.store import Store
    from tsis.records.values import StoredPress, Target


def estimate_item(stored: StoredEstimate, truth: Mapping[str, float] | None = None) -> models.EstimateItem:
    """A stored estimate with the truth beside its parameters, where all of them are known."""
    fields = estimate_to_json(stored)
    provenance = fields.pop("estimate")["provenance"]
    known = None if truth is None or not set(stored.estimate.names) <= set(truth) else truth
    return models.EstimateItem(**{**fields, **estimate_document(stored.estimate, known), "provenance": provenance})


def job_result(result: Any, store: Store) -> models.JobResult | None:
    """What a job returned; None before it is done, and where the pages alone know what it is."""
    match result:
        case StoredEstimate():
            truths = (target.target.truth for target in store.targets() if target.target.id == result.target)
            return models.EstimateResult(estimate=estimate_item(result, next(truths, None)))
        case CameraListing():
            return models.SearchResult(found=result.cameras, missing=dict(result.missing))
        case (Recomputation(), *_):
            return models.RecomputeResult(recomputations=[_recomputation(item) for item in result])
        case {"folder": str(folder), "report": dict(report)}:
            return models.SequenceResult(folder=folder, report=RecordingReport(**report))
        case _:
            return None


def _recomputation(item: Recomputation) -> models.RecomputationItem:
    return models.RecomputationItem(
        kind=item.before.kind,
        same=item.same,
        sentence=item.message,
        causes=list(item.causes),
        notes=list(item.notes),
        shifts=item.shifts,
        flags_gained=list(item.flags_gained),
        flags_lost=list(item.flags_lost),
        before=item.before.id,
        stored_as=item.after.id if item.stored else None,
    )


CONTROL = "TSIS-Control"
MOST_A_PAGE, MOST_OFFSET = 1000, 10**12
TargetNumber = Annotated[int, Path(ge=1, le=LARGEST_TARGET, description="number of a target", examples=[1])]
PressIdentity = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="identity of a press")]
JobIdentity = Annotated[str, Path(pattern="^[0-9a-f]{32}$", description="identity of a job")]
NEEDED = "identity that POST /v1/control gave; without it 428"
Caller = Annotated[str | None, Header(alias=CONTROL, description="identity that POST /v1/control gave")]
ActingCaller = Annotated[str | None, Header(alias=CONTROL, description=NEEDED)]


class PageQuery(BaseModel):
    """Which part of a long list."""

    model_config = ConfigDict(extra="forbid")

    limit: int = Field(default=100, ge=1, le=MOST_A_PAGE, description="most that are listed")
    offset: int = Field(default=0, ge=0, le=MOST_OFFSET, description="how many are skipped before")


PageOfList = Annotated[PageQuery, Query()]


async def instrument_of(request: Request) -> Instrument:
    """The instrument of the application."""
    instrument: Any = request.app.state.instrument
    assert isinstance(instrument, Instrument)
    return instrument


async def reports_of(request: Request) -> Reports:
    """Reports of the instrument's store."""
    reports: Any = request.app.state.reports
    assert isinstance(reports, Reports)
    return reports


TheInstrument = Annotated[Instrument, Depends(instrument_of)]
TheReports = Annotated[Reports, Depends(reports_of)]


async def owner(instrument: TheInstrument, identity: ActingCaller = None) -> str:
    """The owner of the camera's control; 428 without the header, 409 for anybody else."""
    if not identity:
        raise NoControlError(f"this call needs the header {CONTROL} with the identity that POST /v1/control gives")
    instrument.control.require(identity)
    return identity


Acting = Annotated[str, Depends(owner)]


def find_target(instrument: Instrument, number: int) -> Target:
    """The target of that number; `AbsentError` when there is none."""
    with absent_if_unknown():
        return instrument.store.target(number)


def find_press(instrument: Instrument, number: int, identity: str) -> tuple[Target, StoredPress]:
    """A press of a target; `AbsentError` when there is none."""
    target = find_target(instrument, number)
    with absent_if_unknown():
        return target, instrument.store.press(target, identity)
