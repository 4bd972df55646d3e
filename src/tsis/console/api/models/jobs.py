"""Work that takes longer than a call."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tsis.console.api.models.camera import FoundCameraTold
from tsis.console.api.models.common import Answer, Told
from tsis.console.api.models.estimates import EstimateTold, RecomputationTold
from tsis.console.bench.jobs import RESULTS


class JobTold(Told):
    """How far a job is."""

    identity: str
    title: str
    status: str = Field(description="running, done, failed or ended")
    done: int = Field(description="steps done")
    total: int = Field(description="steps in all; 0 where nobody can tell")
    sentence: str = Field(description="why it failed, or what came out")


class RecordingTold(Told):
    """What became of the frames while a sequence was recorded."""

    kept: int
    missed: int = Field(description="numbered by the camera and never come")
    overrun: int = Field(description="come and not taken by the disk in time")
    interruptions: int
    seconds: float
    frames_per_s: float
    ended_by: str = Field(description="why it ended before its time; empty else")


class EstimateResult(Told):
    """An estimate, as it is stored."""

    kind: Literal["estimate"] = "estimate"
    estimate: EstimateTold


class RecomputeResult(Told):
    """Estimates made again."""

    kind: Literal["recompute"] = "recompute"
    recomputations: list[RecomputationTold]


class SequenceResult(Told):
    """A sequence on the disk."""

    kind: Literal["sequence"] = "sequence"
    folder: str
    report: RecordingTold


class SearchResult(Told):
    """The cameras that answered."""

    kind: Literal["cameras"] = "cameras"
    found: list[FoundCameraTold]
    missing: dict[str, str]


JobResult = Annotated[EstimateResult | RecomputeResult | SequenceResult | SearchResult, Field(discriminator="kind")]


class JobAnswer(Answer):
    """A job."""

    command: Literal["job"] = "job"
    job: JobTold
    result: JobResult | None = Field(
        default=None,
        description=f"null before it is done, of jobs that the pages began, and of all but the last {RESULTS} results",
    )


class JobsAnswer(Answer):
    """The jobs of this console, the newest last."""

    command: Literal["jobs"] = "jobs"
    jobs: list[JobTold]
