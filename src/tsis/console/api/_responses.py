"""From the program's values to what answers hold."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from tsis.console.api._models_camera import FoundCameraTold
from tsis.console.api._models_records import (
    EstimateResult,
    EstimateTold,
    PressTold,
    RecomputationTold,
    RecomputeResult,
    RecordingTold,
    SearchResult,
    SequenceResult,
    ShiftTold,
    TargetTold,
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


def told_press(press: StoredPress) -> PressTold:
    """A press as answers tell it; infinities of its settings are words."""
    return PressTold(**press_to_plain(press))


def told_target(target: Target) -> TargetTold:
    """A target as answers tell it."""
    return TargetTold(**target_to_plain(target))


def told_estimate(stored: StoredEstimate, truth: Mapping[str, float] | None = None) -> EstimateTold:
    """A stored estimate with the truth beside its parameters, where all of them are known."""
    plain = estimate_to_plain(stored)
    made = plain.pop("estimate")
    beside = None if truth is None or not set(stored.estimate.samples) <= set(truth) else truth
    document = estimate_document(stored.estimate, beside)
    return EstimateTold(**{**plain, **document, "provenance": made["provenance"]})


def told_cameras(found: Iterable[CameraInfo]) -> list[FoundCameraTold]:
    """The cameras that answered."""
    return [FoundCameraTold(**asdict(each), spec=each.spec) for each in found]


def told_result(result: Any, store: Store) -> JobResult | None:
    """What a job returned; None before it is done, and where the pages alone know what it is."""
    match result:
        case StoredEstimate():
            truths = (each.target.truth for each in store.targets() if each.target.id == result.target)
            return EstimateResult(estimate=told_estimate(result, next(truths, None)))
        case CameraListing():
            return SearchResult(found=told_cameras(result.found), missing=dict(result.missing))
        case (Recomputation(), *_):
            return RecomputeResult(recomputations=[_recomputation(each) for each in result])
        case {"folder": str(folder), "report": dict(report)}:
            return SequenceResult(folder=folder, report=RecordingTold(**report))
        case _:
            return None


def _recomputation(made: Recomputation) -> RecomputationTold:
    return RecomputationTold(
        kind=made.before.kind,
        same=made.same,
        sentence=made.sentence,
        causes=list(made.causes),
        notes=list(made.notes),
        shifts=[ShiftTold.model_validate(shift) for shift in made.shifts],
        flags_gained=list(made.flags_gained),
        flags_lost=list(made.flags_lost),
        before=made.before.id,
        stored_as=made.after.id if made.stored else None,
    )
