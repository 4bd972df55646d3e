"""Response models of stored values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tsis.console.api._models_records import (
    EstimateItem,
    EstimateResult,
    RecomputationItem,
    RecomputeResult,
    SearchResult,
    SequenceResult,
)
from tsis.instrument import CameraListing
from tsis.instrument.recording import RecordingReport
from tsis.records import Recomputation, StoredEstimate, estimate_to_json
from tsis.report import estimate_document

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tsis.console.api._models_records import JobResult
    from tsis.records.store import Store


def estimate_item(stored: StoredEstimate, truth: Mapping[str, float] | None = None) -> EstimateItem:
    """A stored estimate with the truth beside its parameters, where all of them are known."""
    fields = estimate_to_json(stored)
    provenance = fields.pop("estimate")["provenance"]
    known = None if truth is None or not set(stored.estimate.names) <= set(truth) else truth
    return EstimateItem(**{**fields, **estimate_document(stored.estimate, known), "provenance": provenance})


def job_result(result: Any, store: Store) -> JobResult | None:
    """What a job returned; None before it is done, and where the pages alone know what it is."""
    match result:
        case StoredEstimate():
            truths = (target.target.truth for target in store.targets() if target.target.id == result.target)
            return EstimateResult(estimate=estimate_item(result, next(truths, None)))
        case CameraListing():
            return SearchResult(found=result.cameras, missing=dict(result.missing))
        case (Recomputation(), *_):
            return RecomputeResult(recomputations=[_recomputation(item) for item in result])
        case {"folder": str(folder), "report": dict(report)}:
            return SequenceResult(folder=folder, report=RecordingReport(**report))
        case _:
            return None


def _recomputation(item: Recomputation) -> RecomputationItem:
    return RecomputationItem(
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
