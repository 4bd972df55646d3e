"""From the program's values to what answers hold."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tsis.console.api._models_camera import CameraInfoItem
from tsis.console.api._models_records import (
    EstimateItem,
    EstimateResult,
    PressItem,
    RecomputationItem,
    RecomputeResult,
    RecordingItem,
    SearchResult,
    SequenceResult,
    ShiftItem,
    TargetItem,
)
from tsis.instrument import CameraListing
from tsis.records import Recomputation, StoredEstimate, estimate_to_plain, press_to_plain, target_to_plain
from tsis.report import estimate_document

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from tsis.console.api._models_records import JobResult
    from tsis.instrument import CameraInfo
    from tsis.records import StoredPress, Target
    from tsis.records.store import Store


def press_item(press: StoredPress) -> PressItem:
    """A press as answers tell it; infinities of its settings are words."""
    return PressItem(**press_to_plain(press))


def target_item(target: Target) -> TargetItem:
    """A target as answers tell it."""
    return TargetItem(**target_to_plain(target))


def estimate_item(stored: StoredEstimate, truth: Mapping[str, float] | None = None) -> EstimateItem:
    """A stored estimate with the truth beside its parameters, where all of them are known."""
    reference = estimate_to_plain(stored)
    created = reference.pop("estimate")
    beside = None if truth is None or not set(stored.estimate.samples) <= set(truth) else truth
    document = estimate_document(stored.estimate, beside)
    return EstimateItem(**{**reference, **document, "provenance": created["provenance"]})


def camera_items(found: Iterable[CameraInfo]) -> list[CameraInfoItem]:
    """The cameras that answered."""
    return [CameraInfoItem(**asdict(item), spec=item.spec) for item in found]


def job_result(result: Any, store: Store) -> JobResult | None:
    """What a job returned; None before it is done, and where the pages alone know what it is."""
    match result:
        case StoredEstimate():
            truths = (target.target.truth for target in store.targets() if target.target.id == result.target)
            return EstimateResult(estimate=estimate_item(result, next(truths, None)))
        case CameraListing():
            return SearchResult(found=camera_items(result.cameras), missing=dict(result.missing))
        case (Recomputation(), *_):
            return RecomputeResult(recomputations=[_recomputation(item) for item in result])
        case {"folder": str(folder), "report": dict(report)}:
            return SequenceResult(folder=folder, report=RecordingItem(**report))
        case _:
            return None


def _recomputation(made: Recomputation) -> RecomputationItem:
    return RecomputationItem(
        kind=made.before.kind,
        same=made.same,
        sentence=made.message,
        causes=list(made.causes),
        notes=list(made.notes),
        shifts=[ShiftItem.model_validate(shift) for shift in made.shifts],
        flags_gained=list(made.flags_gained),
        flags_lost=list(made.flags_lost),
        before=made.before.id,
        stored_as=made.after.id if made.stored else None,
    )
