"""From the program's values to what answers hold."""

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
    reference = estimate_to_json(stored)
    created = reference.pop("estimate")
    beside = None if truth is None or not set(stored.estimate.samples) <= set(truth) else truth
    document = estimate_document(stored.estimate, beside)
    return EstimateItem(**{**reference, **document, "provenance": created["provenance"]})


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


def _recomputation(made: Recomputation) -> RecomputationItem:
    return RecomputationItem(
        kind=made.before.kind,
        same=made.same,
        sentence=made.message,
        causes=list(made.causes),
        notes=list(made.notes),
        shifts=made.shifts,
        flags_gained=list(made.flags_gained),
        flags_lost=list(made.flags_lost),
        before=made.before.id,
        stored_as=made.after.id if made.stored else None,
    )
